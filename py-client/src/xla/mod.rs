//! Steps inside of programs of XLA, for `tightloop.adapters.jax`: a handler of its foreign functions.
//!
//! A program carries a token from call to call: the number of a target, and its calls so far. It names the target, so that a
//! compiled program serves every simulation of the same shapes. It orders calls. And a token that was used before is refused,
//! since the worlds are in the daemon, and cannot go back to it.

mod abi;
mod arrays;
mod function;
mod simulation;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use bytemuck::{AnyBitPattern, cast_slice};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sim_protocol::Dtype;

use crate::errors::raise;
use abi::{Call, Code, Failure, Kind, Operand, Output, internal};
use arrays::{Array, ArrayMut, borrowed, borrowed_mut};

pub(crate) use function::xla_function;
pub(crate) use simulation::{Line, token};

/// What programs call.
trait Target: Send + Sync {
    /// What it is, for messages.
    fn name(&self) -> String;

    /// Makes a call; `operands` and `outputs` are those behind the token.
    fn call(
        &self,
        call: &Names<'_>,
        operands: &[Operand<'_>],
        outputs: &mut [Output<'_>],
    ) -> Result<(), Failure>;
}

/// What is called, with which operands and outputs.
struct Names<'a> {
    call: &'a str,
    inputs: &'a str,
    fields: &'a str,
}

/// A target, and its calls so far. A call holds the lock of the count until it ends.
struct Known {
    target: Box<dyn Target>,
    calls: Mutex<u32>,
}

/// In place of the calls so far: a token for any time, of a call that begins anew.
const ANY: u32 = u32::MAX;

/// The targets that programs know; their numbers are their places, and 0 is none.
static TARGETS: RwLock<Vec<Arc<Known>>> = RwLock::new(Vec::new());

/// The addresses of the handler of the CPU and of that of other devices, for this version of XLA's interface.
///
/// Raises ``ValueError`` for a major version that is not known here.
#[pyfunction]
pub(crate) fn xla_handlers(major: i32, minor: i32) -> PyResult<(usize, usize)> {
    if major != abi::MAJOR {
        let problem = format!("version {major}.{minor} of XLA's interface is not known");
        return Err(PyValueError::new_err(problem));
    }
    abi::set_version(minor);
    Ok((abi::address(), abi::address_elsewhere()))
}

/// The call of a program, with arrays of NumPy: operands, and outputs, which are overwritten.
#[pyfunction]
#[pyo3(signature = (call, inputs, fields, operands, outputs, /))]
pub(crate) fn xla_call(
    py: Python<'_>,
    call: &str,
    inputs: &str,
    fields: &str,
    operands: Vec<Bound<'_, PyAny>>,
    outputs: Vec<Bound<'_, PyAny>>,
) -> PyResult<()> {
    let operands: Vec<Array<'_>> = operands.iter().map(borrowed).collect::<PyResult<_>>()?;
    let outputs = outputs.iter().map(borrowed_mut);
    let mut outputs: Vec<ArrayMut<'_>> = outputs.collect::<PyResult<_>>()?;
    let call = Call {
        name: call,
        inputs,
        fields,
        operands: operands
            .iter()
            .map(Array::operand)
            .collect::<PyResult<_>>()?,
        outputs: outputs
            .iter_mut()
            .map(ArrayMut::output)
            .collect::<PyResult<_>>()?,
    };
    let done = py.detach(|| run(call));
    done.map_err(|failure| raise(py, &failure.class, failure.message))
}

/// Lets programs know a target, and returns its number.
fn add(target: Box<dyn Target>) -> u32 {
    let known = Arc::new(Known {
        target,
        calls: Mutex::new(0),
    });
    let mut targets = TARGETS.write().unwrap_or_else(PoisonError::into_inner);
    targets.push(known);
    u32::try_from(targets.len()).expect("no process makes billions of simulations")
}

fn known(number: u32) -> Option<Arc<Known>> {
    let targets = TARGETS.read().unwrap_or_else(PoisonError::into_inner);
    let place = (number as usize).checked_sub(1)?;
    targets.get(place).cloned()
}

/// Makes the call of a program. The first operand is the token, the first output the next one.
///
/// # Errors
/// Those of the target, and a token that was used before.
fn run(mut call: Call<'_>) -> Result<(), Failure> {
    let (Some((first, operands)), Some((next, outputs))) =
        (call.operands.split_first(), call.outputs.split_first_mut())
    else {
        return Err(internal("the call has no token".into()));
    };
    let &[number, turn] = entries::<u32>(first, Dtype::U32, "token")? else {
        return Err(internal("the token is no pair".into()));
    };
    let known = known(number).ok_or_else(|| {
        let problem = format!("token ({number}, {turn}) is of nothing in this process");
        precondition("CommandRefused", format!("{problem}; call `token()`"))
    })?;
    // held until the call is over: of two programs with the same token one is refused
    let mut calls = locked(&known.calls);
    if turn != *calls && turn != ANY {
        return Err(used(&known.target.name(), turn, *calls));
    }
    let names = Names {
        call: call.name,
        inputs: call.inputs,
        fields: call.fields,
    };
    known.target.call(&names, operands, outputs)?;
    *calls = (*calls + 1) % ANY;
    let token = [number, *calls];
    let kind = Kind::Number(Dtype::U32);
    put(next, kind, &[2], cast_slice(&token), "token")
}

/// The entries of an operand of one type.
fn entries<'a, T: AnyBitPattern>(
    operand: &'a Operand<'_>,
    dtype: Dtype,
    name: &str,
) -> Result<&'a [T], Failure> {
    if operand.kind != Kind::Number(dtype) {
        let kind = operand.kind;
        return Err(internal(format!("`{name}` is {kind:?}, not {dtype:?}")));
    }
    Ok(cast_slice(operand.bytes))
}

/// Copies an array into an output of the same type and shape.
fn put(
    output: &mut Output<'_>,
    kind: Kind,
    shape: &[usize],
    bytes: &[u8],
    name: &str,
) -> Result<(), Failure> {
    if output.kind != kind || output.shape != shape {
        return Err(Failure {
            code: Code::InvalidArgument,
            class: "CommandRefused".into(),
            message: format!(
                "{name} is {kind:?} of shape {shape:?}, and the program was made for {:?} of shape {:?}; make it from the object \
                 whose token it gets",
                output.kind, output.shape
            ),
        });
    }
    output.bytes.copy_from_slice(bytes);
    Ok(())
}

#[cold]
fn used(name: &str, turn: u32, calls: u32) -> Failure {
    let problem = format!(
        "the token of call {turn} of {name} was used before: the worlds are at call {calls}, and cannot go back. Give each call \
         what the last one returned, or begin with `token()` of a JaxSim or `reset` of a JaxEnv; a `reset` after \
         steps in the same program takes `state`. Run the program on one device"
    );
    precondition("CommandRefused", problem)
}

fn precondition(class: &str, message: String) -> Failure {
    Failure {
        code: Code::FailedPrecondition,
        class: class.into(),
        message,
    }
}

/// Nothing is left half-written when a thread panics.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

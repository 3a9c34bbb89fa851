//! A function of Python that programs call, such as the step of an environment.

use pyo3::prelude::*;
use pyo3::types::PyList;

use super::abi::{Code, Failure, Operand, Output, internal};
use super::arrays::{Array, borrowed, to_numpy};
use super::{Names, Target, add, put};

struct Function {
    /// Takes the name of the call and a list of arrays, and returns a list of arrays.
    function: Py<PyAny>,
    name: String,
}

/// The number of a function, from now on known to programs; ``name`` is for messages.
#[pyfunction]
#[pyo3(signature = (function, name, /))]
pub(crate) fn xla_function(function: Py<PyAny>, name: String) -> u32 {
    add(Box::new(Function { function, name }))
}

impl Target for Function {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn call(
        &self,
        names: &Names<'_>,
        operands: &[Operand<'_>],
        outputs: &mut [Output<'_>],
    ) -> Result<(), Failure> {
        Python::attach(|py| {
            let done = self.done(py, names, operands, outputs);
            done.map_err(|error| raised(py, &error))?
        })
    }
}

impl Function {
    fn done(
        &self,
        py: Python<'_>,
        names: &Names<'_>,
        operands: &[Operand<'_>],
        outputs: &mut [Output<'_>],
    ) -> PyResult<Result<(), Failure>> {
        let arrays = operands.iter().map(|operand| to_numpy(py, operand));
        let arrays = PyList::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?;
        let results = self.function.bind(py).call1((names.call, arrays))?;
        let results: Vec<Bound<'_, PyAny>> = results.extract()?;
        if results.len() != outputs.len() {
            let (made, wanted) = (results.len(), outputs.len());
            let problem = format!("{} returned {made} arrays for {wanted}", self.name);
            return Ok(Err(internal(problem)));
        }
        for (result, output) in results.iter().zip(outputs) {
            let array: Array<'_> = borrowed(result)?;
            let Operand { kind, shape, bytes } = array.operand()?;
            if let Err(failure) = put(output, kind, &shape, bytes, &self.name) {
                return Ok(Err(failure));
            }
        }
        Ok(Ok(()))
    }
}

/// An exception as XLA's error: the name of its class, and its message.
fn raised(py: Python<'_>, error: &PyErr) -> Failure {
    let class = error.get_type(py);
    let class = class.name().map(|name| name.to_string());
    let code = match class.as_deref() {
        Ok("DaemonLost" | "DaemonRestarted" | "LeaseLost") => Code::Unavailable,
        _ => Code::FailedPrecondition,
    };
    Failure {
        code,
        class: class.unwrap_or_else(|_| "Exception".to_owned()),
        message: error.value(py).to_string(),
    }
}

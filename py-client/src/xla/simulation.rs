//! A simulation that programs step, without Python.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, Weak};

use bytemuck::cast_slice;
use sim_protocol::{Client, Command, Description, Dtype, Frame, Hook, ProtocolError, Values};

use super::abi::{Code, Failure, Kind, Operand, Output, internal};
use super::{Names, Target, add, entries, known, locked, precondition, put};
use crate::errors::class;

/// The connection of a client; none once it is closed.
pub(crate) struct Line {
    pub(crate) client: Mutex<Option<Arc<Client>>>,
    /// Number of the target; 0 until programs know it.
    number: Mutex<u32>,
}

impl Line {
    pub(crate) fn new(client: Client) -> Arc<Line> {
        Arc::new(Line {
            client: Mutex::new(Some(client.into())),
            number: Mutex::new(0),
        })
    }
}

struct Simulation {
    line: Weak<Line>,
    name: String,
    worlds: usize,
}

/// The number of a client, from now on known to programs, and its calls so far.
pub(crate) fn token(line: &Arc<Line>, description: &Description) -> (u32, u32) {
    let mut number = locked(&line.number);
    if *number == 0 {
        *number = add(Box::new(Simulation {
            line: Arc::downgrade(line),
            name: description.name.clone(),
            worlds: description.worlds,
        }));
    }
    let calls = known(*number).map_or(0, |known| *locked(&known.calls));
    (*number, calls)
}

impl Target for Simulation {
    fn name(&self) -> String {
        format!("simulation `{}`", self.name)
    }

    fn call(
        &self,
        names: &Names<'_>,
        operands: &[Operand<'_>],
        outputs: &mut [Output<'_>],
    ) -> Result<(), Failure> {
        let frame = self.frame(names, operands)?;
        let mut outputs = outputs.iter_mut();
        for name in names.fields.split_whitespace() {
            let view = frame.field(name).map_err(|error| failure(&error))?;
            let Some(output) = outputs.next() else {
                return Err(internal(format!("the call has no place for `{name}`")));
            };
            let kind = Kind::Number(view.dtype);
            put(output, kind, view.shape, view.as_bytes(), name)?;
        }
        Ok(())
    }
}

impl Simulation {
    /// Makes a call, and returns its frame. Operands are the mask of a reset or a write, then what [`Names::inputs`] names.
    fn frame(&self, names: &Names<'_>, operands: &[Operand<'_>]) -> Result<Frame, Failure> {
        let line = self.line.upgrade().ok_or_else(|| self.closed())?;
        let client = locked(&line.client).clone();
        let client = client.ok_or_else(|| self.closed())?;
        let mut operands = operands.iter();
        let mut next = |what: &str| {
            let operand = operands.next();
            operand.ok_or_else(|| internal(format!("the call lacks `{what}`")))
        };
        let mask = match names.call {
            "reset" | "write" => Some(mask(next("mask")?)?),
            _ => None,
        };
        let (mut seeds, mut commands) = (None, Vec::new());
        for name in names.inputs.split_whitespace() {
            let operand = next(name)?;
            match name {
                "seed" => seeds = Some(seeds_of(operand)?),
                _ => commands.push(self.command(name, operand)?),
            }
        }
        // closing the simulation in another thread ends a call that waits
        let is_closed = || locked(&line.client).is_none();
        let hook: Hook<'_> = &mut || match is_closed() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let mask = mask.as_deref();
        let made = match names.call {
            "step" => client.step(&commands, hook),
            "reset" => client.reset_to(&commands, mask, seeds.as_deref(), hook),
            "write" => client.write(&commands, mask, hook),
            "forward" => client.forward(hook),
            // those of environments name what they are of
            other if other.contains(" of ") => {
                let problem = format!(
                    "this token is of {}; the program was made for the {other}",
                    self.name()
                );
                return Err(precondition("ArgumentError", problem));
            }
            other => return Err(internal(format!("there is no call `{other}`"))),
        };
        made.map_err(|error| match is_closed() {
            true => self.closed(),
            false => failure(&error),
        })
    }

    /// A command with all of its columns.
    fn command<'a>(&self, name: &'a str, operand: &'a Operand<'_>) -> Result<Command<'a>, Failure> {
        let [worlds, columns] = operand.shape[..] else {
            return Err(internal(format!(
                "`{name}` is of shape {:?}",
                operand.shape
            )));
        };
        if worlds != self.worlds {
            let problem = format!(
                "{name}: the simulation has {} worlds, and the program gives {worlds} rows; make it from the `JaxSim` of this \
                 simulation",
                self.worlds
            );
            return Err(precondition("CommandRefused", problem));
        }
        let values = match operand.kind {
            Kind::Number(Dtype::F64) => Values::F64(cast_slice(operand.bytes)),
            _ => Values::F32(entries(operand, Dtype::F32, name)?),
        };
        Ok(Command {
            field: name,
            columns: 0..columns,
            values,
        })
    }

    #[cold]
    fn closed(&self) -> Failure {
        let problem = format!(
            "simulation `{}` was closed or dropped; launch or attach again, and give the program the token of the new one",
            self.name
        );
        precondition("SimClosed", problem)
    }
}

/// The worlds of a mask.
fn mask(operand: &Operand<'_>) -> Result<Vec<bool>, Failure> {
    if operand.kind != Kind::Bool {
        return Err(internal(format!("the mask is {:?}", operand.kind)));
    }
    Ok(operand.bytes.iter().map(|&byte| byte != 0).collect())
}

fn seeds_of(operand: &Operand<'_>) -> Result<Vec<u64>, Failure> {
    let seeds = entries::<u32>(operand, Dtype::U32, "seed")?;
    Ok(seeds.iter().copied().map(u64::from).collect())
}

fn failure(error: &ProtocolError) -> Failure {
    let class = class(error);
    let code = match class {
        "DaemonLost" | "DaemonRestarted" | "LeaseLost" | "TransportError" | "WaitTimeout" => {
            Code::Unavailable
        }
        "FramesHeld" | "ResourceError" => Code::ResourceExhausted,
        "CommandRefused" => Code::InvalidArgument,
        _ => Code::FailedPrecondition,
    };
    Failure {
        code,
        class: class.into(),
        message: error.to_string(),
    }
}

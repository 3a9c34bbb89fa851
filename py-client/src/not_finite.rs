//! Which command is not finite, for the warning of the fault that it leads to.

use std::sync::{Mutex, PoisonError};

use sim_protocol::{Command, Description, Values};

/// A world, and what its command is: `joint_f of `arm/joint1` is NaN`.
pub(crate) type Culprit = (usize, String);

/// The first command of a step that is not finite, until the frame of the step is there.
#[derive(Default)]
pub(crate) struct NotFinite(Mutex<Option<Culprit>>);

impl NotFinite {
    /// Looks through the arrays of a step.
    pub(crate) fn look(&self, description: &Description, commands: &[Command<'_>]) {
        let culprit = commands.iter().find_map(|of| culprit(description, of));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = culprit;
    }

    /// What the last step had.
    pub(crate) fn take(&self) -> Option<Culprit> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn culprit(description: &Description, of: &Command<'_>) -> Option<Culprit> {
    let is_finite = match of.values {
        Values::F32(values) => are_finite_f32(values),
        Values::F64(values) => are_finite_f64(values),
    };
    if is_finite {
        return None;
    }
    let place = match of.values {
        Values::F32(values) => values.iter().position(|value| !value.is_finite()),
        Values::F64(values) => values.iter().position(|value| !value.is_finite()),
    }?;
    let value = match of.values {
        Values::F32(values) => f64::from(values[place]),
        Values::F64(values) => values[place],
    };
    let width = of.columns.len();
    let (world, column) = (place / width, of.columns.start + place % width);
    let (axis, parts) = sim_daemon::input_axis(of.field).unwrap_or((String::new(), 1));
    let names = description.names(&axis).unwrap_or_default();
    let owner = match names.get(column / parts) {
        Some(name) => format!(" of `{name}`"),
        None => String::new(),
    };
    Some((world, format!("{}{owner} is {value}", of.field)))
}

// the exponent's bits are all ones; comparisons of integers fill registers, where sums of floats do not
fn are_finite_f32(values: &[f32]) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    let largest = values.iter().map(|value| value.to_bits() & EXPONENT).max();
    largest != Some(EXPONENT)
}

fn are_finite_f64(values: &[f64]) -> bool {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let largest = values.iter().map(|value| value.to_bits() & EXPONENT).max();
    largest != Some(EXPONENT)
}

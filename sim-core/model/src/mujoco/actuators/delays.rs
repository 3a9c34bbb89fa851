//! How late controls of actuators act.

use crate::description::{ActuatorDelay, Interpolation};
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;

/// The delay of each actuator; none where its control acts at once. Older versions of MuJoCo have none.
pub(super) fn read(
    file: &ModelFile,
    count: usize,
) -> Result<Vec<Option<ActuatorDelay>>, ModelError> {
    // arrays of 0 alone have no rows to read
    if file.first_set("actuator_delay").is_none() {
        return Ok(vec![None; count]);
    }
    let delays = file.reals("actuator_delay", count)?;
    // a file that an older release saved has delays without what they need
    let buffers = file.vectors_of_integers::<2>("actuator_history", count)?;
    let both = delays.into_iter().zip(buffers);
    both.map(|(seconds, [samples, interpolation])| {
        if !seconds.is_finite() {
            return Err(file.fault("has a delay of an actuator that is not finite".to_owned()));
        }
        let samples = usize::try_from(samples).unwrap_or(0);
        // without a buffer, MuJoCo reads the control itself; less than a step counts as one
        let is_late = seconds != 0.0 && samples > 0;
        Ok(is_late.then_some(ActuatorDelay {
            seconds,
            samples,
            interpolation: match interpolation {
                0 => Interpolation::Hold,
                1 => Interpolation::Line,
                _ => Interpolation::Spline,
            },
        }))
    })
    .collect()
}

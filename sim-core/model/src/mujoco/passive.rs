//! Passive forces of a model: compensation of gravity.

use super::format::ModelFile;
use super::options::has_flag;
use crate::description::Compensator;
use crate::error::ModelError;

/// Does the model have no passive forces at all? Without springs and dampers, MuJoCo leaves out all others too.
fn is_off(file: &ModelFile) -> Result<bool, ModelError> {
    Ok(has_flag(file, "mjDSBL_SPRING")? && has_flag(file, "mjDSBL_DAMPER")?)
}

/// Links that are held against gravity, each with its share of compensation.
pub(super) fn compensations(
    file: &ModelFile,
    bodies: usize,
) -> Result<Vec<(usize, f64)>, ModelError> {
    let shares = file.reals("body_gravcomp", bodies)?;
    // MuJoCo skips all of it where no share is positive
    if is_off(file)? || !shares.iter().any(|&share| share > 0.0) {
        return Ok(Vec::new());
    }
    let shares = shares.into_iter().enumerate();
    Ok(shares.filter(|&(_, share)| share != 0.0).collect())
}

/// What compensates gravity along each joint.
pub(super) fn compensators(
    file: &ModelFile,
    joints: usize,
) -> Result<Vec<Compensator>, ModelError> {
    let acts = file.rows("actuator_trntype") > 0 && !has_flag(file, "mjDSBL_ACTUATION")?;
    let of_actuators = file.integers("jnt_actgravcomp", joints)?;
    let kinds = of_actuators.into_iter().map(|own| match (own, acts) {
        (0, _) => Compensator::Passive,
        (_, true) => Compensator::Actuators,
        (_, false) => Compensator::Nothing,
    });
    Ok(kinds.collect())
}

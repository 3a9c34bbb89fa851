//! Passive forces of a model: compensation of gravity, and the medium.

use super::format::ModelFile;
use super::frame;
use super::options::has_flag;
use crate::description::{Compensator, Drag};
use crate::error::ModelError;
use std::f64::consts::PI;

/// Does the model have no passive forces at all? Without springs and dampers, MuJoCo leaves out all others too.
fn is_off(file: &ModelFile) -> Result<bool, ModelError> {
    Ok(has_flag(file, "mjDSBL_SPRING")? && has_flag(file, "mjDSBL_DAMPER")?)
}

/// Links that are held against gravity, each with its share of compensation; none where the model has no passive forces.
pub(super) fn compensations(
    file: &ModelFile,
    bodies: usize,
) -> Result<Option<Vec<(usize, f64)>>, ModelError> {
    let shares = file.reals("body_gravcomp", bodies)?;
    if is_off(file)? {
        return Ok(None);
    }
    // MuJoCo skips all of it where no share is positive
    if !shares.iter().any(|&share| share > 0.0) {
        return Ok(Some(Vec::new()));
    }
    let shares = shares.into_iter().enumerate();
    Ok(Some(shares.filter(|&(_, share)| share != 0.0).collect()))
}

/// Least mass of a link on which the medium acts (MuJoCo: `mjMINVAL`) [kg].
const MASS_MIN: f64 = 1e-15;

/// What the medium does to links: each counts as the box that has its mass and inertia.
pub(super) fn drags(file: &ModelFile, bodies: usize) -> Result<Vec<Drag>, ModelError> {
    let (density, viscosity) = (file.real("opt.density")?, file.real("opt.viscosity")?);
    if is_off(file)? || (density <= 0.0 && viscosity <= 0.0) {
        return Ok(Vec::new());
    }
    let (density, viscosity) = (density.max(0.0), viscosity.max(0.0));
    let wind = file.vectors::<3>("opt.wind", 1)?[0];
    let masses = file.reals("body_mass", bodies)?;
    let centers = file.vectors::<3>("body_ipos", bodies)?;
    let turns = file.vectors::<4>("body_iquat", bodies)?;
    let moments = file.vectors::<3>("body_inertia", bodies)?;
    let heavy = (0..bodies).filter(|&body| masses[body] >= MASS_MIN);
    let drags = heavy.map(|body| {
        let whole: f64 = moments[body].iter().sum();
        // I = m (b² + c²) / 12 of each axis
        let square = |moment: f64| (whole - 2.0 * moment).max(MASS_MIN) / masses[body] * 6.0;
        let sides = moments[body].map(|moment| square(moment).sqrt());
        let mean = sides.iter().sum::<f64>() / 3.0;
        let others = |i: usize| [sides[(i + 1) % 3], sides[(i + 2) % 3]];
        let linear = |i: usize| 0.5 * density * others(i).iter().product::<f64>();
        let angular = |i: usize| {
            let fourth = others(i).iter().map(|side| side.powi(4)).sum::<f64>();
            density * sides[i] * fourth / 64.0
        };
        Drag {
            link: body,
            inertial: frame(centers[body], turns[body]),
            viscous: [3.0 * PI * mean * viscosity, PI * mean.powi(3) * viscosity],
            quadratic: [std::array::from_fn(linear), std::array::from_fn(angular)],
            wind,
        }
    });
    Ok(drags.collect())
}

/// What compensates gravity along each joint.
pub(super) fn compensators(
    file: &ModelFile,
    joints: usize,
) -> Result<Vec<Compensator>, ModelError> {
    let acts = file.rows("actuator_trntype") > 0 && !has_flag(file, "mjDSBL_ACTUATION")?;
    let of_actuators = file.integers("jnt_actgravcomp", joints)?;
    let kinds = of_actuators.into_iter().map(|flag| match (flag, acts) {
        (0, _) => Compensator::Passive,
        (_, true) => Compensator::Actuators,
        (_, false) => Compensator::Nothing,
    });
    Ok(kinds.collect())
}

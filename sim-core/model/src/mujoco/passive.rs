//! Passive forces of a model: compensation of gravity, and the medium.

use super::format::ModelFile;
use super::frame;
use super::options::has_flag;
use crate::description::{Compensator, Drag, EllipsoidInFluid};
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

/// Numbers in a row of `geom_fluid`: whether it acts; blunt, slender and angular drag; lift after Kutta and Magnus; added mass
/// (3); added moments (3).
const FLUID_COLUMNS: usize = 12;

/// What bodies move in.
struct Medium {
    /// [kg/m³]
    density: f64,
    /// [Pa·s]
    viscosity: f64,
    /// Its velocity [m/s].
    wind: [f64; 3],
    /// Of each body, whether it acts on its geoms as ellipsoids.
    are_ellipsoids: Vec<bool>,
    /// Masses of the bodies [kg].
    masses: Vec<f64>,
}

impl Medium {
    /// That of a model; none where it acts on nothing.
    fn read(file: &ModelFile, bodies: usize) -> Result<Option<Medium>, ModelError> {
        let (density, viscosity) = (file.real("opt.density")?, file.real("opt.viscosity")?);
        if is_off(file)? || (density <= 0.0 && viscosity <= 0.0) {
            return Ok(None);
        }
        Ok(Some(Medium {
            density,
            viscosity,
            wind: file.vectors::<3>("opt.wind", 1)?[0],
            are_ellipsoids: are_ellipsoids(file, bodies)?,
            masses: file.reals("body_mass", bodies)?,
        }))
    }
}

/// What the medium does to links as boxes, and to geoms as ellipsoids.
pub(super) fn in_medium(
    file: &ModelFile,
    bodies: usize,
) -> Result<(Vec<Drag>, Vec<EllipsoidInFluid>), ModelError> {
    match Medium::read(file, bodies)? {
        Some(medium) => Ok((
            drags(file, &medium, bodies)?,
            ellipsoids(file, &medium, bodies)?,
        )),
        None => Ok((Vec::new(), Vec::new())),
    }
}

/// Of each body, does the medium act on its geoms as ellipsoids? Where one does, MuJoCo leaves out the body's box.
fn are_ellipsoids(file: &ModelFile, bodies: usize) -> Result<Vec<bool>, ModelError> {
    let geoms = file.rows("geom_type");
    let rows = file.vectors::<FLUID_COLUMNS>("geom_fluid", geoms)?;
    let places = file.indices("geom_bodyid", geoms, bodies)?;
    let mut are = vec![false; bodies];
    for (row, body) in rows.iter().zip(places) {
        if let Some(body) = body.filter(|_| row[0] > 0.0) {
            are[body] = true;
        }
    }
    Ok(are)
}

/// What the medium does to geoms that count as ellipsoids.
fn ellipsoids(
    file: &ModelFile,
    medium: &Medium,
    bodies: usize,
) -> Result<Vec<EllipsoidInFluid>, ModelError> {
    let geoms = file.rows("geom_type");
    let kinds = file.kinds("geom_type", geoms)?;
    let links = file.indices("geom_bodyid", geoms, bodies)?;
    let centers = file.vectors::<3>("geom_pos", geoms)?;
    let turns = file.vectors::<4>("geom_quat", geoms)?;
    let sizes = file.vectors::<3>("geom_size", geoms)?;
    let rows = file.vectors::<FLUID_COLUMNS>("geom_fluid", geoms)?;
    let mut ellipsoids = Vec::new();
    for geom in 0..geoms {
        let row = rows[geom];
        let acts = |&body: &usize| medium.are_ellipsoids[body] && medium.masses[body] >= MASS_MIN;
        let Some(link) = links[geom].filter(acts).filter(|_| row[0] != 0.0) else {
            continue;
        };
        ellipsoids.push(EllipsoidInFluid {
            link,
            pose: frame(centers[geom], turns[geom]),
            semi_axes: semi_axes(&kinds[geom], sizes[geom]),
            interaction: row[0],
            blunt_drag: row[1],
            slender_drag: row[2],
            angular_drag: row[3],
            kutta_lift: row[4],
            magnus_lift: row[5],
            added_mass: [row[6], row[7], row[8]],
            added_moments: [row[9], row[10], row[11]],
            density: medium.density,
            viscosity: medium.viscosity,
            wind: medium.wind,
        });
    }
    Ok(ellipsoids)
}

/// Semi-axes of the ellipsoid that a geom counts as; of a mesh, half of the box about it [m].
fn semi_axes(kind: &str, [a, b, c]: [f64; 3]) -> [f64; 3] {
    match kind {
        "mjGEOM_SPHERE" => [a; 3],
        "mjGEOM_CAPSULE" => [a, a, a + b],
        "mjGEOM_CYLINDER" => [a, a, b],
        _ => [a, b, c],
    }
}

/// What the medium does to links that have no geoms that count as ellipsoids: each is the box that has its mass and inertia.
fn drags(file: &ModelFile, medium: &Medium, bodies: usize) -> Result<Vec<Drag>, ModelError> {
    let (density, viscosity) = (medium.density.max(0.0), medium.viscosity.max(0.0));
    let masses = &medium.masses;
    let centers = file.vectors::<3>("body_ipos", bodies)?;
    let turns = file.vectors::<4>("body_iquat", bodies)?;
    let moments = file.vectors::<3>("body_inertia", bodies)?;
    let boxes =
        (0..bodies).filter(|&body| masses[body] >= MASS_MIN && !medium.are_ellipsoids[body]);
    let drags = boxes.map(|body| {
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
            wind: medium.wind,
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

//! How far and on which path the solver goes.

use super::bodies::BodyBuilder;
use super::inverse_weight::{self, Reference};
use crate::description::{Description, Precompiled};
use sim_physics::constants::contact::Contacts;
use sim_physics::constants::options::{DryRow, Integrator, Newton, NoSlip, Search};
use sim_physics::constants::params::Param;
use sim_physics::constants::ties::{Measure, TieLaw};
use sim_physics::constants::{Body, Constants};

/// Past this `f32` accelerations are refined. Rounding moved them by at most 5e-5 of their largest in 1400 states of
/// random trees below it, by up to 6e-4 between it and 1000, and by 1e-3 at 4000.
const LOCKED_OVER_FREE_MAX: f64 = 100.0;

/// Bounds of the solver for bodies with these inertias at the reference pose.
pub(super) fn newton(
    scene: &Description,
    m: &Constants<f64>,
    builder: &BodyBuilder,
    reference: &Reference,
) -> Newton<f64> {
    let mut locked_over_free = reference.locked_over_free;
    if scene.params.contains(&Param::JointArmature) {
        // armatures hide what the links do to each other, and a world may have none
        let mut bare = m.clone();
        bare.dofs.iter_mut().for_each(|dof| dof.armature = 0.0);
        let bare = inverse_weight::at_reference(&bare, &builder.dof_names);
        let without = bare.map_or(f64::INFINITY, |bare| bare.locked_over_free);
        locked_over_free = locked_over_free.max(without);
    }
    Newton {
        // MuJoCo scales costs by 1 / (mean inertia × dofs)
        tolerance: scene.solver.tolerance * reference.mean_inertia * m.dofs.len() as f64,
        // a pass takes an error of 1e-3 to 1e-6, one of 1e-1 to 1e-2 or 1e-3
        refinements: [1.0, 100.0, 1000.0]
            .iter()
            .filter(|&times| locked_over_free > times * LOCKED_OVER_FREE_MAX)
            .count(),
        ..m.solver.clone()
    }
}

/// The solver's path in `f64` where models prescribe one: of several, what all of them allow.
pub(super) fn search(scene: &Description, bodies: &[Body<f64>]) -> Option<Search<f64>> {
    let models = || precompiled_parts(scene);
    models().next()?;
    Some(Search {
        tolerance: scene.solver.tolerance,
        ls_tolerance: models()
            .map(|parts| parts.ls_tolerance)
            .fold(f64::INFINITY, f64::min),
        islands: models().all(|parts| parts.islands),
        warm_start: models().all(|parts| parts.warm_start),
        roots: roots(bodies),
        classes: Vec::new(),
    })
}

/// Sweeps over the rows of friction, where a model asks for them: of several models, the most and the smallest tolerance.
pub(super) fn noslip(
    scene: &Description,
    m: &Constants<f64>,
    mean_inertia: f64,
) -> Option<NoSlip<f64>> {
    let asks = || precompiled_parts(scene).filter(|parts| parts.noslip.0 > 0);
    let iterations = asks().map(|parts| parts.noslip.0).max()?;
    let tolerance = asks()
        .map(|parts| parts.noslip.1)
        .fold(f64::INFINITY, f64::min);
    Some(NoSlip {
        iterations,
        tolerance,
        least_gain: tolerance * mean_inertia * m.dofs.len() as f64,
        dry_rows: dry_rows(m),
    })
}

/// Rows of dry friction in MuJoCo's order: those of dofs, then those of tendons.
fn dry_rows(m: &Constants<f64>) -> Vec<DryRow> {
    let mut of_dofs: Vec<(usize, DryRow)> = Vec::new();
    let mut of_tendons = Vec::new();
    for (place, friction) in m.frictions.iter().enumerate() {
        let row = m.equalities.len() + place;
        let dry = DryRow {
            row,
            tie: None,
            place,
        };
        of_dofs.push((friction.dof, dry));
    }
    let mut first = m.joint_rows();
    for (number, tie) in m.ties.iter().enumerate() {
        let rows = (0..tie.rows).map(|place| DryRow {
            row: first + place,
            tie: Some(number),
            place,
        });
        match (tie.law, &tie.measure) {
            // a free joint has a row for each of its dofs
            (TieLaw::Friction(_), Measure::Free(body)) => {
                of_dofs.extend((m.bodies[*body].dof..).zip(rows));
            }
            (TieLaw::Friction(_), _) => of_tendons.extend(rows),
            _ => {}
        }
        first += tie.rows;
    }
    of_dofs.sort_by_key(|&(dof, _)| dof);
    let of_dofs = of_dofs.into_iter().map(|(_, dry)| dry);
    of_dofs.chain(of_tendons).collect()
}

/// What robots that come compiled have.
pub(super) fn precompiled_parts(scene: &Description) -> impl Iterator<Item = &Precompiled> {
    let robots = scene.robots.iter();
    robots.filter_map(|robot| robot.precompiled.as_deref())
}

/// Of each dof, the first one of its kinematic tree.
fn roots(bodies: &[Body<f64>]) -> Vec<usize> {
    let mut of_dofs: Vec<usize> = Vec::new();
    let mut of_bodies: Vec<Option<usize>> = Vec::new();
    for body in bodies {
        let above = body.parent.and_then(|parent| of_bodies[parent]);
        let dofs = body.motion.dofs();
        let root = above.or((dofs > 0).then_some(body.dof));
        of_bodies.push(root);
        of_dofs.extend(std::iter::repeat_n(root.unwrap_or(body.dof), dofs));
    }
    of_dofs
}

/// Of each dof, the classes of contacts whose first dof is of the tree that begins there.
pub(super) fn classes_of_roots(roots: &[usize], contacts: &Contacts<f64>) -> Vec<Vec<usize>> {
    let mut classes = vec![Vec::new(); roots.len()];
    for (k, class) in contacts.classes.iter().enumerate() {
        if let Some(column) = class.columns.first() {
            classes[roots[column.dof]].push(k);
        }
    }
    classes
}

/// Whether a step of a scene with MuJoCo's options is implicit in any damping.
pub(super) fn is_damped(m: &Constants<f64>, implicit_damping: bool) -> bool {
    match m.integrator {
        Integrator::Euler => m.damped && implicit_damping,
        Integrator::RungeKutta => false,
        // forces of bodies on each other change with the velocity, whatever else does
        Integrator::Implicit => true,
        Integrator::ImplicitFast => {
            let tendons = &m.springs.tendons;
            m.damped
                || !m.free_joints.is_empty()
                || !m.drags.is_empty()
                || !m.fluid_geoms.is_empty()
                || !m.actuators.damped.is_empty()
                || tendons.iter().any(|tendon| {
                    // armature joins the free bodies that a spatial tendon pulls, whose bias is implicit
                    let is_heavy = tendon.armature != 0.0 && tendon.length.tendon.is_some();
                    tendon.damping != 0.0 || tendon.damping_curve != [0.0; 2] || is_heavy
                })
        }
    }
}

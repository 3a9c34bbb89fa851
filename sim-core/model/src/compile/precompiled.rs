//! Robots that come compiled: whether they fit together, and the inverse weights that they bring.

use super::inverse_weight::Reference;
use crate::description::{Description, Robot};
use crate::error::ModelError;
use crate::model::RobotRange;
use sim_physics::constants::params::Param;
use std::collections::BTreeSet;

/// Puts MuJoCo's inverse weights in the place of ours, for the robots that it compiled.
pub(super) fn take_inverse_weights(
    scene: &Description,
    ranges: &[RobotRange],
    reference: &mut Reference,
) {
    for (robot, range) in scene.robots.iter().zip(ranges) {
        let Some(parts) = &robot.precompiled else {
            continue;
        };
        let links = &mut reference.link_inverse_weight[range.bodies.clone()];
        links.copy_from_slice(&parts.link_inverse_weight);
        let dofs = &mut reference.dof_inverse_weight[range.dofs.clone()];
        dofs.copy_from_slice(&parts.dof_inverse_weight);
        if scene.robots.len() == 1 {
            reference.mean_inertia = parts.mean_inertia;
        }
    }
}

/// Names of the sites of MuJoCo models, in the order of their frames.
pub(super) fn output_site_names(scene: &Description) -> Vec<String> {
    let robots = scene.robots.iter();
    let sites = robots.flat_map(|robot| {
        let parts = robot.precompiled.iter();
        let names = parts.flat_map(|parts| &parts.frames.site_names);
        names.map(|name| format!("{}/{name}", robot.name))
    });
    sites.collect()
}

/// Refuses models from MuJoCo that do not fit together, or that a parameter would change in silence.
pub(super) fn check_models(scene: &Description) -> Result<(), ModelError> {
    let models = scene
        .robots
        .iter()
        .filter(|robot| robot.precompiled.is_some());
    let options = |robot: &Robot| {
        let parts = robot.precompiled.as_ref()?;
        Some((
            parts.integrator,
            parts.implicit_damping,
            parts.safe_references,
        ))
    };
    let models: Vec<&Robot> = models.collect();
    if let Some(two) = models
        .windows(2)
        .find(|two| options(two[0]) != options(two[1]))
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "models `{}` and `{}` have different integrators, eulerdamp or refsafe; make them equal",
                two[0].name, two[1].name
            ),
        });
    }
    let has_pairs = |robot: &&Robot| {
        let parts = robot.precompiled.as_ref();
        parts.is_some_and(|parts| !parts.pairs.is_empty())
    };
    if let Some(robot) = models.iter().copied().find(has_pairs)
        && scene.params.contains(&Param::ShapeMu)
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "shape_mu cannot vary: pairs of model `{}` have friction of their own; remove the pairs",
                robot.name
            ),
        });
    }
    let drags = |robot: &&Robot| {
        let parts = robot.precompiled.as_ref();
        parts.is_some_and(|parts| !parts.drags.is_empty())
    };
    let massive = [Param::BodyMass, Param::BodyInertia];
    if let Some(robot) = models.iter().copied().find(drags)
        && let Some(param) = massive.iter().find(|param| scene.params.contains(param))
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "{} cannot vary: density and viscosity act on boxes with the masses and inertias of model `{}`; \
                 vary body_mass_scale, or set both to 0",
                param.row().name,
                robot.name
            ),
        });
    }
    let geoms = models.iter().flat_map(|robot| &robot.links);
    let geoms = geoms.flat_map(|link| &link.collisions);
    let priorities: BTreeSet<i64> = geoms
        .filter_map(|collision| Some(collision.geom.as_ref()?.priority))
        .collect();
    if priorities.len() > 1 && scene.params.contains(&Param::ShapeMu) {
        return Err(ModelError::MujocoRefused {
            reasons: "shape_mu cannot vary: geoms have different priorities, which decide whose friction counts; \
                      make them equal"
                .to_owned(),
        });
    }
    Ok(())
}

//! Robots that come compiled: whether they fit together, and the inverse weights that they bring.

use super::inverse_weight::Reference;
use crate::description::{Description, Robot, Sense};
use crate::error::ModelError;
use crate::model::RobotRange;
use sim_physics::constants::params::Param;
use sim_physics::constants::sensors::FramePart;

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

/// Reasons against sensors in inertial frames of bodies, which do not follow a centre of mass that varies.
pub(super) fn sensors_of_centers(scene: &Description) -> Vec<String> {
    if !scene.params.contains(&Param::BodyCom) {
        return Vec::new();
    }
    let mut reasons = Vec::new();
    for robot in &scene.robots {
        let Some(parts) = &robot.precompiled else {
            continue;
        };
        for sensor in &parts.sensors.all {
            let moves = match &sensor.sense {
                // axes of inertia stay where they are
                Some(Sense::Frame { part, of, from, .. }) => {
                    let is_inertial = of.is_inertial || from.is_some_and(|from| from.is_inertial);
                    is_inertial && matches!(part, FramePart::Position | FramePart::Velocity)
                }
                Some(Sense::Aimed { part, of, from }) => {
                    let is_inertial =
                        of.on.is_inertial || from.is_some_and(|from| from.on.is_inertial);
                    is_inertial && matches!(part, FramePart::Position | FramePart::Velocity)
                }
                Some(Sense::Acceleration { of, is_angular, .. }) => of.is_inertial && !is_angular,
                Some(Sense::Inside(_, eye)) => eye.on.is_inertial,
                _ => false,
            };
            if moves {
                reasons.push(format!(
                    "model `{}`: sensor `{}`: no support for a body's centre of mass where body_com varies; \
                     use objtype xbody or a site",
                    robot.name, sensor.name
                ));
            }
        }
    }
    reasons
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

/// Names of the tendons of MuJoCo models, in the order of their lengths.
pub(super) fn output_tendon_names(scene: &Description) -> Vec<String> {
    let robots = scene.robots.iter();
    let tendons = robots.flat_map(|robot| {
        let parts = robot.precompiled.iter();
        let names = parts.flat_map(|parts| &parts.frames.tendon_names);
        names.map(|name| format!("{}/{name}", robot.name))
    });
    tendons.collect()
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
    let drags = |robot: &&Robot| {
        let parts = robot.precompiled.as_ref();
        parts.is_some_and(|parts| !parts.drags.is_empty())
    };
    let massive = [Param::BodyMass, Param::BodyInertia, Param::BodyCom];
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
    Ok(())
}

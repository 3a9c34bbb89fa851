//! What parameters start with, of links, dofs, shapes and pairs.

use super::constraint_rows::DofJoint;
use super::contacts::pieces::PlacedShape;
use super::inverse_weight::Reference;
use super::masses;
use crate::description::Description;
use crate::error::ModelError;
use crate::joint_kind::JointKind;
use sim_physics::constants::Constants;
use sim_physics::constants::params::{NO_LIMIT, SceneStarts};

/// The initial values that are not among the constants of a model.
pub(super) fn starts(
    scene: &Description,
    m: &Constants<f64>,
    joints: &[DofJoint],
    placed: &[PlacedShape<'_>],
    reference: &Reference,
) -> Result<SceneStarts, ModelError> {
    let range = |joint: &DofJoint| joint.range.unwrap_or([-NO_LIMIT, NO_LIMIT]);
    let softness = || placed.iter().map(PlacedShape::softness);
    let mut gravity_shares = vec![0.0; m.frames.len()];
    for held in &m.compensation.links {
        gravity_shares[held.link] = held.share;
    }
    let models = scene.robots.iter().flat_map(|robot| &robot.precompiled);
    let pairs = models.flat_map(|parts| &parts.pairs);
    Ok(SceneStarts {
        link_inverse_weights: reference.link_inverse_weight.clone(),
        dof_inverse_weights: reference.dof_inverse_weight.clone(),
        turning_mu: placed.iter().map(PlacedShape::turning_mu).collect(),
        mu: placed.iter().map(|shape| shape.surface.mu).collect(),
        contact_sensors: scene.sensed_shapes()?.len(),
        references: references(scene),
        ranges: joints.iter().map(range).collect(),
        gravity_shares,
        shape_solref: softness().map(|softness| softness.solref).collect(),
        shape_solimp: softness().map(|softness| softness.solimp).collect(),
        pair_frictions: pairs.map(|pair| pair.contact.friction).collect(),
        ..masses::starts(scene)
    })
}

/// Of each dof, the position at which its joint leaves its link in place; 0 of all but hinges and slides.
fn references(scene: &Description) -> Vec<f64> {
    let mut references = Vec::new();
    for robot in &scene.robots {
        for index in robot.moving_joints() {
            let joint = &robot.joints[index];
            let reference = match (&robot.precompiled, joint.kind) {
                (Some(parts), JointKind::Revolute | JointKind::Prismatic) => {
                    parts.joints[index].reference
                }
                _ => 0.0,
            };
            references.extend(joint.dofs.iter().map(|_| reference));
        }
    }
    references
}

//! Forces on links in joint space, Jᵀ f, body by body from the leaves.

use crate::arrays::Workspace;
use crate::constants::{Constants, Motion};
use crate::lane::Num;
use crate::math::spatial::Spatial;
use crate::math::vec3::Vec3;

/// Clears the forces on bodies, `force`.
#[inline(always)]
pub(in crate::step) fn clear<F: Num>(w: &mut Workspace<F>) {
    for force in &mut w.force {
        *force = Spatial::zero();
    }
}

/// Adds to a body a force at a point, and a torque; the point is relative to the robot's reference point.
#[inline(always)]
pub(in crate::step) fn add<F: Num>(
    w: &mut Workspace<F>,
    body: usize,
    point: Vec3<F>,
    force: Vec3<F>,
    torque: Vec3<F>,
) {
    // moved to the reference point: n + p × f
    let wrench = Spatial([force, point.cross_add(force, torque)]);
    w.force[body] = w.force[body] + wrench;
}

/// Writes to `joint_force` what the forces on bodies are in joint space.
#[inline(always)]
pub(in crate::step) fn project<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    // children follow their parents: backwards, a force includes that of the subtree when it is reached
    for (k, body) in m.bodies.iter().enumerate().rev() {
        let force = w.force[k];
        // S · f, and S = 1 of a free body
        for (axis, d) in body.dofs().enumerate() {
            w.joint_force[d] = match body.motion {
                Motion::Free => force.scalars()[axis],
                _ => w.motion[d].dot(force),
            };
        }
        // all forces are about the robot's reference point, so they add without moving
        if let Some(parent) = body.parent {
            w.force[parent] = w.force[parent] + force;
        }
    }
}

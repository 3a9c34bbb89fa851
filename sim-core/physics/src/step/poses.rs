//! Link frames in the world, for output.
//!
//! Orientations follow the chain of joints as quaternions, which never leave the unit sphere by
//! more than rounding and need no case distinction, as a conversion from matrices does.

use super::kinematics::read_quat;
use super::{BlockOf, ConstantsOf};
use crate::constants::Motion;
use crate::lane::{Cx, Num};
use crate::math::quat::{self, mul, turn_z};
use crate::math::vec3::{add, constant, transform_add};

#[inline(always)]
pub(super) fn body_q<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    for (k, body) in m.bodies.iter().enumerate() {
        let rest = quat::constant(body.quat);
        let carried = match body.parent {
            Some(parent) => mul(w.orientation[parent], rest),
            None => rest,
        };
        w.orientation[k] = match body.motion {
            Motion::Revolute => {
                let half = cx.get(&b.joint_q[body.coord]) * C::F::c(0.5);
                let (sin, cos) = half.sincos();
                turn_z(carried, sin, cos)
            }
            Motion::Prismatic => carried,
            Motion::Ball => mul(carried, read_quat(cx, &b.joint_q, body.coord)),
            Motion::Free => read_quat(cx, &b.joint_q, body.coord + 3),
        };
    }
    for (k, frame) in m.frames.iter().enumerate() {
        let (position, orientation) = match frame.body {
            Some(body) => (
                transform_add(&w.rotation[body], constant(frame.position), w.origin[body]),
                mul(w.orientation[body], quat::constant(frame.quat)),
            ),
            None => (constant(frame.position), quat::constant(frame.quat)),
        };
        let [px, py, pz] = add(position, w.reference[frame.tree]);
        let [qx, qy, qz, qw] = orientation;
        w.body_q[k] = [px, py, pz, qx, qy, qz, qw];
    }
}

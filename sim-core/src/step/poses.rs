//! Link frames in the world, for output.
//!
//! Orientations follow the chain of joints as quaternions, which never leave the unit sphere by
//! more than rounding and need no case distinction, as a conversion from matrices does.

use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num};
use crate::math::quat::{self, mul, turn_z};
use crate::math::vec3::{add, constant, transform_add};

#[inline(always)]
pub(super) fn body_q<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    for (j, dof) in m.dofs.iter().enumerate() {
        let turn = quat::constant(dof.quat);
        let carried = match dof.parent {
            Some(parent) => mul(w.orientation[parent], turn),
            None => turn,
        };
        w.orientation[j] = if dof.revolute {
            let (sin, cos) = (cx.get(&b.joint_q[j]) * C::F::c(0.5)).sincos();
            turn_z(carried, sin, cos)
        } else {
            carried
        };
    }
    for (body, frame) in m.frames.iter().enumerate() {
        let (position, orientation) = match frame.dof {
            Some(dof) => (
                transform_add(&w.rotation[dof], constant(frame.position), w.origin[dof]),
                mul(w.orientation[dof], quat::constant(frame.quat)),
            ),
            None => (constant(frame.position), quat::constant(frame.quat)),
        };
        let [px, py, pz] = add(position, constant(frame.base));
        let [qx, qy, qz, qw] = orientation;
        w.body_q[body] = [px, py, pz, qx, qy, qz, qw];
    }
}

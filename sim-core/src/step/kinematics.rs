//! Forward kinematics (Featherstone 2008, section 4.1): frames, motion axes and inertias of all dofs.
//!
//! ```text
//! R(j) = R(parent) E(j) Rz(q)        p(j) = p(parent) + R(parent) r(j)        for a joint that turns
//! R(j) = R(parent) E(j)              p(j) = … + z q                           for one that slides
//! S(j) = (p × z, z)  or  (z, 0)      linear, angular, at the robot's base
//! ```

use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num};
use crate::math::spatial::place;
use crate::math::vec3::{constant, cross, scale, scale_add, sub, transform, transform_add, zero};

#[inline(always)]
pub(super) fn kinematics<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    // parents precede children (model/compile.rs sorts them), so one forward pass suffices
    for (j, dof) in m.dofs.iter().enumerate() {
        let q = cx.get(&b.joint_q[j]);
        let [ex, ey, ez] = [
            constant(dof.rotation[0]),
            constant(dof.rotation[1]),
            constant(dof.rotation[2]),
        ];
        let (x, y, z, mut origin) = match dof.parent {
            Some(parent) => {
                let r = &w.rotation[parent];
                let origin = transform_add(r, constant(dof.position), w.origin[parent]);
                (transform(r, ex), transform(r, ey), transform(r, ez), origin)
            }
            None => (ex, ey, ez, constant(dof.position)),
        };
        let (rotation, motion);
        if dof.revolute {
            let (sin, cos) = q.sincos();
            rotation = [
                scale_add(y, sin, scale(x, cos)),
                sub(scale(y, cos), scale(x, sin)),
                z,
            ];
            motion = [cross(origin, z), z];
        } else {
            origin = scale_add(z, q, origin);
            rotation = [x, y, z];
            motion = [z, zero()];
        }
        w.inertia[j] = place::<C::F>(dof.mass, dof.center, dof.inertia, &rotation, origin);
        w.rotation[j] = rotation;
        w.origin[j] = origin;
        w.motion[j] = motion;
    }
}

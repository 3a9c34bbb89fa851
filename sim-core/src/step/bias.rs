//! Bias forces by the recursive Newton-Euler algorithm (Featherstone 2008, section 5.3) at zero joint acceleration.
//!
//! ```text
//! v(j) = v(parent) + S q̇             a(j) = a(parent) + v(parent) × S q̇,   a(base) = -g
//! f(j) = I a + v ×* I v + Σ f(child)  c(j) = S · f(j)
//! ```

use super::{BlockOf, ConstantsOf};
use crate::lane::Cx;
use crate::math::spatial::{
    ANGULAR, LINEAR, Spatial, cross_force_add, cross_motion, momentum, power, scale_sum, sum,
};
use crate::math::vec3::{constant, scale, zero};

#[inline(always)]
pub(super) fn bias_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let gravity = constant::<C::F>(m.gravity);
    let base: Spatial<C::F> = [[-gravity[0], -gravity[1], -gravity[2]], zero()];
    // `force` holds the acceleration of a body until the backward pass
    for (j, dof) in m.dofs.iter().enumerate() {
        let qd = cx.get(&b.joint_qd[j]);
        let s = w.motion[j];
        let (velocity, acceleration) = match dof.parent {
            Some(parent) => {
                let v = w.velocity[parent];
                let a = scale_sum(cross_motion(&v, &s), qd, w.force[parent]);
                (scale_sum(s, qd, v), a)
            }
            None => ([scale(s[LINEAR], qd), scale(s[ANGULAR], qd)], base),
        };
        w.velocity[j] = velocity;
        w.force[j] = acceleration;
    }
    for j in 0..m.dofs.len() {
        let v = w.velocity[j];
        let inertial = momentum(&w.inertia[j], &w.force[j]);
        w.force[j] = cross_force_add(&v, &momentum(&w.inertia[j], &v), inertial);
    }
    for (j, dof) in m.dofs.iter().enumerate().rev() {
        let force = w.force[j];
        w.bias_force[j] = power(&w.motion[j], &force);
        if let Some(parent) = dof.parent {
            w.force[parent] = sum(w.force[parent], force);
        }
    }
}

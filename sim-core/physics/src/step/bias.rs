//! Bias forces by the recursive Newton-Euler algorithm (Featherstone 2008, section 5.3) at zero joint acceleration.
//!
//! ```text
//! v(b) = v(parent) + Σ S q̇            a(b) = a(parent) + v(parent) × Σ S q̇,   a(base) = -g
//! f(b) = I a + v ×* I v + Σ f(child)   c(dof) = S · f(b)
//! ```
//!
//! A free body has S = 1. Its axes stand still, but those of its rotation follow its centre of mass: a = v × ω.

use super::{BlockOf, ConstantsOf, gravity};
use crate::constants::Motion;
use crate::lane::Cx;
use crate::math::spatial::{
    ANGULAR, LINEAR, Spatial, cross_force_add, cross_motion, momentum, power, scale_sum, sum,
};
use crate::math::vec3::{cross_add, scale, zero};

#[inline(always)]
pub(super) fn bias_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let gravity = gravity(m, &b.params);
    let w = &mut b.work;
    let base: Spatial<C::F> = [[-gravity[0], -gravity[1], -gravity[2]], zero()];
    // `force` holds the acceleration of a body until the backward pass
    for (k, body) in m.bodies.iter().enumerate() {
        let s = w.motion[body.dof];
        let qd = cx.get(&b.joint_qd[body.dof]);
        let mut own: Spatial<C::F> = [scale(s[LINEAR], qd), scale(s[ANGULAR], qd)];
        if body.motion == Motion::Free {
            for (x, d) in own.as_flattened_mut().iter_mut().zip(body.dofs()) {
                *x = cx.get(&b.joint_qd[d]);
            }
        } else {
            for d in body.dof + 1..body.dof + body.motion.dofs() {
                own = scale_sum(w.motion[d], cx.get(&b.joint_qd[d]), own);
            }
        }
        let (velocity, acceleration) = match (body.parent, body.motion) {
            (_, Motion::Free) => {
                let swing = cross_add(own[LINEAR], own[ANGULAR], base[LINEAR]);
                (own, [swing, base[ANGULAR]])
            }
            (Some(parent), _) => {
                let v = w.velocity[parent];
                (sum(v, own), sum(w.force[parent], cross_motion(&v, &own)))
            }
            (None, _) => (own, base),
        };
        w.velocity[k] = velocity;
        w.force[k] = acceleration;
    }
    for k in 0..m.bodies.len() {
        let v = w.velocity[k];
        let inertial = momentum(&w.inertia[k], &w.force[k]);
        w.force[k] = cross_force_add(&v, &momentum(&w.inertia[k], &v), inertial);
    }
    for (k, body) in m.bodies.iter().enumerate().rev() {
        let force = w.force[k];
        if body.motion == Motion::Free {
            w.bias_force[body.dofs()].copy_from_slice(force.as_flattened());
            continue;
        }
        for d in body.dofs() {
            w.bias_force[d] = power(&w.motion[d], &force);
        }
        if let Some(parent) = body.parent {
            w.force[parent] = sum(w.force[parent], force);
        }
    }
}

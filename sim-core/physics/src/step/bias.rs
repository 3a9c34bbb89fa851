//! Bias forces by the recursive Newton-Euler algorithm (Featherstone 2008, section 5.3) at zero joint acceleration.
//!
//! ```text
//! v(b) = v(parent) + Σ S q̇            a(b) = a(parent) + v(parent) × Σ S q̇,   a(base) = -g
//! f(b) = I a + v ×* I v + Σ f(child)   c(dof) = S · f(b)
//! ```
//!
//! A free body has S = 1. The axes of its linear velocity are fixed, those of its rotation move with its centre of mass:
//! a = v × ω.

use super::{BlockOf, ConstantsOf, Stage, gravity};
use crate::arrays::Array as A;
use crate::constants::{Body, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::Vec3;

/// Coriolis, centrifugal and gravity forces.
pub struct Bias;

impl Stage for Bias {
    const READS: &'static [A] = &[A::JointQd, A::Motion, A::Inertia, A::Params];
    const WRITES: &'static [A] = &[A::BiasForce, A::Velocity];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // `force` holds the acceleration of a body until the backward pass
        accelerations_at_rest(cx, m, b, -gravity(m, &b.params));
        let w = &mut b.work;
        for k in 0..m.bodies.len() {
            let v = w.velocity[k];
            let inertial = w.inertia[k] * w.force[k];
            w.force[k] = v.cross_force_add(w.inertia[k] * v, inertial);
        }
        // children follow their parents, so in the backward pass the force of a body is complete when it is reached
        for (k, body) in m.bodies.iter().enumerate().rev() {
            let force = w.force[k];
            if body.motion == Motion::Free {
                w.bias_force[body.dofs()].copy_from_slice(&force.scalars());
                continue;
            }
            for d in body.dofs() {
                w.bias_force[d] = w.motion[d].dot(force);
            }
            if let Some(parent) = body.parent {
                w.force[parent] = w.force[parent] + force;
            }
        }
    }
}

/// Writes the velocity of each body, and to `force` its acceleration at zero joint acceleration over a base that has `base`.
#[inline(always)]
pub(super) fn accelerations_at_rest<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    base: Vec3<C::F>,
) {
    let base = Spatial([base, Vec3::zero()]);
    for (k, body) in m.bodies.iter().enumerate() {
        let own = joint_velocity(cx, b, body);
        let w = &mut b.work;
        let (velocity, acceleration) = match (body.parent, body.motion) {
            (_, Motion::Mocap) => (own, base),
            (_, Motion::Free) => {
                let swing = own[LINEAR].cross_add(own[ANGULAR], base[LINEAR]);
                (own, Spatial([swing, base[ANGULAR]]))
            }
            (Some(parent), _) => {
                let v = w.velocity[parent];
                (v + own, w.force[parent] + v.cross_motion(own))
            }
            (None, _) => (own, base),
        };
        w.velocity[k] = velocity;
        w.force[k] = acceleration;
    }
}

/// Σ S q̇: what a body's own joint adds to the velocity of its parent.
#[inline(always)]
fn joint_velocity<C: Cx>(
    cx: &mut C,
    b: &BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
) -> Spatial<C::F> {
    let qd = &b.joint_qd[body.dofs()];
    if body.motion == Motion::Free {
        let (mut linear, mut angular) = (Vec3::zero(), Vec3::zero());
        for i in 0..3 {
            linear[i] = cx.get(&qd[i]);
            angular[i] = cx.get(&qd[3 + i]);
        }
        return Spatial([linear, angular]);
    }
    if body.motion == Motion::Mocap {
        return Spatial::zero();
    }
    let motion = &b.work.motion[body.dofs()];
    let mut own = motion[0] * cx.get(&qd[0]);
    for d in 1..body.motion.dofs() {
        own = motion[d].scale_add(cx.get(&qd[d]), own);
    }
    own
}

//! Bias forces by the recursive Newton-Euler algorithm (Featherstone 2008, section 5.3) at zero joint acceleration.
//!
//! ```text
//! ω(b) = ω(parent) + z q̇      α(b) = α(parent) + ω(parent) × z q̇                        revolute
//! a(b) = a(parent) + α × r + ω × (ω × r)   … + 2 ω × z q̇   a(base) = -g                 prismatic
//! f(b) = m a + α × h + ω × (ω × h) + Σ f(child)             h = m c
//! n(b) = I α + ω × I ω + h × a + Σ (n(child) + r × f(child))
//! c(dof) = z · n  or  z · f
//! ```
//!
//! Each body's equations are about its own point (see [`super::kinematics`]), so rounding is relative to the load of a joint,
//! not to its distance from the robot's reference point. A free body has S = 1, and its centre of mass the acceleration of
//! the base.

use super::inverse_dynamics::point_acceleration;
use crate::arrays::Array as A;
use crate::constants::{Body, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage, gravity};

/// Coriolis, centrifugal and gravity forces.
pub struct Bias;

impl Stage for Bias {
    const READS: &'static [A] = &[A::JointQd, A::Arm, A::Motion, A::Inertia, A::Params];
    const WRITES: &'static [A] = &[A::BiasForce, A::Velocity];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // gravity as an acceleration of the base by -g, which gives every body its weight
        let base = -gravity(m, &b.params);
        // forces at once, so that few accelerations are kept at a time
        for k in 0..m.bodies.len() {
            accelerate(cx, m, b, k, base);
            let w = &mut b.work;
            w.force[k] = w.inertia[k].force(w.velocity[k][ANGULAR], w.rest_acceleration[k]);
        }
        let w = &mut b.work;
        // children follow their parents, so in the backward pass the force of a body is complete when it is reached
        for (k, body) in m.bodies.iter().enumerate().rev() {
            let force = w.force[k];
            if body.motion == Motion::Free {
                // S = 1: the force itself, which no carrier bears
                w.bias_force[body.dofs()].copy_from_slice(&force.scalars());
                continue;
            }
            // c(dof) = S · f
            for d in body.dofs() {
                w.bias_force[d] = along(body.motion, &w.motion[d], force);
            }
            // f(parent) += f, n(parent) += n + r × f
            if let Some(parent) = body.parent {
                w.force[parent] = w.force[parent] + force.moved(w.arm[k]);
            }
        }
    }
}

/// What a force about a body's point does along an axis of its joint, S · f.
#[inline(always)]
pub(in crate::step) fn along<F: Num>(motion: Motion, axis: &Spatial<F>, force: Spatial<F>) -> F {
    match motion {
        Motion::Prismatic => axis[LINEAR].dot(force[LINEAR]),
        _ => axis[ANGULAR].dot(force[ANGULAR]),
    }
}

/// Writes the velocity of each body, the acceleration of its point and its angular one, at zero joint acceleration over a base
/// that has `base`.
#[inline(always)]
pub(in crate::step) fn accelerations_at_rest<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    base: Vec3<C::F>,
) {
    for k in 0..m.bodies.len() {
        accelerate(cx, m, b, k, base);
    }
}

/// [`accelerations_at_rest`] of body `k`, whose parent has its own.
#[inline(always)]
fn accelerate<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    k: usize,
    base: Vec3<C::F>,
) {
    let body = &m.bodies[k];
    // v(b) = v(parent) + S q̇, and the acceleration at q̈ = 0. A root's point has that of the base
    let relative = joint_velocity(cx, b, body);
    let w = &mut b.work;
    let (velocity, acceleration) = match body.parent {
        Some(parent) => {
            let v = w.velocity[parent];
            let carried = carried(
                body.motion,
                w.rest_acceleration[parent],
                v,
                relative,
                w.arm[k],
            );
            (v + relative, carried)
        }
        None => (relative, Spatial([base, Vec3::zero()])),
    };
    w.velocity[k] = velocity;
    w.rest_acceleration[k] = acceleration;
}

/// Acceleration of a body at `arm` from the point of its carrier, whose acceleration and velocity are given. The joint
/// adds the velocity `relative`.
#[inline(always)]
fn carried<F: Num>(
    motion: Motion,
    carrier: Spatial<F>,
    velocity: Spatial<F>,
    relative: Spatial<F>,
    arm: Vec3<F>,
) -> Spatial<F> {
    // a + α × r + ω × (ω × r), with ω and α of the carrier
    let omega = velocity[ANGULAR];
    let point = point_acceleration(carrier, omega, arm);
    match motion {
        // Coriolis: 2 ω × z q̇ of a point that slides
        Motion::Prismatic => {
            let twice = relative[LINEAR] * F::c(2.0);
            Spatial([omega.cross_add(twice, point), carrier[ANGULAR]])
        }
        // α + ω × S q̇: the carrier rotates the joint's axis
        _ => Spatial([point, omega.cross_add(relative[ANGULAR], carrier[ANGULAR])]),
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
    // S = 1: velocity of the centre of mass, and the angular one, in world axes
    if body.motion == Motion::Free {
        let (mut linear, mut angular) = (Vec3::zero(), Vec3::zero());
        for i in 0..3 {
            linear[i] = cx.get(&qd[i]);
            angular[i] = cx.get(&qd[3 + i]);
        }
        return Spatial([linear, angular]);
    }
    // without dofs it has no velocity, as in MuJoCo
    if body.motion == Motion::Mocap {
        return Spatial::zero();
    }
    // one axis, or the three of a ball in the order of its dofs
    let motion = &b.work.motion[body.dofs()];
    let mut velocity = motion[0] * cx.get(&qd[0]);
    for d in 1..body.motion.dofs() {
        velocity = motion[d].scale_add(cx.get(&qd[d]), velocity);
    }
    velocity
}

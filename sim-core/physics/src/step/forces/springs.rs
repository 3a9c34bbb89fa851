//! Springs of joints, springs and dampers of tendons, and dampers of free joints (MuJoCo: `mj_passive`).
//!
//! ```text
//! smooth -= stiffness (q - rest)                       of a joint
//! smooth -= stiffness log(rest⁻¹ q)                    of a ball, and of the rotation of a free joint
//! smooth -= ∂l (stiffness (l - rest) + damping v)      of a tendon of length l; no spring force between its rests
//! passive = the same - damping q̇                       for output
//! ```
//!
//! Stiffness and damping may be polynomials ([`super::curves`]). Where a spring yields, its rest is state ([`super::plasticity`]). A free joint's spring acts at the origin of its frame ([`crate::step::tree::free_joints`]).

use super::{curves, fluid, gravity_compensation, plasticity};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::Motion;
use crate::constants::params::Param;
use crate::constants::springs::{PoseSpring, Spring, Tendon};
use crate::lane::{Cx, Num, Real};
use crate::math::quat::{self, conjugate, mul};
use crate::math::vec3::Vec3;
use crate::step::lengths::{length, moments, rate};
use crate::step::tree::free_joints;
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage, param};

/// Forces of springs and dampers.
pub struct Springs;

impl Stage for Springs {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Params,
        A::Rotation,
        A::Origin,
        A::TenLength,
        A::TenVelocity,
        A::TenMoment,
        A::PlasticRest,
        A::SmoothForce,
    ];
    const WRITES: &'static [A] = &[A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        let are_there = [
            !m.springs.joints.is_empty(),
            !m.springs.tendons.is_empty(),
            !m.springs.poses.is_empty(),
            !m.free_joints.is_empty(),
        ];
        are_there.contains(&true)
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // out of the block while that is read
        let mut smooth = std::mem::take(&mut b.work.smooth_force);
        add_springs(cx, m, b, &mut smooth);
        // free joints: -Tᵀ (D T v + A c)
        free_joints::add_damping_forces(cx, m, b, &mut smooth);
        free_joints::add_swing_forces(cx, m, b, 1.0, &mut smooth);
        b.work.smooth_force = smooth;
    }
}

/// Passive forces alone, for output: of springs and dampers, of a medium, and those that hold bodies against gravity.
pub struct Passive;

impl Stage for Passive {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Params,
        A::Rotation,
        A::Origin,
        A::Motion,
        A::Velocity,
        A::TenLength,
        A::TenVelocity,
        A::TenMoment,
        A::PlasticRest,
    ];
    const WRITES: &'static [A] = &[A::PassiveForce];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let mut passive = std::mem::take(&mut b.work.passive_force);
        passive.fill(C::F::c(0.0));
        // -damping q̇ of joints, which `actuation` adds in a step
        for &j in &m.diagonal_dofs {
            let qd = cx.get(&b.joint_qd[j]);
            passive[j] = -(qd * joint_damping(m, &b.params, j, qd));
        }
        add_springs(cx, m, b, &mut passive);
        // without Tᵀ A c: armature is no passive force
        free_joints::add_damping_forces(cx, m, b, &mut passive);
        // gravity compensation of joints where it does not count as an actuator
        if !m.compensation.links.is_empty() {
            gravity_compensation::forces::<C>(m, b);
            for &d in &m.compensation.passive_dofs {
                passive[d] = passive[d] + b.work.joint_force[d];
            }
        }
        if fluid::is_there(m) {
            fluid::forces(m, &mut b.work);
            for (force, drag) in passive.iter_mut().zip(&b.work.joint_force) {
                *force = *force + *drag;
            }
        }
        b.work.passive_force = passive;
    }
}

/// Damping of a dof at a velocity: d + a |q̇| + b q̇², with the d of the world.
#[inline(always)]
pub(in crate::step) fn joint_damping<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    j: usize,
    qd: F,
) -> F {
    let dof = &m.dofs[j];
    let damping = param(m, params, Param::JointDamping, j, dof.damping);
    curves::curved(damping, dof.damping_curve, qd.abs())
}

/// Adds the forces of springs, and of springs and dampers of tendons.
#[inline(always)]
fn add_springs<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    // -stiffness (q - rest)
    for spring in &m.springs.joints {
        let stretch = joint_stretch(cx, m, b, spring);
        let stiffness = curves::curved(C::F::k(spring.stiffness), spring.curve, stretch);
        let force = &mut to[spring.dof];
        *force = stretch.fnma(stiffness, *force);
    }
    // stretch, and the rate v of the length
    for tendon in &m.springs.tendons {
        let stretch = stretch(cx, m, b, tendon);
        let velocity = rate(cx, b, &tendon.length);
        // stiffness stretch + damping v, on each joint times its moment
        let damping = C::F::k(tendon.damping);
        let damping = curves::curved(damping, tendon.damping_curve, velocity.abs());
        let stiffness = C::F::k(tendon.stiffness);
        let stiffness = curves::curved(stiffness, tendon.stiffness_curve, stretch);
        let pull = stretch.fma(stiffness, velocity * damping);
        moments::<C>(m, &b.work.ten_moment, &tendon.length, |dof, moment| {
            to[dof] = pull.fnma(moment, to[dof]);
        });
    }
    // stiffness times the slide and the rotation vector from rest
    for spring in &m.springs.poses {
        let body = &m.bodies[spring.body];
        let [mut slide, mut turn] = pose_stretch(cx, m, b, spring);
        slide = slide * pose_stiffness(spring, slide);
        turn = turn * pose_stiffness(spring, turn);
        let (rotation, origin) = (b.work.rotation[spring.body], b.work.origin[spring.body]);
        let force = &mut to[body.dofs()];
        // at the frame's origin, the torque in the body's axes
        if body.motion == Motion::Free {
            free_joints::subtract(force, [slide, turn], rotation, origin);
            continue;
        }
        // a ball's dofs and its rotation vector are both in the body's axes
        for i in 0..3 {
            force[i] = force[i] - turn[i];
        }
    }
}

/// How far a joint with one coordinate is from its rest.
#[inline(always)]
pub(in crate::step) fn joint_stretch<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    spring: &Spring<<C::F as Num>::Real>,
) -> C::F {
    let [rest] = plasticity::rest(cx, b, [spring.rest], &spring.plasticity);
    cx.get(&b.joint_q[m.dofs[spring.dof].coord]) - rest
}

/// How far a ball or a free joint is from its rest: its position, 0 of a ball, and a rotation vector in the body's axes.
#[inline(always)]
pub(in crate::step) fn pose_stretch<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    spring: &PoseSpring<<C::F as Num>::Real>,
) -> [Vec3<C::F>; 2] {
    let body = &m.bodies[spring.body];
    let mut slide = Vec3::zero();
    let mut first = body.coord;
    // where a free joint's frame is from its rest, in world axes
    if body.motion == Motion::Free {
        for i in 0..3 {
            slide[i] = cx.get(&b.joint_q[first + i]) - C::F::k(spring.position[i]);
        }
        first += 3;
    }
    // log(rest⁻¹ q)
    let here = read_quat(cx, &b.joint_q, first);
    let rest = plasticity::rest(cx, b, spring.quat, &spring.plasticity);
    [slide, quat::log(mul(conjugate(rest), here))]
}

/// k + a |x| + b |x|² of a spring of a ball or a free joint.
#[inline(always)]
fn pose_stiffness<F: Num>(spring: &PoseSpring<F::Real>, x: Vec3<F>) -> F {
    let stiffness = F::k(spring.stiffness);
    // without a and b the length is not needed
    if !curves::bends(spring.curve) {
        return stiffness;
    }
    curves::curved(stiffness, spring.curve, x.dot(x).sqrt())
}

/// How far a tendon is beyond its rests.
#[inline(always)]
pub(in crate::step) fn stretch<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    tendon: &Tendon<<C::F as Num>::Real>,
) -> C::F {
    let length = length(cx, m, b, &tendon.length);
    // 0 between the rests
    let [shortest, longest] = plasticity::rest(cx, b, tendon.rest, &tendon.plasticity);
    length - length.max(shortest).min(longest)
}

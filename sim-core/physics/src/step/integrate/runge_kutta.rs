//! The Runge-Kutta step of fourth order (MuJoCo: `mj_RungeKutta`).
//!
//! ```text
//! x₁ = x            xₖ₊₁ = x ⊕ h aₖ (vₖ, v̇ₖ)        a = ½, ½, 1
//! x' = x ⊕ h Σ bₖ (vₖ, v̇ₖ)                           b = ⅙, ⅓, ⅓, ⅙
//! ```
//!
//! Velocities v are MuJoCo's ([`crate::step::tree::generalized`]). ⊕ rotates a quaternion by h v in the
//! body's axes. All stages of a step run before each of the four, at xₖ. The solver starts each of the four from the
//! accelerations of the last step.

use super::semi_implicit::{activations, add_compensated, write_quat};
use crate::arrays::Array as A;
use crate::constants::options::Integrator;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num, Real};
use crate::math::quat;
use crate::math::vec3::Vec3;
use crate::step::forces::actuators::next;
use crate::step::forces::delays::{self, Moment};
use crate::step::forces::plasticity;
use crate::step::tree::generalized::{accelerations, free_bodies, halves, velocities};
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Weights of the four velocities in the next state.
const SHARES: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
/// How far each velocity leads to the next point, as a share of the step.
const REACHES: [f64; 3] = [0.5, 0.5, 1.0];

/// Number `K` of the four evaluations, from 0: goes to the next point, or to the next state.
pub struct RungeKutta<const K: usize>;

/// Keeps the accelerations that the solver starts from, before the first evaluation.
pub struct Begin;

impl Stage for Begin {
    const READS: &'static [A] = &[A::JointQdd];
    const WRITES: &'static [A] = &[A::RkWarmStart];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.integrator == Integrator::RungeKutta
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for j in 0..m.dofs.len() {
            b.work.rk_warm_start[j] = cx.get(&b.joint_qdd[j]);
        }
    }
}

/// What the first evaluation reads.
const READS: &[A] = &[
    A::JointQ,
    A::JointQRest,
    A::JointQd,
    A::JointQdd,
    A::Rotation,
    A::Origin,
    A::Ctrl,
    A::ControlHistory,
    A::DelayedControl,
    A::Act,
    A::ActDot,
    A::PlasticRest,
    A::TenLength,
    A::TenMoment,
    A::RkWarmStart,
];
/// What those after it read.
const READS_LATER: &[A] = &[
    A::JointQ,
    A::JointQRest,
    A::JointQd,
    A::JointQdd,
    A::Rotation,
    A::Origin,
    A::RkQ,
    A::RkQRest,
    A::RkVelocity,
    A::RkVelocitySum,
    A::RkAccelerationSum,
    A::Ctrl,
    A::ControlHistory,
    A::DelayedControl,
    A::Act,
    A::ActDot,
    A::RkAct,
    A::RkActRateSum,
    A::PlasticRest,
    A::RkLength,
    A::RkMoment,
    A::RkWarmStart,
];

impl<const K: usize> Stage for RungeKutta<K> {
    const READS: &'static [A] = if K == 0 { READS } else { READS_LATER };
    const WRITES: &'static [A] = &[
        A::JointQ,
        A::JointQRest,
        A::JointQd,
        A::JointQdd,
        A::RkQ,
        A::RkQRest,
        A::RkVelocity,
        A::RkVelocitySum,
        A::RkAccelerationSum,
        A::Act,
        A::RkAct,
        A::RkActRateSum,
        A::ControlHistory,
        A::DelayedControl,
        A::PlasticRest,
        A::RkLength,
        A::RkMoment,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.integrator == Integrator::RungeKutta
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // scratch with an entry per dof, out of the block while that is read
        let mut velocity = std::mem::take(&mut b.work.start);
        let mut acceleration = std::mem::take(&mut b.work.step);
        // vₖ and v̇ₖ as MuJoCo has them
        velocities(cx, m, b, &mut velocity);
        accelerations(cx, m, b, &mut acceleration);
        let w = &mut b.work;
        // x, from which every point and the next state are reached
        if K == 0 {
            for c in 0..m.coords {
                w.rk_q[c] = cx.get(&b.joint_q[c]);
                w.rk_q_rest[c] = cx.get(&b.joint_q_rest[c]);
            }
            w.rk_velocity.copy_from_slice(&velocity);
            if m.springs.yields_along_tendons() {
                w.rk_length.copy_from_slice(&w.ten_length);
                w.rk_moment.copy_from_slice(&w.ten_moment);
            }
        }
        // the solver of each evaluation starts from the last step's accelerations
        if K < 3 {
            for j in 0..m.dofs.len() {
                cx.set(&mut b.joint_qdd[j], w.rk_warm_start[j]);
            }
        } else if m.prescribed_search().is_some() {
            // the next step starts from these, which a prescribed search keeps as MuJoCo has them
            for (_, dof) in free_bodies(m) {
                for j in dof..dof + 6 {
                    cx.set(&mut b.joint_qdd[j], acceleration[j]);
                }
            }
        }
        // Σ bₖ vₖ and Σ bₖ v̇ₖ, in the order of k
        let share = C::F::c(SHARES[K]);
        for j in 0..m.dofs.len() {
            let zero = C::F::c(0.0);
            let (v, a) = match K {
                0 => (zero, zero),
                _ => (w.rk_velocity_sum[j], w.rk_acceleration_sum[j]),
            };
            w.rk_velocity_sum[j] = velocity[j].fma(share, v);
            w.rk_acceleration_sum[j] = acceleration[j].fma(share, a);
            // the next state is reached by the sums
            if K == 3 {
                (velocity[j], acceleration[j]) = (w.rk_velocity_sum[j], w.rk_acceleration_sum[j]);
            }
        }
        go_on_acting::<C, K>(cx, m, b);
        // controls of the next evaluation; those of this step count from the next one on
        match K {
            0 => delays::read(cx, m, b, Moment::Middle),
            2 => delays::read(cx, m, b, Moment::End),
            3 => delays::append(cx, m, b),
            _ => {}
        }
        // h aₖ, and h to the next state
        let reach = C::F::c(m.dt.to_f64() * REACHES.get(K).copied().unwrap_or(1.0));
        // positions first: free velocities below need the new rotations
        for body in &m.bodies {
            go(cx, b, body, &velocity, reach, K == 3);
        }
        // velocities from where they were in x, as MuJoCo has them
        for j in 0..m.dofs.len() {
            let next = acceleration[j].fma(reach, b.work.rk_velocity[j]);
            cx.set(&mut b.joint_qd[j], next);
            acceleration[j] = next;
        }
        // back to ours: of a free body's centre of mass, in world axes
        for (k, dof) in free_bodies(m) {
            set_free_velocity(cx, b, &m.bodies[k], &acceleration[dof..dof + 6]);
        }
        if K == 3 {
            plasticity::follow_from_start(cx, m, b, &mut velocity);
        }
        (b.work.start, b.work.step) = (velocity, acceleration);
    }
}

/// Activations at the next point, or in the next state.
#[inline(always)]
fn go_on_acting<C: Cx, const K: usize>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let share = C::F::c(SHARES[K]);
    for activation in activations(m) {
        let (place, w) = (activation.place, &mut b.work);
        // activation of x, and Σ bₖ ȧₖ from 0
        if K == 0 {
            w.rk_act[place] = cx.get(&b.act[place]);
            w.rk_act_rate_sum[place] = C::F::c(0.0);
        }
        // Σ bₖ ȧₖ, in the order of k
        let (start, rate) = (w.rk_act[place], w.act_dot[place]);
        let sum = rate.fma(share, w.rk_act_rate_sum[place]);
        w.rk_act_rate_sum[place] = sum;
        // act + h aₖ ȧₖ at a point, and `next`, which clamps, for the next state alone
        let act = match REACHES.get(K) {
            Some(reach) => rate.fma(C::F::c(m.dt.to_f64() * reach), start),
            None => next(activation, start, sum),
        };
        cx.set(&mut b.act[place], act);
    }
}

/// Positions of a body's joint from where the step began, moved by a velocity for a time.
#[inline(always)]
fn go<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
    velocity: &[C::F],
    time: C::F,
    is_last: bool,
) {
    let (c, d) = (body.coord, body.dof);
    // coordinates that the velocity adds to: all but quaternions
    let lines = match body.motion {
        Motion::Revolute | Motion::Prismatic => 1,
        Motion::Ball | Motion::Mocap => 0,
        Motion::Free => 3,
    };
    // from x: quaternions, too
    for i in 0..body.motion.coords() {
        cx.set(&mut b.joint_q[c + i], b.work.rk_q[c + i]);
    }
    // q + h aₖ v, where only the next state keeps its rounding error
    for i in 0..lines {
        cx.set(&mut b.joint_q_rest[c + i], b.work.rk_q_rest[c + i]);
        if is_last {
            let (q, rest) = (&mut b.joint_q[c + i], &mut b.joint_q_rest[c + i]);
            add_compensated(cx, q, rest, velocity[d + i], time);
        } else {
            let moved = velocity[d + i].fma(time, b.work.rk_q[c + i]);
            cx.set(&mut b.joint_q[c + i], moved);
        }
    }
    // the quaternion times exp(h aₖ ω), ω in the body's axes
    if matches!(body.motion, Motion::Ball | Motion::Free) {
        let spin = Vec3(std::array::from_fn(|i| velocity[d + lines + i]));
        let turned = quat::turned(read_quat(cx, &b.joint_q, c + lines), spin, time);
        write_quat(cx, &mut b.joint_q, c + lines, turned);
    }
}

/// Writes the velocity of a free body from that of its frame's origin and the angular one in its own axes.
#[inline(always)]
fn set_free_velocity<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
    velocity: &[C::F],
) {
    let [linear, local_spin] = halves(velocity);
    // ω = R ω' and v = v' + ω × R c, with the rotation that `go` wrote
    let rotation = quat::matrix(read_quat(cx, &b.joint_q, body.coord + 3));
    let spin = rotation * local_spin;
    let center = spin.cross_add(rotation * Vec3::constant(body.center), linear);
    for i in 0..3 {
        cx.set(&mut b.joint_qd[body.dof + i], center[i]);
        cx.set(&mut b.joint_qd[body.dof + 3 + i], spin[i]);
    }
}

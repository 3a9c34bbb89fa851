//! Actuators (MuJoCo documentation, "Computation: actuation model").
//!
//! ```text
//! l = Σ c q      v = Σ c q̇                                              c: gear times coefficient
//! force = clamp((g₀ + g₁ l + g₂ v) input + b₀ + b₁ l + b₂ v)            g: gain, b: bias
//! input = clamp(ctrl), or an activation a:  ȧ = clamp(ctrl)  or  (clamp(ctrl) - a) / T
//! smooth += clamp(Σ c force)                                            over the actuators of a dof
//! ```
//!
//! DC motors have more ([`super::motors`]), and some controls act late ([`super::delays`]). Where a tendon bounds the sum of its
//! actuators' forces, each is scaled by what keeps the sum in its range, before it is clamped. The derivatives of forces with
//! velocity are those before that, as MuJoCo's.

use super::transmission::measure;
use super::{motors, muscles};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::actuators::{Activation, ActivationRate};
use crate::constants::actuators::{Actuator, TendonBound};
use crate::constants::params::Param;
use crate::lane::{Cx, Num, Real};
use crate::step::{BlockOf, ConstantsOf, Stage, param};

/// Forces of the actuators.
pub struct Actuators;

impl Stage for Actuators {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Ctrl,
        A::DelayedControl,
        A::Act,
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Motion,
        A::TenLength,
        A::TenMoment,
        A::SmoothForce,
        A::QfrcGravcomp,
    ];
    const WRITES: &'static [A] = &[
        A::SmoothForce,
        A::ActuatorLength,
        A::ActuatorVelocity,
        A::ActuatorForce,
        A::QfrcActuator,
        A::ActuatorMoment,
        A::ActDot,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.actuators.all.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        b.work.qfrc_actuator.fill(C::F::c(0.0));
        // ȧ first, since the force of an `early` actuator is that of the next activation
        for (k, actuator) in m.actuators.all.iter().enumerate() {
            if let Some(activation) = &actuator.activation {
                b.work.act_dot[activation.place] = rate(cx, m, b, activation, k);
            }
        }
        // the scale of a tendon's actuators is in the place of their forces until these are known
        for bound in &m.actuators.tendon_bounds {
            let scale = tendon_scale(cx, m, b, bound);
            for &k in &bound.actuators {
                b.work.actuator_force[k] = scale;
            }
        }
        for (k, actuator) in m.actuators.all.iter().enumerate() {
            // input and force, (g₀ + g₁ l + g₂ v) input + b₀ + b₁ l + b₂ v
            let input = input(cx, b, actuator, k);
            let mut force = force(cx, m, b, k, input);
            // a tendon bounds the sum of its forces before each is clamped
            let mut bounds = m.actuators.tendon_bounds.iter();
            if bounds.any(|bound| bound.actuators.contains(&k)) {
                force = force * b.work.actuator_force[k];
            }
            let force = match force_range(m, &b.params, k) {
                Some([least, most]) => force.max(least).min(most),
                None => force,
            };
            // what magnets of a motor add is not clamped
            let force = match &actuator.motor {
                Some(motor) => motors::with_cogging(motor, force, b.work.actuator_length[k]),
                None => force,
            };
            b.work.actuator_force[k] = force;
            // Σ c force, where the moments c are constant
            for term in &actuator.terms {
                let joint = &mut b.work.qfrc_actuator[term.dof];
                *joint = force.fma(C::F::k(term.coefficient), *joint);
            }
            // and where they change with the state
            if let Some(length) = &actuator.turning {
                let w = &mut b.work;
                for (k, &dof) in length.dofs.iter().enumerate() {
                    let moment = w.actuator_moment[length.first + k];
                    w.qfrc_actuator[dof] = force.fma(moment, w.qfrc_actuator[dof]);
                }
            }
        }
        // where contacts have moments, too, the sum ends once they are known
        if m.actuators.adhesions.is_empty() {
            end_sum(m, &mut b.work);
        }
    }
}

/// Ends the sum of actuator forces, and adds it to the smooth forces.
#[inline(always)]
pub(super) fn end_sum<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    // gravity compensation that counts as an actuator, so that the bounds below hold for it, too
    for &dof in &m.compensation.actuated_dofs {
        w.qfrc_actuator[dof] = w.qfrc_actuator[dof] + w.qfrc_gravcomp[dof];
    }
    // clamp of the sum on a dof (MuJoCo: `actuatorfrcrange`)
    for bound in &m.actuators.dof_bounds {
        let joint = &mut w.qfrc_actuator[bound.dof];
        *joint = bounded(*joint, Some(bound.range));
    }
    // smooth += Jᵀ force
    for (smooth, joint) in w.smooth_force.iter_mut().zip(&w.qfrc_actuator) {
        *smooth = *smooth + *joint;
    }
}

/// What the forces of a tendon's actuators are multiplied with, so that their sum is in its range.
#[inline(always)]
fn tendon_scale<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    bound: &TendonBound<<C::F as Num>::Real>,
) -> C::F {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    // Σ force, before any clamp
    let mut sum = zero;
    for &k in &bound.actuators {
        let input = input(cx, b, &m.actuators.all[k], k);
        sum = sum + force(cx, m, b, k, input);
    }
    // a sum of 0 stays, whatever the range is
    let acts = zero.lt(sum.abs());
    // clamp(Σ force) / Σ force, where worlds with the sum 0 divide by 1
    let within = bounded(sum, Some(bound.range));
    C::F::select(acts, within.div(C::F::select(acts, sum, one)), one)
}

/// The control that actuator `k` follows, in its range.
#[inline(always)]
fn control<F: Num, V>(b: &crate::arrays::Block<F, V>, actuator: &Actuator<F::Real>, k: usize) -> F {
    let control = match &actuator.delay {
        Some(delay) => b.work.delayed_control[delay.place],
        None => b.ctrl[k],
    };
    bounded(control, actuator.ctrl_range)
}

/// How fast an activation changes.
#[inline(always)]
fn rate<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    activation: &Activation<<C::F as Num>::Real>,
    k: usize,
) -> C::F {
    let actuator = &m.actuators.all[k];
    match activation.rate {
        ActivationRate::Held => C::F::c(0.0),
        ActivationRate::Control => control(b, actuator, k),
        ActivationRate::Filter(time) => {
            // ȧ = (clamp(ctrl) - a) / T
            let off = control(b, actuator, k) - cx.get(&b.act[activation.place]);
            off.div(C::F::k(time))
        }
        ActivationRate::Muscle(ref rate) => {
            let act = cx.get(&b.act[activation.place]);
            muscles::rate(rate, control(b, actuator, k), act)
        }
        ActivationRate::Current(time) => {
            let input = control(b, actuator, k);
            let torque = direct_force(cx, m, b, k, input);
            let current = cx.get(&b.act[activation.place]);
            let motor = actuator.motor.as_ref().expect("motors have currents");
            motors::current_rate(motor, time, torque, current)
        }
    }
}

/// An activation after a step that begins at `act`.
#[inline(always)]
pub(in crate::step) fn next<F: Num>(activation: &Activation<F::Real>, act: F, rate: F) -> F {
    bounded(rate.fma(F::k(activation.reach), act), activation.range)
}

/// What the force of actuator `k` follows: its control or its activation.
#[inline(always)]
pub(super) fn input<C: Cx>(
    cx: &mut C,
    b: &BlockOf<C>,
    actuator: &Actuator<<C::F as Num>::Real>,
    k: usize,
) -> C::F {
    let Some(activation) = &actuator.activation else {
        return control(b, actuator, k);
    };
    // `early`: the force is that of the activation after this step (MuJoCo: `actearly`)
    let act = cx.get(&b.act[activation.place]);
    match activation.early {
        true => next(activation, act, b.work.act_dot[activation.place]),
        false => act,
    }
}

/// Force of actuator `k` before it is clamped; writes its length and velocity. `input` is its control or activation.
#[inline(always)]
fn force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize, input: C::F) -> C::F {
    let actuator = &m.actuators.all[k];
    if let (Some(activation), Some(motor)) = (&actuator.activation, &actuator.motor)
        && let ActivationRate::Current(_) = activation.rate
    {
        // gain and bias made the current, for which length and velocity were written
        return motors::torque(motor, input);
    }
    direct_force(cx, m, b, k, input)
}

/// The same of an actuator whose force is what gain and bias make of its input.
#[inline(always)]
fn direct_force<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    k: usize,
    input: C::F,
) -> C::F {
    let actuator = &m.actuators.all[k];
    let (mut length, mut velocity) = (C::F::c(0.0), C::F::c(0.0));
    // l and v = Σ moment q̇ of a length whose moments change
    if let Some(turning) = &actuator.turning {
        length = measure(cx, m, b, turning);
        for (k, &dof) in turning.dofs.iter().enumerate() {
            let moment = b.work.actuator_moment[turning.first + k];
            velocity = cx.get(&b.joint_qd[dof]).fma(moment, velocity);
        }
    }
    // l = Σ c q and v = Σ c q̇
    for term in &actuator.terms {
        let coefficient = C::F::k(term.coefficient);
        length = cx
            .get(&b.joint_q[m.dofs[term.dof].coord])
            .fma(coefficient, length);
        velocity = cx.get(&b.joint_qd[term.dof]).fma(coefficient, velocity);
    }
    b.work.actuator_length[k] = length;
    b.work.actuator_velocity[k] = velocity;
    let state = [length, velocity];
    // g = g₀ + g₁ l + g₂ v, and b alike
    let (params, gain, bias) = (&b.params, actuator.gain, actuator.bias);
    let gain = match &actuator.muscle_gain {
        Some(muscle) => muscles::gain(muscle, state),
        None => law(m, params, Param::ActuatorGain, (k, gain), state),
    };
    let bias = match &actuator.muscle_bias {
        Some(muscle) => muscles::bias(muscle, length),
        None => law(m, params, Param::ActuatorBias, (k, bias), state),
    };
    let force = gain.fma(input, bias);
    match &actuator.motor {
        Some(motor) => motors::within_voltage(motor, force, velocity),
        None => force,
    }
}

/// A gain or bias of an actuator: constant, per length, per velocity.
#[inline(always)]
fn law<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    which: Param,
    (k, fixed): (usize, [F::Real; 3]),
    [length, velocity]: [F; 2],
) -> F {
    // factors that are 0 in the model may vary from world to world
    let varies = m.varying.first(which).is_some();
    let mut sum = param(m, params, which, 3 * k, fixed[0]);
    // most actuators have no such term
    if varies || fixed[1].to_f64() != 0.0 {
        sum = length.fma(param(m, params, which, 3 * k + 1, fixed[1]), sum);
    }
    if varies || fixed[2].to_f64() != 0.0 {
        sum = velocity.fma(param(m, params, which, 3 * k + 2, fixed[2]), sum);
    }
    sum
}

/// Bounds of the force of actuator `k`, if it has any.
#[inline(always)]
pub(super) fn force_range<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    k: usize,
) -> Option<[F; 2]> {
    let [least, most] = m.actuators.all[k].force_range?;
    let which = Param::ActuatorForcerange;
    Some([
        param(m, params, which, 2 * k, least),
        param(m, params, which, 2 * k + 1, most),
    ])
}

#[inline(always)]
fn bounded<F: Num>(x: F, range: Option<[F::Real; 2]>) -> F {
    match range {
        Some([least, most]) => x.max(F::k(least)).min(F::k(most)),
        None => x,
    }
}

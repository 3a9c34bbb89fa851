//! DC motors (MuJoCo documentation, "DC Motor Model").
//!
//! ```text
//! τ = K/R (u - K v)                                                      driven by a voltage u
//! τ = clamp(kp (l* - l) + kd (v* - v) + f, K/R (± U - K v))              driven by a controller with the voltage U at most
//! force = clamp(τ) + A sin(n l + φ)                                      the second part is that of magnets: cogging
//! ```
//!
//! With inductance the activation is the current i, and the force is K i instead of τ: di/dt = clamp((τ/K - i) / T). As in MuJoCo,
//! i is that at the end of the step, found exactly where τ stays.
//!
//! Without its bound τ is what [`super::actuators`] makes of gain and bias, whose slope counts in an implicit step.

use crate::constants::actuators::{Activation, ActivationRate, Motor};
use crate::lane::{Num, Real};

/// τ, within what the voltage of the motor's controller allows.
#[inline(always)]
pub(super) fn within_voltage<F: Num>(motor: &Motor<F::Real>, torque: F, velocity: F) -> F {
    let Some(most) = motor.voltage else {
        return torque;
    };
    // K/R (± U - K v)
    let (most, back) = (F::k(most), velocity * F::k(motor.constant));
    let [least, most] = [-most - back, most - back];
    let per_volt = F::k(motor.per_volt);
    torque.max(least * per_volt).min(most * per_volt)
}

/// di/dt, from the torque that the motor would have without inductance.
#[inline(always)]
pub(super) fn current_rate<F: Num>(
    motor: &Motor<F::Real>,
    time: F::Real,
    torque: F,
    current: F,
) -> F {
    // (τ/K - i) / T
    let missing = torque.div(F::k(motor.constant)) - current;
    let rate = missing.div(F::k(time));
    match motor.current_rate {
        Some(most) => rate.max(-F::k(most)).min(F::k(most)),
        None => rate,
    }
}

/// K i in place of τ, where the activation is a current.
#[inline(always)]
pub(super) fn torque<F: Num>(motor: &Motor<F::Real>, current: F) -> F {
    current * F::k(motor.constant)
}

/// A force with A sin(n l + φ).
#[inline(always)]
pub(super) fn with_cogging<F: Num>(motor: &Motor<F::Real>, force: F, length: F) -> F {
    let [most, poles, phase] = motor.cogging;
    // most motors have none
    if most.to_f64() == 0.0 {
        return force;
    }
    let (sine, _) = length.fma(F::k(poles), F::k(phase)).sincos();
    sine.fma(F::k(most), force)
}

/// The share of a change of τ that the force has at the end of a step, 1 - exp(-h/T), where the activation is a current.
#[inline(always)]
pub(super) fn share_in_a_step<R: Real>(activation: Option<&Activation<R>>) -> Option<f64> {
    let activation = activation?;
    match activation.rate {
        ActivationRate::Current(time) => Some(activation.reach.to_f64() / time.to_f64()),
        _ => None,
    }
}

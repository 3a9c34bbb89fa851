//! Actuators (MuJoCo documentation, "Computation: actuation model").
//!
//! ```text
//! l = Σ c q      v = Σ c q̇                                              c: gear times coefficient
//! force = clamp((g₀ + g₁ l + g₂ v) clamp(ctrl) + b₀ + b₁ l + b₂ v)      g: gain, b: bias
//! smooth += clamp(Σ c force)                                            over the actuators of a dof
//! ```

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::mujoco::{Actuator, Term};
use crate::lane::{Cx, MaskOf, Num, Real};

/// Forces of the actuators.
pub struct Actuators;

impl Stage for Actuators {
    const READS: &'static [A] = &[A::JointQ, A::JointQd, A::Ctrl, A::SmoothForce];
    const WRITES: &'static [A] = &[A::SmoothForce, A::ActuatorForce, A::QfrcActuator];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.mujoco.actuators.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        b.work.qfrc_actuator.fill(C::F::c(0.0));
        for (k, actuator) in m.mujoco.actuators.iter().enumerate() {
            let force = bounded(
                force(cx, m, b, actuator, control(b, actuator, k)),
                actuator.force_range,
            );
            b.work.actuator_force[k] = force;
            for term in &actuator.terms {
                let joint = &mut b.work.qfrc_actuator[term.dof];
                *joint = force.fma(C::F::k(term.coefficient), *joint);
            }
        }
        for bound in &m.mujoco.actuator_bounds {
            let joint = &mut b.work.qfrc_actuator[bound.dof];
            *joint = bounded(*joint, Some(bound.range));
        }
        for (smooth, joint) in b.work.smooth_force.iter_mut().zip(&b.work.qfrc_actuator) {
            *smooth = *smooth + *joint;
        }
    }
}

/// The control of actuator `k`, in its range.
#[inline(always)]
fn control<F: Num, V>(b: &crate::arrays::Block<F, V>, actuator: &Actuator<F::Real>, k: usize) -> F {
    bounded(b.ctrl[k], actuator.ctrl_range)
}

/// Force of an actuator before it is clamped.
#[inline(always)]
fn force<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    actuator: &Actuator<<C::F as Num>::Real>,
    control: C::F,
) -> C::F {
    let (mut length, mut velocity) = (C::F::c(0.0), C::F::c(0.0));
    for term in &actuator.terms {
        let coefficient = C::F::k(term.coefficient);
        length = cx
            .get(&b.joint_q[m.dofs[term.dof].coord])
            .fma(coefficient, length);
        velocity = cx.get(&b.joint_qd[term.dof]).fma(coefficient, velocity);
    }
    let law = |[constant, stiffness, damping]: [<C::F as Num>::Real; 3]| {
        let mut sum = C::F::k(constant);
        // most actuators have no such term
        if stiffness.to_f64() != 0.0 {
            sum = length.fma(C::F::k(stiffness), sum);
        }
        if damping.to_f64() != 0.0 {
            sum = velocity.fma(C::F::k(damping), sum);
        }
        sum
    };
    law(actuator.gain).fma(control, law(actuator.bias))
}

#[inline(always)]
fn bounded<F: Num>(x: F, range: Option<[F::Real; 2]>) -> F {
    match range {
        Some([least, most]) => x.max(F::k(least)).min(F::k(most)),
        None => x,
    }
}

/// Does the force of an actuator depend on its velocity?
pub(super) fn is_damped<R: Real>(actuator: &Actuator<R>) -> bool {
    actuator.gain[2].to_f64() != 0.0 || actuator.bias[2].to_f64() != 0.0
}

/// Adds -h ∂force/∂v of actuators and tendons to the mass matrix, Jᵀ (-h ∂f/∂v) J, where actuator forces are not at their
/// bounds (MuJoCo: `mjd_actuator_vel`, `mjd_passive_vel`).
#[inline(always)]
pub(super) fn add_damping<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let dt = C::F::k(m.dt);
    for (k, actuator) in m
        .mujoco
        .actuators
        .iter()
        .enumerate()
        .filter(|(_, a)| is_damped(a))
    {
        let slope =
            C::F::k(actuator.gain[2]).fma(control(b, actuator, k), C::F::k(actuator.bias[2]));
        let mut damping = -(slope * dt);
        if let Some([least, most]) = actuator.force_range {
            let force = b.work.actuator_force[k];
            let within: MaskOf<C> = C::F::k(least).lt(force) & force.lt(C::F::k(most));
            damping = C::F::select(within, damping, C::F::c(0.0));
        }
        add_product(m, &mut b.work.mass_matrix, &actuator.terms, damping);
    }
    for tendon in &m.mujoco.tendons {
        let damping = C::F::k(tendon.damping) * dt;
        add_product(m, &mut b.work.mass_matrix, &tendon.terms, damping);
    }
}

/// Adds Jᵀ x J to the mass matrix, J with the coefficients of a length.
#[inline(always)]
fn add_product<F: Num>(
    m: &Constants<F::Real>,
    mass_matrix: &mut [F],
    terms: &[Term<F::Real>],
    x: F,
) {
    for (i, first) in terms.iter().enumerate() {
        let scaled = x * F::k(first.coefficient);
        for second in &terms[..i + 1] {
            let (lower, upper) = (first.dof.max(second.dof), first.dof.min(second.dof));
            // as in MuJoCo, dofs of different branches do not damp each other
            let (start, end) = m.dofs[lower].entries;
            let met = m.mass_entries[start..end]
                .iter()
                .find(|met| met.other == upper);
            if let Some(met) = met {
                let entry = &mut mass_matrix[met.place];
                *entry = scaled.fma(F::k(second.coefficient), *entry);
            }
        }
    }
}

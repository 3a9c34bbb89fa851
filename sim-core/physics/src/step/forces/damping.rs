//! Damping of actuators and tendons in an implicit step (MuJoCo: `mjd_actuator_vel`, `mjd_passive_vel`).
//!
//! ```text
//! M += Jᵀ (-h ∂f/∂v) J                   J: moments of the length along which f acts; of tendons as in [`super::curves`]
//! ```
//!
//! As in MuJoCo, dofs of different branches of a tree do not damp each other.

use super::actuators::{force_range, input};
use super::{curves, motors, muscles};
use crate::arrays::Workspace;
use crate::constants::lengths::Term;
use crate::constants::params::Param;
use crate::constants::{Constants, Motion};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::Vec3;
use crate::step::lengths::rate;
use crate::step::{BlockOf, ConstantsOf, param};

/// Adds the damping of actuators and tendons to the mass matrix, and its right-hand side to `acceleration`.
///
/// Actuators whose forces are at their bounds have none.
#[inline(always)]
pub(in crate::step) fn add_damping<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let dt = C::F::k(m.dt);
    for &k in &m.actuators.damped {
        let actuator = &m.actuators.all[k];
        // ∂force/∂v = g₂ input + b₂
        let input = input(cx, b, actuator, k);
        let velocity_factor = |which: Param, fixed: [<C::F as Num>::Real; 3]| {
            param(m, &b.params, which, 3 * k + 2, fixed[2])
        };
        let state = [b.work.actuator_length[k], b.work.actuator_velocity[k]];
        let gain = match &actuator.muscle_gain {
            Some(muscle) => muscles::gain_slope(muscle, state),
            None => velocity_factor(Param::ActuatorGain, actuator.gain),
        };
        let bias = match &actuator.muscle_bias {
            Some(_) => C::F::c(0.0),
            None => velocity_factor(Param::ActuatorBias, actuator.bias),
        };
        let slope = gain.fma(input, bias);
        let mut damping = -(slope * dt);
        // a current does not follow at once
        if let Some(share) = motors::share_in_a_step(actuator.activation.as_ref()) {
            damping = damping * C::F::c(share);
        }
        // a force at its bound does not change with the velocity: no damping in that world
        if let Some([least, most]) = force_range(m, &b.params, k) {
            let force = b.work.actuator_force[k];
            let within: MaskOf<C> = least.lt(force) & force.lt(most);
            damping = C::F::select(within, damping, C::F::c(0.0));
        }
        // M += Jᵀ (-h ∂force/∂v) J
        add_product(m, &mut b.work.mass_matrix, &actuator.terms, damping);
        // the same by moments, and on the right-hand side what MuJoCo's q̈ of free joints has more than ours
        if let Some(length) = &actuator.turning {
            let moments = |w: &Workspace<C::F>, k: usize| w.actuator_moment[length.first + k];
            add_moments(m, &mut b.work, &length.dofs, moments, damping);
            subtract_swing(cx, m, b, &length.dofs, moments, damping);
        }
    }
    // M += Jᵀ (h (d + 2 a |v| + 3 b v²)) J of tendons
    for tendon in &m.springs.tendons {
        let curve = tendon.damping_curve;
        if tendon.damping.to_f64() == 0.0 && !curves::bends(curve) {
            continue;
        }
        let mut damping = C::F::k(tendon.damping);
        if curves::bends(curve) {
            damping = curves::slope(damping, curve, rate(cx, b, &tendon.length));
        }
        let damping = damping * dt;
        add_product(m, &mut b.work.mass_matrix, &tendon.length.terms, damping);
        if let Some(tendon) = tendon.length.tendon {
            let tendon = &m.tendons[tendon];
            let moments = |w: &Workspace<C::F>, k: usize| w.ten_moment[tendon.first + k];
            add_moments(m, &mut b.work, &tendon.dofs, moments, damping);
            subtract_swing(cx, m, b, &tendon.dofs, moments, damping);
        }
    }
}

/// Subtracts x times the part of MuJoCo's J q̈ that ours does not have, from the dofs of the same branch: its acceleration of
/// a free joint is that of the frame's origin, which differs from that of the centre of mass by ω × (ω × r).
#[inline(always)]
fn subtract_swing<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    dofs: &[usize],
    moments: impl Fn(&Workspace<C::F>, usize) -> C::F,
    x: C::F,
) {
    for (k, body) in m.bodies.iter().enumerate() {
        // free bodies that the length depends on
        let first = dofs.iter().position(|&dof| dof == body.dof);
        let (Motion::Free, Some(first)) = (body.motion, first) else {
            continue;
        };
        // ω × (ω × o), with o = -R c the frame's origin from the centre of mass
        let omega = Vec3(std::array::from_fn(|i| {
            cx.get(&b.joint_qd[body.dof + 3 + i])
        }));
        let w = &mut b.work;
        let arm = Vec3::zero() - w.rotation[k] * Vec3::constant(body.center);
        let swing = omega.cross(omega.cross(arm));
        // J swing: the swing has no angular part
        let mut sum = C::F::c(0.0);
        for i in 0..3 {
            sum = moments(w, first + i).fma(swing[i], sum);
        }
        // acceleration -= Jᵀ x (J swing)
        for (place, &dof) in dofs.iter().enumerate() {
            if shared(m, dof, body.dof).is_some() {
                let moment = moments(w, place);
                w.acceleration[dof] = (x * sum).fnma(moment, w.acceleration[dof]);
            }
        }
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
    // each pair of terms once: the matrix keeps its lower triangle
    for (i, first) in terms.iter().enumerate() {
        let scaled = x * F::k(first.coefficient);
        for second in &terms[..i + 1] {
            if let Some(place) = shared(m, first.dof, second.dof) {
                let entry = &mut mass_matrix[place];
                *entry = scaled.fma(F::k(second.coefficient), *entry);
            }
        }
    }
}

/// The same of a length with moments, one for each of its dofs.
#[inline(always)]
fn add_moments<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    dofs: &[usize],
    moments: impl Fn(&Workspace<F>, usize) -> F,
    x: F,
) {
    for (i, first) in dofs.iter().enumerate() {
        let scaled = x * moments(w, i);
        for (k, second) in dofs[..i + 1].iter().enumerate() {
            if let Some(place) = shared(m, *first, *second) {
                w.mass_matrix[place] = scaled.fma(moments(w, k), w.mass_matrix[place]);
            }
        }
    }
}

/// Place of two dofs in the mass matrix; as in MuJoCo, dofs of different branches do not damp each other.
#[inline(always)]
pub(in crate::step) fn shared<R>(m: &Constants<R>, first: usize, second: usize) -> Option<usize> {
    // row of the later dof, which has entries for those on its path to the root alone
    let (lower, upper) = (first.max(second), first.min(second));
    let (start, end) = m.dofs[lower].entries;
    let mut met = m.mass_entries[start..end].iter();
    met.find(|met| met.other == upper).map(|met| met.place)
}

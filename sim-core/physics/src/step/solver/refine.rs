//! Accelerations corrected by inverse dynamics, where `f32` cannot hold the mass matrix well enough.
//!
//! ```text
//! missing = τ + Jᵀ f(a) - ID(q, q̇, a)          a += (M + Jᵀ W J)⁻¹ missing
//! ```
//!
//! The mass matrix of a long chain is ill-conditioned: with 40 joints, rounding the exact M to `f32` alone changes q̈ by 1e-4.
//! Rounding masses and lengths changes it by only 1e-7, and inverse dynamics body by body keeps that. This is iterative
//! refinement (Wilkinson 1963) with inverse dynamics as the residual. One pass reduces an error of 1e-3 to 1e-6;
//! `Newton::refinements` is the count of passes that a model needs.

use super::linear::{Unknown, coupling, solve_system};
use super::rows::{Acting, Jacobian, assemble, residual};
use super::spread::Spread;
use super::{acts, constraint_forces, contacts, gather, may_idle};
use crate::arrays::Array as A;
use crate::constants::contact::row;
use crate::lane::{Cx, Num, Real};
use crate::step::tree::inverse_dynamics::inverse_dynamics;
use crate::step::{BlockOf, ConstantsOf, Stage};
use crate::when;

/// What a pass of inverse dynamics and the solver's sums read.
const READS: &[A] = &[
    A::JointQ,
    A::JointQd,
    A::JointQdd,
    A::Params,
    A::Rotation,
    A::Velocity,
    A::BiasForce,
    A::TenMoment,
    A::TenBias,
    A::MassMatrix,
    A::SmoothForce,
    A::EfcD,
    A::EfcAref,
    A::LimitSide,
    A::RowJacobian,
    A::EfcForce,
    A::ConstraintForce,
    A::ContactRows,
    A::ContactForces,
];
/// What it corrects.
const WRITES: &[A] = &[
    A::JointQdd,
    A::EfcForce,
    A::ConstraintForce,
    A::ContactForces,
];

/// Accelerations and constraint forces, corrected where `f32` needs it.
pub struct Refine;

impl Stage for Refine {
    const READS: &'static [A] = READS;
    const WRITES: &'static [A] = WRITES;

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        refine(cx, m, b);
    }
}

/// Accelerations for output, in worlds that the solver skipped.
pub struct Accelerations;

impl Stage for Accelerations {
    const READS: &'static [A] = READS;
    const WRITES: &'static [A] = WRITES;
    // the forces that it writes are 0, as the solver left them
    const COMPLETES: &'static [A] = &[A::JointQdd];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        accelerations(cx, m, b);
    }
}

/// Corrects the accelerations of the worlds that the solver did not skip.
#[inline(always)]
fn refine<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    if !<<C::F as Num>::Real as Real>::DOUBLE && m.solver.refinements > 0 {
        let acts = acts(cx, m, &b.efc_weight);
        when!(cx, acts, {
            for _ in 0..m.solver.refinements {
                correct(cx, m, b);
            }
        });
    }
}

/// Accelerations of the worlds that the solver skipped: the first correction starts from 0.
#[inline(always)]
fn accelerations<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    if may_idle::<C>(m) {
        let idle = !acts(cx, m, &b.efc_weight);
        when!(cx, idle, {
            // from a = 0 the first pass is forward dynamics, M⁻¹ τ; the others refine it
            for qdd in &mut b.joint_qdd {
                cx.set(qdd, C::F::c(0.0));
            }
            for _ in 0..=m.solver.refinements {
                correct(cx, m, b);
            }
        });
    }
}

/// One pass: a += (M + Jᵀ W J)⁻¹ missing, and the forces at the new accelerations.
#[inline(always)]
fn correct<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // ID(q, q̇, a), into `missing`; D and aref of the rows
    inverse_dynamics(cx, m, b);
    let n = m.dofs.len();
    let w = &mut b.work;
    gather(cx, &b.efc_weight, &mut w.row_weight);
    gather(cx, &b.efc_aref, &mut w.row_aref);
    let acting = Acting::find(cx, m, &w.row_weight);
    // missing = τ + Jᵀ f - ID, where `smooth_force` lacks the bias force that ID has
    for j in 0..n {
        w.start[j] = cx.get(&b.joint_qdd[j]);
        let applied = w.smooth_force[j] + w.bias_force[j];
        w.missing[j] = applied + cx.get(&b.constraint_force[j]) - w.missing[j];
        // the right-hand side that is assembled with the Hessian is not used
        w.minimum[j] = C::F::c(0.0);
    }
    let touching = contacts::touching(cx, &m.contacts);
    // as in `solver`, where lanes share a world; torsional friction has no such system
    let mut classes = m.contacts.classes.iter();
    let spread = match touching {
        Some(_) if classes.all(|class| class.turns.is_none()) => Spread::new(cx, m, &w.mass_matrix),
        _ => None,
    };
    // H = M + Jᵀ W J with the pieces that the rows are on at a; a spread system keeps its own M
    match spread {
        None => w.hessian.copy_from_slice(&w.mass_matrix),
        Some(_) => w.hessian.fill(C::F::c(0.0)),
    }
    residual(
        m,
        Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
        &w.row_aref,
        &w.start,
        &mut w.jar,
    );
    assemble(m, &b.params, w, acting, None);
    contacts::residual::<_, true>(cx, &m.contacts, &w.start, row::JAR);
    // a += H⁻¹ missing, then the forces at the new a
    match spread {
        None => {
            let coupling = coupling(cx, m, touching);
            solve_system::<_, true>(cx, m, b, Unknown::Missing, touching, coupling);
        }
        Some(spread) => {
            let w = &mut b.work;
            spread.solve(cx, m, &w.hessian, &mut w.missing, None, None);
        }
    }
    for (qdd, (start, missing)) in b
        .joint_qdd
        .iter_mut()
        .zip(b.work.start.iter().zip(&b.work.missing))
    {
        cx.set(qdd, *start + *missing);
    }
    constraint_forces::<C, true>(cx, m, b, acting);
}

//! Accelerations corrected by inverse dynamics, where `f32` cannot hold the mass matrix well enough.
//!
//! ```text
//! missing = τ + Jᵀ f(a) - ID(q, q̇, a)          a += (M + Jᵀ W J)⁻¹ missing
//! ```
//!
//! An inertia of which most is seen only while the other joints are locked leaves few of its digits when
//! they are free: along a chain of 40 joints rounding the exact M to `f32` alone moves q̈ by 1e-4. Rounding the
//! masses and lengths moves it by 1e-7, and inverse dynamics body by body keeps that. One pass takes
//! an error of 1e-3 to 1e-6; `Newton::refinements` says how many a model needs.

use super::rows::{assemble, forces, residual};
use super::{acts, contacts, gather, may_idle, solve_system};
use crate::constants::contact::row;
use crate::lane::{Cx, Num, Real};
use crate::step::inverse_dynamics::inverse_dynamics;
use crate::step::{BlockOf, ConstantsOf};
use crate::when;

#[inline(always)]
pub(in crate::step) fn refine<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    if !<<C::F as Num>::Real as Real>::DOUBLE && m.solver.refinements > 0 {
        let acts = acts(cx, m, &b.efc_weight);
        when!(cx, acts, {
            for _ in 0..m.solver.refinements {
                correct(cx, m, b);
            }
        });
    }
}

/// Accelerations of the worlds that the solver passed over: the first correction is of 0.
#[inline(always)]
pub(in crate::step) fn accelerations<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    if may_idle::<C>(m) {
        let idle = C::F::not(acts(cx, m, &b.efc_weight));
        when!(cx, idle, {
            for qdd in &mut b.joint_qdd {
                cx.set(qdd, C::F::c(0.0));
            }
            for _ in 0..=m.solver.refinements {
                correct(cx, m, b);
            }
        });
    }
}

/// Which of the scratch vectors has what is missing, and then the correction.
const MISSING: usize = 0;

#[inline(always)]
fn correct<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    inverse_dynamics(cx, m, b);
    let n = m.dofs.len();
    let w = &mut b.work;
    let [missing, a, rhs, _] = &mut w.vector;
    let [jar, _, weight, aref] = &mut w.row;
    gather(cx, &b.efc_weight, weight);
    gather(cx, &b.efc_aref, aref);
    for j in 0..n {
        a[j] = cx.get(&b.joint_qdd[j]);
        let applied = w.smooth_force[j] + w.bias_force[j];
        missing[j] = applied + cx.get(&b.constraint_force[j]) - missing[j];
        rhs[j] = C::F::c(0.0);
    }
    w.hessian.copy_from_slice(&w.mass_matrix);
    residual(m, &w.limit_side, aref, a, jar);
    assemble(
        m,
        &b.params,
        &w.limit_side,
        weight,
        aref,
        jar,
        &mut w.hessian,
        rhs,
        None,
    );
    contacts::residual(cx, &m.contacts, a, row::JAR);
    let touching = contacts::touching(cx, &m.contacts);
    solve_system(cx, m, b, MISSING, false, touching);
    let w = &mut b.work;
    let [missing, a, _, joint] = &mut w.vector;
    let [jar, force, weight, aref] = &mut w.row;
    for j in 0..n {
        a[j] = a[j] + missing[j];
        cx.set(&mut b.joint_qdd[j], a[j]);
        joint[j] = C::F::c(0.0);
    }
    residual(m, &w.limit_side, aref, a, jar);
    forces(m, &b.params, &w.limit_side, weight, jar, force, joint);
    for r in 0..m.rows() {
        cx.set(&mut b.efc_force[r], force[r]);
    }
    for j in 0..n {
        cx.set(&mut b.constraint_force[j], joint[j]);
    }
    contacts::residual(cx, &m.contacts, a, row::JAR);
    contacts::forces(cx, &m.contacts, &mut b.constraint_force);
}

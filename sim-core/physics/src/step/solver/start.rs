//! Where the solver starts in `f64` (MuJoCo: `mj_warmstart`).

use super::contacts;
use super::rows::{Acting, Jacobian, cost, residual};
use crate::constants::contact::row;
use crate::lane::{Cx, Num};
use crate::math::factor::{multiply, solve as solve_linear};
use crate::step::tree::generalized::take_accelerations;
use crate::step::{BlockOf, ConstantsOf};

/// Starts from M⁻¹ τ where that costs less than the last step's result.
///
/// The minimum is the same, but where the tolerance stops the solver depends on the start by up to 5e-4 in q̈, which the
/// reference must reproduce. In `f32` it is not worth a factorisation and extra iterations: from a start without constraints
/// more rows change their piece.
#[inline(always)]
pub(super) fn choose_start<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    acting: Acting,
) {
    // models from MuJoCo keep the last result in its velocities between steps; from here on it is in ours
    if m.prescribed_search().is_some() {
        take_accelerations(cx, m, b);
    }
    let n = m.dofs.len();
    let w = &mut b.work;
    let (warm, smooth, ahead) = (&mut w.start, &mut w.minimum, &mut w.step);
    let (jar, jar_smooth) = (&mut w.jar, &mut w.jar_minimum);
    let (weight, aref) = (&w.row_weight, &w.row_aref);
    // M⁻¹ τ, and how far the last result is from it
    w.hessian.copy_from_slice(&w.mass_matrix);
    smooth.copy_from_slice(&w.smooth_force);
    solve_linear(&m.pattern, &mut w.hessian, smooth);
    for j in 0..n {
        warm[j] = cx.get(&b.joint_qdd[j]);
        ahead[j] = warm[j] - smooth[j];
    }
    // J a - aref of joint rows and ties at both
    residual(
        m,
        Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
        aref,
        warm,
        jar,
    );
    residual(
        m,
        Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
        aref,
        smooth,
        jar_smooth,
    );
    // the cost ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) + Σ s; the first term is 0 at M⁻¹ τ
    multiply(&m.pattern, &w.mass_matrix, ahead, &mut w.joint_force);
    let mut gauss = C::F::c(0.0);
    for j in 0..n {
        gauss = ahead[j].fma(w.joint_force[j], gauss);
    }
    let mut cost_warm = cx.var(gauss.fma(C::F::c(0.5), cost(m, &b.params, acting, [weight, jar])));
    let mut cost_smooth = cx.var(cost(m, &b.params, acting, [weight, jar_smooth]));
    // contacts add their s, from the two residuals that their rows have room for
    contacts::residual::<_, TURNS>(cx, &m.contacts, warm, row::JAR);
    contacts::residual::<_, TURNS>(cx, &m.contacts, smooth, row::AHEAD);
    contacts::cost::<_, TURNS>(cx, &m.contacts, row::JAR, &mut cost_warm);
    contacts::cost::<_, TURNS>(cx, &m.contacts, row::AHEAD, &mut cost_smooth);
    let mut cheaper = cx.get(&cost_smooth).lt(cx.get(&cost_warm));
    // without MuJoCo's warm start every world starts from M⁻¹ τ
    if m.prescribed_search()
        .is_some_and(|search| !search.warm_start)
    {
        cheaper = cheaper | !cheaper;
    }
    for j in 0..n {
        cx.set(
            &mut b.joint_qdd[j],
            C::F::select(cheaper, smooth[j], warm[j]),
        );
    }
}

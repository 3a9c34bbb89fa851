//! Friction of a contact in an elliptic cone: all of its directions at once.
//!
//! ```text
//! least of  ½ fᵀ A f + fᵀ (slope - A f₀)    |f| ≤ μ f₀ₙ        f: forces along tangents and scaled rotations
//! ```
//!
//! Rotations are scaled by their friction over that of sliding (see `turning`), so the cone is a ball.

use super::ball;
use super::rubbing::{change_force, directions, exists, place, slope_and_row, write_step};
use crate::constants::contact::{row, skew, turning};
use crate::lane::{Cx, Num, Real};
use crate::step::constraints::contact_rows::turning_scales;
use crate::step::solver::contacts::{ClassOf, ContactsOf};
use crate::step::{BlockOf, ConstantsOf};

/// Rise of the cost past which a contact keeps its forces, as in MuJoCo [N·m/s²].
pub(super) const RISE_MAX: f64 = 1e-10;
/// What MuJoCo adds to the diagonal of A, so that a direction that moves nothing may stay solvable [1/kg].
const DIAGONAL_MORE: f64 = 1e-10;
/// Least normal force of a contact with friction (MuJoCo: `mjMINVAL`) [N].
const NORMAL_MIN: f64 = 1e-15;

/// Finds the forces of a contact, and adds what they gain.
#[inline(always)]
pub(super) fn solve<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    (k, r): (usize, C::I),
    gain: &mut C::V,
) {
    let (t, zero, one) = (&m.contacts, C::F::c(0.0), C::F::c(1.0));
    let class = &t.classes[k];
    let n = directions(class);
    // M⁻¹ Jᵀ of all directions, then A and the slope
    for i in 0..n {
        write_step(cx, m, b, (k, r), i);
    }
    let mut problem = ball::Problem::empty(n);
    let (mut slope, mut before) = ([zero; 5], [zero; 5]);
    for i in 0..n {
        let (slope_here, products) = slope_and_row(cx, m, b, (k, r), i);
        problem.exists[i] = exists(cx, t, class, r, i);
        slope[i] = slope_here;
        before[i] = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::FORCE, turning::FORCE),
        );
        for j in 0..i + 1 {
            problem.matrix[i][j] = products[j];
            problem.matrix[j][i] = products[j];
        }
    }
    // y = f / μ is in a ball of radius f₀ₙ: the matrix is μ² A, the right-hand side μ (slope - A f₀)
    let mu = cx.load(t.memory.rows, r, row::MU);
    let normal = cx.load(t.memory.rows, r, row::FORCE);
    for i in 0..n {
        let mut rest = slope[i];
        for j in 0..n {
            rest = problem.matrix[i][j].fnma(before[j], rest);
        }
        problem.vector[i] = mu * rest;
    }
    let mut scaled = problem;
    for i in 0..n {
        for j in 0..n {
            scaled.matrix[i][j] = mu * mu * problem.matrix[i][j];
        }
        // more on the diagonal, scaled as the row
        let ratio = ratio(cx, t, r, i);
        let more = ratio * ratio * C::F::c(DIAGONAL_MORE);
        let diagonal = mu * mu * (problem.matrix[i][i] + more);
        // a direction that the contact does not have stays 0
        let has = zero.lt(problem.exists[i]);
        scaled.matrix[i][i] = C::F::select(has, diagonal, one);
    }
    // the least y in the ball; f = μ y
    let after = ball::least(cx, &scaled, normal);
    // a contact without a normal force has no friction
    let pushes = !normal.lt(C::F::c(NORMAL_MIN));
    let mut change = [zero; 5];
    for i in 0..n {
        let force = C::F::select(pushes, mu * after[i], zero);
        change[i] = force - before[i];
    }
    // ½ Δᵀ A Δ + slope · Δ: where it rises, rounding is all that is left
    let mut cost = zero;
    for i in 0..n {
        let mut pull = zero;
        for j in 0..n {
            pull = problem.matrix[i][j].fma(change[j], pull);
        }
        cost = change[i].fma(C::F::c(0.5).fma(pull, slope[i]), cost);
    }
    let rises = C::F::c(RISE_MAX).lt(cost);
    for (i, change) in change[..n].iter().enumerate() {
        let taken = C::F::select(rises, zero, *change);
        change_force(cx, m, b, (k, r), i, taken);
    }
    let total = cx.get(gain) - C::F::select(rises, zero, cost);
    cx.set(gain, total);
}

/// f₀² + Σ fᵢ² / impratio: R of friction is that of the normal over impratio.
#[inline(always)]
pub(super) fn squares<C: Cx>(cx: &mut C, t: &ContactsOf<C>, class: &ClassOf<C>, r: C::I) -> C::F {
    let ratio = C::F::c(1.0 / t.impratio.to_f64());
    let normal = cx.load(t.memory.rows, r, row::FORCE);
    // scaled forces: R f² is the same for all directions of friction
    let mut sum = C::F::c(0.0);
    for i in 0..directions(class) {
        let force = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::FORCE, turning::FORCE),
        );
        sum = force.fma(force, sum);
    }
    normal.fma(normal, sum * ratio)
}

/// Friction of a direction over that of the first tangent, as the model has it.
#[inline(always)]
fn ratio<C: Cx>(cx: &mut C, t: &ContactsOf<C>, r: C::I, direction: usize) -> C::F {
    let pair = cx.load(t.memory.rows, r, row::PAIR);
    let mut ratio = match direction {
        0 | 1 => C::F::c(1.0),
        _ => turning_scales(cx, t, pair)[direction - 2],
    };
    // a second tangent that is scaled scales rotations about it, too
    if t.skew.rows > 0 && matches!(direction, 1 | 4) {
        ratio = ratio * cx.pick(t.skew, pair, skew::SLIDE);
    }
    ratio
}

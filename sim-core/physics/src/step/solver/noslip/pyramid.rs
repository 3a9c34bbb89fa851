//! Friction of a contact in a pyramid: one direction after the other.
//!
//! The two edges of a direction share a force 2 c, which stays; the friction f = μ (push₊ - push₋) moves between them:
//!
//! ```text
//! f⁺ = clamp(f - (J a - aref) / A, ± 2 μ c)      A = J M⁻¹ Jᵀ
//! ```

use super::cone::RISE_MAX;
use super::rubbing::{
    DIAGONAL_MIN, change_force, directions, exists, gained, place, slope_and_row, write_step,
};
use crate::constants::contact::{row, turning};
use crate::each;
use crate::lane::{Cx, Num};
use crate::step::constraints::contact_rows::class_list;
use crate::step::solver::contacts::{ClassOf, ContactsOf};
use crate::step::{BlockOf, ConstantsOf};

/// Writes 2 c, the force that the edges of each direction share, in the place of a residual.
#[inline(always)]
pub(super) fn keep_sums<C: Cx>(cx: &mut C, t: &ContactsOf<C>) {
    let zero = C::F::c(0.0);
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
            let mu = cx.load(t.memory.rows, r, row::MU);
            let normal = cx.load(t.memory.rows, r, row::JAR);
            for i in 0..directions(class) {
                // an edge pushes by -D (jar₀ ± μ jarᵢ) where that is positive
                let side = cx.load(t.memory.rows, r, place(class, i, row::JAR, turning::JAR));
                let (above, below) = (mu.fma(side, normal), mu.fnma(side, normal));
                let edges = (-(stiff * above)).max(zero) + (-(stiff * below)).max(zero);
                let sum = edges * exists(cx, t, class, r, i);
                cx.fill(t.memory.rows, r, place(class, i, row::AHEAD, turning::AHEAD), sum);
            }
        });
    }
}

/// Finds the forces of a contact, and adds what they gain.
#[inline(always)]
pub(super) fn solve<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    (k, r): (usize, C::I),
    gain: &mut C::V,
) {
    let (t, zero) = (&m.contacts, C::F::c(0.0));
    let class = &t.classes[k];
    let mu = cx.load(t.memory.rows, r, row::MU);
    for i in 0..directions(class) {
        // by the newest a: directions before this one have moved it
        write_step(cx, m, b, (k, r), i);
        let (slope, products) = slope_and_row(cx, m, b, (k, r), i);
        let diagonal = products[i];
        // within the force of both edges; 4 μ² A is that of MuJoCo's rows
        let sum = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::AHEAD, turning::AHEAD),
        );
        let bound = mu * sum;
        let force = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::FORCE, turning::FORCE),
        );
        let moves = !(C::F::c(4.0) * mu * mu * diagonal).lt(C::F::c(DIAGONAL_MIN));
        // f of no residual, clamped; 0 where the direction moves nothing
        let free = force - slope.div(C::F::select(moves, diagonal, C::F::c(1.0)));
        let next = C::F::select(moves, free.max(-bound).min(bound), zero);
        let change = (next - force) * exists(cx, t, class, r, i);
        // a rise is rounding, as in `cone`
        let gains = gained(change, diagonal, slope);
        let rises = C::F::c(RISE_MAX).lt(-gains);
        change_force(cx, m, b, (k, r), i, C::F::select(rises, zero, change));
        let total = cx.get(gain) + C::F::select(rises, zero, gains);
        cx.set(gain, total);
    }
}

/// Σ push² over all edges: ½ ((2 c)² + (f / μ)²) of each direction.
#[inline(always)]
pub(super) fn squares<C: Cx>(cx: &mut C, t: &ContactsOf<C>, class: &ClassOf<C>, r: C::I) -> C::F {
    let (zero, one, half) = (C::F::c(0.0), C::F::c(1.0), C::F::c(0.5));
    let mu = cx.load(t.memory.rows, r, row::MU);
    // push₊ - push₋ = f / μ
    let rubs = zero.lt(mu);
    let inverse = one.div(C::F::select(rubs, mu, one));
    let mut total = zero;
    for i in 0..directions(class) {
        let sum = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::AHEAD, turning::AHEAD),
        );
        let force = cx.load(
            t.memory.rows,
            r,
            place(class, i, row::FORCE, turning::FORCE),
        );
        let apart = force * inverse;
        total = half.fma(sum.fma(sum, apart * apart), total);
    }
    // without friction there is one row, of which the four edges have a quarter each
    let normal = cx.load(t.memory.rows, r, row::FORCE);
    C::F::select(rubs, total, C::F::c(0.25) * normal * normal)
}

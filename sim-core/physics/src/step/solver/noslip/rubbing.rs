//! Contacts that rub: their order, and sums over the directions of friction of one contact.
//!
//! MuJoCo sweeps contacts by the pairs of geoms that touch. The contacts of a pair lie in one list, in the order in which they
//! are found, so a sweep goes from pair to pair by their ranks.

use super::{Part, cone, pyramid};
use crate::constants::contact::{Class, Cone, row, turning};
use crate::lane::{Cx, Num};
use crate::math::factor::substitute;
use crate::step::constraints::contact_rows::class_list;
use crate::step::solver::contacts::{ClassOf, ContactsOf};
use crate::step::{BlockOf, ConstantsOf};
use crate::{break_if, each, times, when};

/// Least A of a direction in which a force moves anything (MuJoCo: `mjMINVAL`) [1/kg].
pub(super) const DIAGONAL_MIN: f64 = 1e-15;
/// More than any rank of a pair.
const LAST: f64 = 1e9;

/// One sweep over the contacts of a part; adds what it gains.
#[inline(always)]
pub(super) fn sweep<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    part: Part,
    gain: &mut C::V,
) {
    let t = &m.contacts;
    let mut rank = cx.var(C::F::c(-1.0));
    times!(cx, t.contacts_max, {
        // the least rank of a pair that touches and was not visited yet
        let visited = cx.get(&rank);
        cx.set(&mut rank, C::F::c(LAST));
        for k in 0..t.classes.len() {
            let list = class_list(cx, t, k);
            // a contact of an earlier pair keeps what was found so far
            each!(cx, r in list, {
                let other = rank_of(cx, m, r);
                let least = cx.get(&rank).min(other);
                let later = visited.lt(other);
                let best = C::F::select(later, least, cx.get(&rank));
                cx.set(&mut rank, best);
            });
        }
        // no pair is left
        let ends = !cx.get(&rank).lt(C::F::c(LAST));
        break_if!(cx, ends);
        // its contacts
        let current = cx.get(&rank);
        for (k, class) in t.classes.iter().enumerate() {
            let Some(column) = class.columns.first() else {
                continue;
            };
            let here = part.has::<C>(b, column.dof);
            let list = class_list(cx, t, k);
            each!(cx, r in list, {
                // ranks are whole, so within a half they are equal; a contact past its margin has no D
                let zero = C::F::c(0.0);
                let is_next = (rank_of(cx, m, r) - current).abs().lt(C::F::c(0.5));
                let rubs = zero.lt(cx.load(t.memory.rows, r, row::MU));
                let acts = zero.lt(cx.load(t.memory.rows, r, row::STIFFNESS));
                let counts = here & is_next & rubs & acts;
                when!(cx, counts, {
                    match t.cone {
                        Cone::Elliptic => cone::solve(cx, m, b, (k, r), gain),
                        Cone::Pyramidal => pyramid::solve(cx, m, b, (k, r), gain),
                    }
                });
            });
        }
    });
}

/// The rank of a contact's pair.
#[inline(always)]
fn rank_of<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, r: C::I) -> C::F {
    let pair = cx.load(m.contacts.memory.rows, r, row::PAIR);
    cx.pick(m.sensors.ranks, pair, 0)
}

/// Directions of friction of a class: the tangents, and three rotations.
#[inline(always)]
pub(super) fn directions<R>(class: &Class<R>) -> usize {
    match class.turns {
        Some(_) => 5,
        None => 2,
    }
}

/// The place of a direction's scalar in a row. `first` is that of the normal, `more` that of the first rotation in the second
/// block.
#[inline(always)]
pub(super) fn place<R>(class: &Class<R>, direction: usize, first: usize, more: usize) -> usize {
    match (direction, class.turns) {
        (0 | 1, _) => first + 1 + direction,
        (_, Some(block)) => block + more + direction - 2,
        (_, None) => unreachable!("a class without rotations has two directions"),
    }
}

/// 1 where a contact has a direction, else 0: tangents always, rotations where they have friction.
#[inline(always)]
pub(super) fn exists<C: Cx>(
    cx: &mut C,
    t: &ContactsOf<C>,
    class: &ClassOf<C>,
    r: C::I,
    direction: usize,
) -> C::F {
    match direction {
        0 | 1 => C::F::c(1.0),
        _ => {
            let at = place(class, direction, 0, turning::EXISTS);
            cx.load(t.memory.rows, r, at)
        }
    }
}

/// Writes M⁻¹ Jᵀ of a direction to its part of `friction_steps`.
#[inline(always)]
pub(super) fn write_step<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    (k, r): (usize, C::I),
    direction: usize,
) {
    let (class, n) = (&m.contacts.classes[k], m.dofs.len());
    let at = place(class, direction, row::JACOBIAN, turning::JACOBIAN);
    let w = &mut b.work;
    let step = &mut w.friction_steps[direction * n..(direction + 1) * n];
    step.fill(C::F::c(0.0));
    // Jᵀ, of three rows per column in each block; then M⁻¹ Jᵀ by the factor of M
    for (c, column) in class.columns.iter().enumerate() {
        step[column.dof] = cx.load(m.contacts.memory.rows, r, at + 3 * c);
    }
    substitute(&m.pattern, &w.hessian, step);
}

/// J a - aref of a direction, and its products with the steps of the directions up to it: a row of A.
#[inline(always)]
pub(super) fn slope_and_row<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    (k, r): (usize, C::I),
    direction: usize,
) -> (C::F, [C::F; 5]) {
    let (class, n, rows) = (&m.contacts.classes[k], m.dofs.len(), m.contacts.memory.rows);
    let aref = cx.load(rows, r, place(class, direction, row::AREF, turning::AREF));
    let at = place(class, direction, row::JACOBIAN, turning::JACOBIAN);
    // column by column: J a - aref, and J times M⁻¹ Jᵀ
    let (mut slope, mut products) = (-aref, [C::F::c(0.0); 5]);
    for (c, column) in class.columns.iter().enumerate() {
        let entry = cx.load(rows, r, at + 3 * c);
        slope = entry.fma(cx.get(&b.joint_qdd[column.dof]), slope);
        for (other, product) in products[..direction + 1].iter_mut().enumerate() {
            *product = entry.fma(b.work.friction_steps[other * n + column.dof], *product);
        }
    }
    (slope, products)
}

/// Changes the force of a direction: with it f, Jᵀ f, and a by M⁻¹ Jᵀ times the change.
#[inline(always)]
pub(super) fn change_force<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    (k, r): (usize, C::I),
    direction: usize,
    change: C::F,
) {
    let (class, n, rows) = (&m.contacts.classes[k], m.dofs.len(), m.contacts.memory.rows);
    // f
    let at = place(class, direction, row::FORCE, turning::FORCE);
    let force = cx.load(rows, r, at) + change;
    cx.store(rows, r, at, force);
    // a += M⁻¹ Jᵀ Δf
    for j in 0..n {
        let step = b.work.friction_steps[direction * n + j];
        let a = change.fma(step, cx.get(&b.joint_qdd[j]));
        cx.set(&mut b.joint_qdd[j], a);
    }
    // Jᵀ f += Jᵀ Δf
    let first = place(class, direction, row::JACOBIAN, turning::JACOBIAN);
    for (c, column) in class.columns.iter().enumerate() {
        let entry = cx.load(rows, r, first + 3 * c);
        let joint = change.fma(entry, cx.get(&b.constraint_force[column.dof]));
        cx.set(&mut b.constraint_force[column.dof], joint);
    }
}

/// What a change of a force gains: -(½ A change² + slope change).
#[inline(always)]
pub(super) fn gained<F: Num>(change: F, diagonal: F, slope: F) -> F {
    -(change * (F::c(0.5) * diagonal).fma(change, slope))
}

/// Adds ½ Σ R f² of the contacts of a class.
#[inline(always)]
pub(super) fn softness<C: Cx>(cx: &mut C, t: &ContactsOf<C>, k: usize, sum: &mut C::V) {
    let class = &t.classes[k];
    let list = class_list(cx, t, k);
    // f² over the ratios of R to that of the normal
    each!(cx, r in list, {
        let squares = match t.cone {
            Cone::Elliptic => cone::squares(cx, t, class, r),
            Cone::Pyramidal => pyramid::squares(cx, t, class, r),
        };
        // over D, where the contact acts
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        let stiff = cx.load(t.memory.rows, r, row::STIFFNESS);
        let acts = zero.lt(stiff);
        let cost = (C::F::c(0.5) * squares).div(C::F::select(acts, stiff, one));
        let total = cx.get(sum) + C::F::select(acts, cost, zero);
        cx.set(sum, total);
    });
}

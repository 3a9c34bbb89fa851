//! Stiff contacts, added to the factor of the mass matrix instead of the matrix.
//!
//! A contact may be 10⁷ times as stiff as bodies are heavy. The sum M + Jᵀ W J then has no digit of M in `f32`, and neither has a
//! factor of the sum: solutions lead anywhere. So the vectors of such contacts are added to the factor of M, one after another:
//!
//! ```text
//! W = Σ w u uᵀ        v = Jᵀ u        L'ᵀ D' L' = Lᵀ D L + w v vᵀ
//!
//! row by row, the last one first:
//! p = v(i)        d' = d + w p²        β = w p / d'        w' = w d / d'
//! v(j) -= p L(i, j)        L'(i, j) = L(i, j) + β v(j)
//! ```
//!
//! d' and w' are sums and products of positive numbers, so nothing cancels in them. The result is as good as that of an orthogonal factorisation of
//! (M^½, W^½ J), whose error grows with the root of the stiffness (Bennett 1965; Gill, Golub, Murray and Saunders 1974, method C1;
//! Gentleman 1973).

mod roots;
#[cfg(test)]
mod tests;

use super::contacts::{ClassOf, ContactsOf, block_of};
use super::linear::{Target, widen};
use super::{gather, turning};
use crate::constants::contact::{row, turning as more};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::{UpdatePath, decompose, substitute};
use crate::step::constraints::contact_rows::class_list;
use crate::step::{BlockOf, ConstantsOf};
use crate::{each, when};
use roots::Roots;

/// Largest ratio of diagonal entries of H and M for which the sum serves [–]: it keeps M to 2 %.
const STIFFENING_MAX: f64 = 3e5;

/// May a world's contacts be stiffer? In `f64`, the reference, none are.
#[inline(always)]
pub(super) fn may_be_stiff<C: Cx>(cx: &C, t: &ContactsOf<C>) -> bool {
    cx.updates_factors() && !<<C::F as Num>::Real as Real>::DOUBLE && t.are_stiff
}

/// Solves the system of an iteration once more in the touching worlds whose H is too stiff beside M, and replaces the solution there.
/// The right-hand side is in `pull`, and rows of contacts have the pieces of the model.
#[inline(always)]
pub(super) fn solve_again<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    target: Target,
    (stiffening, touching): (C::F, MaskOf<C>),
    coupling: Option<MaskOf<C>>,
) {
    let is_stiff = touching & C::F::c(STIFFENING_MAX).lt(stiffening);
    if !cx.anywhere(is_stiff) {
        return;
    }
    // the solution of the other worlds stays
    for (cell, value) in b.solution.iter_mut().zip(target.values(&mut b.work)) {
        cx.put(cell, *value);
    }
    let couples = match coupling {
        Some(some) => cx.anywhere(some),
        None => false,
    };
    when!(cx, is_stiff, {
        solve_by_factor::<_, TURNS>(cx, m, b, couples);
        for (cell, value) in b.solution.iter_mut().zip(&b.work.joint_force) {
            cx.set(cell, *value);
        }
    });
    gather(cx, &b.solution, target.values(&mut b.work));
}

/// Leaves the solution in `joint_force`.
#[inline(always)]
fn solve_by_factor<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    couples: bool,
) {
    let (t, w) = (&m.contacts, &mut b.work);
    // the factor of M and the rows of joints, in cells, which loops over contacts change
    decompose(&m.pattern, &mut w.joint_system);
    gather(cx, &b.pull, &mut w.joint_force);
    cx.put_values(&w.joint_system, &mut b.system);
    // contacts whose vectors lie in M's pattern, then the others, in the same factor with more room
    for larger in [false, true] {
        if larger && !couples {
            break;
        }
        let small = cx.cells(&mut w.joint_system, &mut b.system);
        let cells = match larger {
            false => small,
            true => {
                let cells = cx.cells(&mut w.coupled_hessian, &mut b.coupled_system);
                widen(cx, &m.coupled.places, small, cells);
                cells
            }
        };
        for k in (0..t.classes.len()).filter(|&k| t.classes[k].couples == larger) {
            add_class::<_, TURNS>(cx, t, k, cells, &mut w.update_vectors);
        }
    }
    let (pattern, factor, cells) = match couples {
        false => (&m.pattern, &mut w.joint_system, &b.system),
        true => (
            &m.coupled.pattern,
            &mut w.coupled_hessian,
            &b.coupled_system,
        ),
    };
    // H⁻¹ of the right-hand side
    cx.get_values(factor, cells);
    substitute(pattern, factor, &mut w.joint_force);
}

/// Adds the contacts of a class to a factor. `vectors` has two scalars for each dof and direction of a contact.
#[inline(always)]
fn add_class<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    k: usize,
    factor: &mut [C::V],
    vectors: &mut [C::F],
) {
    let class: &ClassOf<C> = &t.classes[k];
    let path = &class.update_path;
    let list = class_list(cx, t, k);
    // a class with torsional friction has six rows per contact
    if let Some(block) = block_of::<_, TURNS>(class) {
        each!(cx, r in list, {
            let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
            let mut stiff = [cx.load(t.memory.rows, r, row::STIFFNESS); 6];
            let exists = cx.load3(t.memory.rows, r, block + more::EXISTS);
            for (stiff, exists) in stiff[3..].iter_mut().zip(exists) {
                *stiff = *stiff * exists;
            }
            let roots = Roots::of_contact(cx, t, r, jar, stiff).only(cx);
            let (rows, _) = vectors.as_chunks_mut::<6>();
            for (v, c) in rows.iter_mut().zip(path.sources()) {
                *v = match *c {
                    None => [C::F::c(0.0); 6],
                    Some(c) => {
                        let (first, other) = (row::JACOBIAN + 3 * c, block + more::JACOBIAN + 3 * c);
                        roots.vectors(t.cone, turning::six(cx, t, r, first, other))
                    }
                };
            }
            update(cx, path, factor, roots.weights, rows);
        });
        return;
    }
    each!(cx, r in list, {
        let jar = cx.load3(t.memory.rows, r, row::JAR);
        let stiff = [cx.load(t.memory.rows, r, row::STIFFNESS); 3];
        let roots = Roots::of_contact(cx, t, r, jar, stiff).only(cx);
        let (rows, _) = vectors.as_chunks_mut::<3>();
        for (v, c) in rows.iter_mut().zip(path.sources()) {
            *v = match *c {
                None => [C::F::c(0.0); 3],
                Some(c) => roots.vectors(t.cone, cx.load3(t.memory.rows, r, row::JACOBIAN + 3 * c)),
            };
        }
        update(cx, path, factor, roots.weights, rows);
    });
}

/// Adds Σ w v vᵀ to a factor: L below the diagonal, 1/D on it. `rows` has the vectors in the rows of the path, then room for as many β.
///
/// Columns of L are taken one after another, so that a column's part of the vectors stays in registers.
#[inline(always)]
fn update<C: Cx, const N: usize>(
    cx: &mut C,
    path: &UpdatePath,
    factor: &mut [C::V],
    mut weights: [C::F; N],
    rows: &mut [[C::F; N]],
) {
    let one = C::F::c(1.0);
    let (pivots, slopes) = rows.split_at_mut(rows.len() / 2);
    for i in 0..path.sources().len() {
        // v(i) -= p L(k, i), then L(k, i) += β v(i)
        let mut v = pivots[i];
        for run in path.before(i) {
            for k in run.start..run.end {
                let cell = &mut factor[path.at(k, i)];
                let mut entry = cx.get(cell);
                for n in 0..N {
                    v[n] = pivots[k][n].fnma(entry, v[n]);
                    entry = slopes[k][n].fma(v[n], entry);
                }
                cx.put(cell, entry);
            }
        }
        pivots[i] = v;
        // d' / d = 1 + w p² / d, vector by vector
        let cell = &mut factor[path.at(i, i)];
        let inverse = cx.get(cell);
        let (mut growth, mut quotient) = (one, one);
        for n in 0..N {
            let push = weights[n] * v[n];
            let grown = (push * inverse).fma(v[n], growth);
            quotient = one.div(grown);
            slopes[i][n] = push * (inverse * quotient);
            weights[n] = weights[n] * (growth * quotient);
            growth = grown;
        }
        cx.put(cell, inverse * quotient);
    }
}

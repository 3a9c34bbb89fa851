//! Contacts of an island along a line of MuJoCo's search: cost, slope and curvature at a point of it.
//!
//! The line moves one island, and only its trees' contacts are visited.

use super::cones::{bend_along, power};
use super::contacts::{ContactsOf, block_of, law_at};
use super::islands::is_island;
use super::turning;
use crate::constants::contact::{row, turning as more};
use crate::constants::options::Search;
use crate::lane::{Cx, Num};
use crate::step::constraints::contact_rows::class_list;
use crate::{each, when};

/// An island, by the labels of dofs.
#[derive(Clone, Copy)]
pub(super) struct Island<'a, F: Num> {
    pub search: &'a Search<F::Real>,
    /// The label of each dof's island: see [`super::islands`].
    pub labels: &'a [F],
    /// The label of this island.
    pub label: F,
}

impl<F: Num> Island<'_, F> {
    /// The worlds in which a dof is of the island.
    #[inline(always)]
    pub fn has(&self, dof: usize) -> F::Mask {
        is_island(self.labels[dof], self.label)
    }
}

/// Writes J `step` to `AHEAD` of all contacts.
#[inline(always)]
pub(super) fn changes<C: Cx, const TURNS: bool>(cx: &mut C, t: &ContactsOf<C>, step: &[C::F]) {
    let zero = [C::F::c(0.0); 3];
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            // J s by runs of columns: of normal and tangents, then of rotations
            let (mut moves, mut turns) = (zero, zero);
            for run in &class.runs {
                let first = row::JACOBIAN + 3 * run.column;
                moves = cx.sum_triples(t.memory.rows, r, first, &step[run.places()], moves);
            }
            cx.fill_all(t.memory.rows, r, row::AHEAD, moves);
            if let Some(block) = block_of::<_, TURNS>(class) {
                for run in &class.runs {
                    let first = block + more::JACOBIAN + 3 * run.column;
                    turns = cx.sum_triples(t.memory.rows, r, first, &step[run.places()], turns);
                }
                cx.fill_all(t.memory.rows, r, block + more::AHEAD, turns);
            }
        });
    }
}

/// Adds to `sums` the cost of the island's contacts at `JAR` + α `AHEAD` less that at `JAR`, then its first and second
/// derivative, and the size of the terms of the first.
#[inline(always)]
pub(super) fn add<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    island: Island<'_, C::F>,
    alpha: C::F,
    sums: &mut [C::V; 4],
) {
    // contacts make one island of all dofs that move them, so the first one tells
    for root in island.search.islands_of(island.labels.len()) {
        let here = island.has(root);
        when!(cx, here, {
            // a class is listed with the first of its trees alone, so it is added once
            for &k in &island.search.classes[root] {
                let class = &t.classes[k];
                let list = class_list(cx, t, k);
                each!(cx, r in list, {
                    // s(α) - s(0), p' = -f · jv, p'' = jvᵀ W jv, and |f · jv| for the rounding of p'
                    let terms = match block_of::<_, TURNS>(class) {
                        None => {
                            let jar = cx.load3(t.memory.rows, r, row::JAR);
                            let jv = cx.load3(t.memory.rows, r, row::AHEAD);
                            // the residual at α; the laws there and at α = 0
                            let mut there = jar;
                            for i in 0..3 {
                                there[i] = alpha.fma(jv[i], jar[i]);
                            }
                            let start = law_at(cx, t, r, jar);
                            let law = law_at(cx, t, r, there);
                            let power = power(&law.force, jv);
                            let bend = bend_along(&law, jv);
                            [law.cost - start.cost, -power, bend, power.abs()]
                        }
                        Some(block) => {
                            let jar = turning::six(cx, t, r, row::JAR, block + more::JAR);
                            let jv = turning::six(cx, t, r, row::AHEAD, block + more::AHEAD);
                            let mut there = jar;
                            for i in 0..6 {
                                there[i] = alpha.fma(jv[i], jar[i]);
                            }
                            let start = turning::law_at(cx, t, r, block, jar, None);
                            let law = turning::law_at(cx, t, r, block, there, None);
                            let bend = turning::dot(law.times(jv), jv);
                            let power = turning::dot(law.force, jv);
                            [law.cost - start.cost, -power, bend, power.abs()]
                        }
                    };
                    // worlds without this contact add 0
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        let total = cx.get(sum) + cx.only(term);
                        cx.put(sum, total);
                    }
                });
            }
        });
    }
}

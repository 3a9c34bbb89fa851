//! Contacts along a line of MuJoCo's search: cost, slope and curvature at a point of it.

use super::cones::{bend_along, power};
use super::contacts::{ContactsOf, block_of, law_at};
use super::turning;
use crate::constants::contact::{row, turning as more};
use crate::each;
use crate::lane::{Cx, Num};
use crate::step::contact_rows::class_list;

/// Adds to `sums` the cost of all contacts at `JAR` + α `AHEAD` less that at `JAR`, then its first and second
/// derivative, and the size of the terms of the first.
#[inline(always)]
pub(super) fn add<C: Cx, const TURNS: bool>(
    cx: &mut C,
    t: &ContactsOf<C>,
    alpha: C::F,
    sums: &mut [C::V; 4],
) {
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let terms = match block_of::<_, TURNS>(class) {
                None => {
                    let jar = cx.load3(t.memory.rows, r, row::JAR);
                    let jv = cx.load3(t.memory.rows, r, row::AHEAD);
                    let mut there = jar;
                    for i in 0..3 {
                        there[i] = alpha.fma(jv[i], jar[i]);
                    }
                    let start = law_at(cx, t, r, jar);
                    let law = law_at(cx, t, r, there);
                    let power = power(&law.force, jv);
                    [law.cost - start.cost, -power, bend_along(&law, jv), power.abs()]
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
            for (sum, term) in sums.iter_mut().zip(terms) {
                let total = cx.get(sum) + cx.only(term);
                cx.put(sum, total);
            }
        });
    }
}

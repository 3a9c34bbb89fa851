//! Two texts that share rows: one finds them, pair by pair, and sorts them into kept lists; the other opens
//! those lists again.

use sim_physics::lane::{Cx, Fixed, Num, Real, Table, Tables};
use sim_physics::{each, push, span, times, when};

/// Numbers that the texts read.
pub const INPUTS: usize = 3;
/// Kept lists: the last of them has no room.
pub const KINDS: usize = 3;
const COUNTS: Table = Table {
    base: 0,
    stride: 2,
    rows: KINDS,
};
/// Distance, number of the pair, and what the second program makes of them.
const CONTACTS: Table = Table {
    base: 6,
    stride: 3,
    rows: 7,
};
/// Scratch memory of the texts, in numbers per world.
pub const SCRATCH: usize = 27;

/// Kind of each pair.
const PAIRS: Fixed = Fixed {
    base: 2,
    stride: 1,
    rows: 9,
};
/// First row and capacity of each kind.
const SEGMENTS: Fixed = Fixed {
    base: 11,
    stride: 2,
    rows: KINDS,
};
/// First pair, and where they end.
const RANGE: Fixed = Fixed {
    base: 0,
    stride: 2,
    rows: 1,
};
/// Place and stiffness of each pair.
const SPRINGS: Fixed = Fixed {
    base: 3,
    stride: 2,
    rows: 9,
};

/// The tables of the model that the texts read.
pub fn tables<R: Real>() -> Tables<R> {
    let springs = (0..9).flat_map(|i| [0.5 - 0.2 * f64::from(i), 1.0 + 0.3 * f64::from(i)]);
    Tables {
        numbers: [0.0; 3]
            .into_iter()
            .chain(springs)
            .map(R::from_f64)
            .collect(),
        // pair 0 is left out
        indices: vec![1, 9, 2, 0, 1, 0, 1, 0, 0, 2, 1, 0, 3, 3, 1, 4, 0],
    }
}

fn list<C: Cx>(cx: &mut C, kind: C::I) -> C::List {
    let first = cx.index(SEGMENTS, kind, 0, 5);
    let capacity = cx.index(SEGMENTS, kind, 1, 4);
    cx.kept(COUNTS, kind, first, capacity)
}

/// Finds rows: where the pair's place is below one of two inputs. Returns how many of each kind.
#[inline(always)]
pub fn find<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let c = C::F::c;
    times!(cx, kind in KINDS, {
        cx.fill(COUNTS, kind, 0, c(0.0));
    });
    let only = cx.at(0);
    let first = cx.index(RANGE, only, 0, PAIRS.rows);
    let end = cx.index(RANGE, only, 1, PAIRS.rows + 1);
    span!(cx, pair in first, end, {
        let kind = cx.index(PAIRS, pair, 0, KINDS);
        let mut list = list(cx, kind);
        let place = cx.constant(SPRINGS, pair, 0);
        let name = cx.number(pair);
        // at most two rows of a pair
        for side in &x[..2] {
            let distance = place - *side;
            push!(cx, list, distance.lt(c(0.0)), row, {
                cx.init(CONTACTS, row, 0, distance);
                cx.init(CONTACTS, row, 1, name);
            });
        }
    });
    (0..KINDS)
        .map(|kind| {
            let at = cx.at(kind);
            cx.load(COUNTS, at, 0)
        })
        .collect()
}

/// Forces of the rows and their sum, and how many there are.
#[inline(always)]
pub fn solve<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let c = C::F::c;
    let (mut sum, mut count) = (cx.var(c(0.0)), cx.var(c(0.0)));
    let mut largest = cx.var(c(0.0));
    times!(cx, kind in KINDS, {
        let list = list(cx, kind);
        let more = cx.get(&count) + cx.pushed(&list);
        cx.set(&mut count, more);
        each!(cx, row in list, {
            let pair = cx.load(CONTACTS, row, 1);
            let stiffness = cx.pick(SPRINGS, pair, 1);
            let force = -stiffness * cx.load(CONTACTS, row, 0);
            cx.store(CONTACTS, row, 2, force);
            let more = cx.get(&sum) + cx.only(force);
            cx.put(&mut sum, more);
            when!(cx, x[2].lt(force), {
                let more = cx.get(&largest).max(force);
                cx.set(&mut largest, more);
            });
        });
    });
    // the rows are read once more, by another handle
    let kind = cx.at(0);
    let list = list(cx, kind);
    let mut first = cx.var(c(0.0));
    each!(cx, row in list, {
        let more = cx.get(&first).fma(c(0.5), cx.load(CONTACTS, row, 2));
        cx.set(&mut first, more);
    });
    vec![
        cx.get(&sum),
        cx.get(&count),
        cx.get(&largest),
        cx.get(&first),
    ]
}

/// Both texts, one after the other, over the same memory.
#[inline(always)]
pub fn both<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let mut results = find(cx, x);
    results.extend(solve(cx, x));
    results
}

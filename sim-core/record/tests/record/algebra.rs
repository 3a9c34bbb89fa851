//! What the recorder computes by itself: constants, shared values, loads of what was stored.

use crate::{TABLE, accepted, c, evaluated};
use sim_physics::lane::{Cx, Num, Table, Tables};
use sim_physics::{each, push, times};
use sim_record::{Recorded, Recorder};

/// Statements but for the loads of inputs and the stores of outputs.
fn computed(text: impl FnOnce(&mut Recorder, &[Recorded]) -> Vec<Recorded>) -> usize {
    accepted(text).statements().lets
}

#[test]
fn what_algebra_gives_for_free_is_not_computed() {
    let (zero, one) = (c(0.0), c(1.0));
    assert_eq!(
        computed(|_, x| vec![x[0] * zero, x[0] + zero, x[0] * one, -(-x[0])]),
        0
    );
    assert_eq!(
        computed(|_, x| vec![zero * x[0], zero + x[0], one * x[0], x[0] * -one]),
        0
    );
    assert_eq!(
        computed(|_, x| vec![x[0] - x[0], x[0] - zero, zero - x[0], x[0].div(one)]),
        0
    );
    assert_eq!(
        computed(|_, x| vec![x[0].fma(zero, x[1]), c(3.0).fma(c(4.0), c(5.0))]),
        0
    );
    assert_eq!(
        computed(|_, _| vec![c(2.0).sqrt(), c(1.0).div(c(3.0)), c(1.5).round()]),
        0
    );
    assert_eq!(
        computed(|_, x| vec![Num::select(one.lt(zero), x[0], x[1]), x[0].min(x[0])]),
        0
    );
    // the same value, however it is written
    assert_eq!(
        computed(|_, x| vec![x[0] + x[1], x[1] + x[0], x[0] - (-x[1])]),
        1
    );
    assert_eq!(
        computed(|_, x| vec![x[0] * x[1], (-x[1]) * x[0], (-x[0]) * (-x[1])]),
        1
    );
    assert_eq!(
        computed(|_, x| vec![x[0] * c(3.0), c(-3.0) * x[0], (-x[0]) * c(3.0)]),
        1
    );
    assert_eq!(computed(|_, x| vec![x[0].fma(x[1], zero), x[1] * x[0]]), 1);
    assert_eq!(
        computed(|_, x| vec![x[0].fma(one, x[1]), x[0].fnma(-one, x[1])]),
        1
    );
    assert_eq!(
        computed(|_, x| vec![x[0].fnma(x[1], -x[0]), x[1].fma(x[0], x[0])]),
        1
    );
    assert_eq!(computed(|_, x| vec![x[0].div(c(4.0)), x[0] * c(0.25)]), 1);
    assert_eq!(
        computed(|_, x| vec![x[0].abs(), (-x[0]).abs(), x[0].abs().abs()]),
        1
    );
    // nothing depends on it
    assert_eq!(
        computed(|cx, x| {
            let mut unused = cx.var(x[0]);
            times!(cx, 3, {
                let more = cx.get(&unused) * x[1];
                cx.set(&mut unused, more);
            });
            vec![x[0]]
        }),
        0
    );
}

#[test]
fn constants_are_folded_with_the_roundings_of_f32() {
    let (a, b, d) = (0.1f32, 0.3f32, -0.03f32);
    let good = accepted(|_, x| {
        let k = Recorded::k;
        vec![
            k(a) * k(b) + k(d),
            k(a).fma(k(b), k(d)),
            k(a).fma(k(b), x[0]),
            x[0].div(k(b)),
        ]
    });
    let expected = [a * b + d, a.mul_add(b, d), a.mul_add(b, 0.7), 0.7 / b];
    assert_ne!(
        expected[0].to_bits(),
        expected[1].to_bits(),
        "the example distinguishes them"
    );
    assert_eq!(evaluated(&good, [0.7, 0.0]), expected);
}

#[test]
fn what_was_stored_is_not_loaded_again_unless_it_may_have_changed() {
    let good = accepted(|cx, x| {
        let (first, second) = (cx.at(0), cx.at(1));
        cx.store(TABLE, first, 0, x[0]);
        cx.store(TABLE, second, 0, x[1]);
        let known = cx.load(TABLE, first, 0);
        times!(cx, 2, {
            let row = cx.at(0);
            let more = cx.load(TABLE, row, 0) + x[1];
            cx.store(TABLE, row, 0, more);
        });
        vec![known, cx.load(TABLE, first, 0), cx.load(TABLE, second, 0)]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [3.0, 13.0, 5.0]);
    let n = good.statements();
    assert_eq!((n.loads, n.stores, n.loops), (2 + 2, 3 + 3, 1), "{n:?}");
    // another table over the same memory
    let alias = Table {
        base: 0,
        stride: 1,
        rows: 6,
    };
    let good = accepted(|cx, x| {
        let (first, second) = (cx.at(0), cx.at(1));
        cx.store(TABLE, first, 1, x[0]);
        cx.store(alias, second, 0, x[1]);
        vec![cx.load(TABLE, first, 1)]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [5.0]);
}

#[test]
fn rows_that_do_not_fit_are_counted_and_not_stored() {
    let good = accepted(|cx, x| {
        let mut list = cx.list(3);
        for k in 0..5 {
            push!(cx, list, x[0].lt(c(f64::from(k))), row, {
                cx.init(TABLE, row, 0, c(f64::from(k)));
            });
        }
        let mut sum = cx.var(c(0.0));
        each!(cx, row in list, {
            let more = cx.get(&sum) * c(10.0) + cx.load(TABLE, row, 0);
            cx.set(&mut sum, more);
        });
        vec![cx.pushed(&list), cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [-1.0, 0.0]), [5.0, 12.0]);
    assert_eq!(evaluated(&good, [0.5, 0.0]), [4.0, 123.0]);
    assert_eq!(evaluated(&good, [3.5, 0.0]), [1.0, 4.0]);
    assert_eq!(evaluated(&good, [9.0, 0.0]), [0.0, 0.0]);
    let mut scratch = [7.0; 8];
    good.evaluate(&[-1.0, 0.0], &mut scratch, &Tables::default());
    assert_eq!(scratch, [0.0, 7.0, 1.0, 7.0, 2.0, 7.0, 7.0, 7.0]);
}

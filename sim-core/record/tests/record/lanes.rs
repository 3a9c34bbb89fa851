//! Several threads per world: shared loops, sums in a fixed order, and values of other lanes.

use crate::{accepted, c, toy};
use sim_physics::lane::{Cx, Num, Table, Tables};
use sim_physics::{break_if, each, push, span, when};
use sim_record::split::{Limits, Prices, Split, split};
use sim_record::wgsl::{Exchange, ProgramOptions};
use sim_record::{Recorded, Recorder, Recording};

const ROWS: usize = 13;
/// Rows of four scalars.
const TABLE: Table = Table {
    base: 0,
    stride: 4,
    rows: ROWS,
};
/// The length of the list.
const COUNTS: Table = Table {
    base: 4 * ROWS,
    stride: 4,
    rows: 1,
};
const LANES: [usize; 5] = [2, 4, 8, 16, 32];

type List = <Recorder as Cx>::List;

/// A recording with so many lanes, of code over the rows of a list.
fn recorded(
    lanes: usize,
    code: impl FnOnce(&mut Recorder, &List, &[Recorded]) -> Vec<Recorded>,
) -> Recording {
    accepted(|cx, x| {
        cx.set_lanes(lanes);
        let (at, first, capacity) = (cx.at(0), cx.at(0), cx.at(ROWS));
        let list = cx.kept(COUNTS, at, first, capacity);
        code(cx, &list, x)
    })
}

/// It in kernels of at most this cost, which a driver's translator accepts.
fn kernels(recording: &Recording, most: usize) -> Split {
    let limits = Limits {
        kernel: most,
        repeated: usize::MAX,
        repeated_dispatch: 0,
        dispatch: 0,
        prices: Prices::HARDWARE,
    };
    let [_, parts] = [Exchange::Workgroup, Exchange::Subgroup].map(|exchange| {
        let options = ProgramOptions {
            exchange,
            ..ProgramOptions::default()
        };
        let parts = split(recording, &options, limits, 64);
        for kernel in &parts.kernels {
            toy::validated(&kernel.wgsl());
        }
        parts
    });
    parts
}

/// Memory with so many rows in use.
fn memory(rows: usize) -> Vec<f32> {
    let number = |k: usize| ((k * k) as f32).sin() * 1e3;
    let mut memory: Vec<f32> = (0..4 * ROWS + 4).map(number).collect();
    memory[COUNTS.base] = rows as f32;
    memory
}

/// The scalars of a column of the rows in use.
fn column(memory: &[f32], k: usize) -> Vec<f32> {
    let rows = memory[COUNTS.base] as usize;
    memory[k..].iter().step_by(4).take(rows).copied().collect()
}

/// What lanes add up to: each its rows in order, then neighbours, pairs, and so on.
fn sum_of_lanes(x: &[f32], lanes: usize) -> f32 {
    let lane_sum = |lane: usize| {
        let rows = x.iter().skip(lane).step_by(lanes);
        rows.fold(0.0, |sum, x| sum + x)
    };
    let mut sums: Vec<f32> = (0..lanes).map(lane_sum).collect();
    while sums.len() > 1 {
        sums = sums.chunks(2).map(|pair| pair[0] + pair[1]).collect();
    }
    sums[0]
}

fn evaluated(parts: &Split, inputs: [f32; 2], scratch: &mut [f32]) -> Vec<f32> {
    parts.evaluate(&inputs, scratch, &Tables::default())
}

fn texts(parts: &Split) -> String {
    parts.kernels.iter().map(|kernel| kernel.wgsl()).collect()
}

#[test]
fn lanes_add_their_rows_in_a_fixed_order() {
    for lanes in LANES {
        let recording = recorded(lanes, |cx, list, x| {
            let mut sum = cx.var(x[0]);
            each!(cx, r in *list, {
                let value = cx.load(TABLE, r, 0);
                cx.store(TABLE, r, 1, value + value);
                let more = cx.get(&sum) + value;
                cx.set(&mut sum, more);
            });
            vec![cx.get(&sum)]
        });
        let parts = kernels(&recording, 100_000);
        assert!(texts(&parts).contains(&format!("+= {lanes}u")));
        for rows in 0..=ROWS {
            let mut scratch = memory(rows);
            let numbers = column(&scratch, 0);
            let rest = scratch.clone();
            let got = evaluated(&parts, [0.5, 0.0], &mut scratch);
            let sum = match rows {
                0 => 0.5,
                _ => 0.5 + sum_of_lanes(&numbers, lanes),
            };
            assert_eq!(
                got[0].to_bits(),
                sum.to_bits(),
                "{lanes} lanes, {rows} rows"
            );
            for k in 0..4 * ROWS {
                let is_written = k % 4 == 1 && k / 4 < rows;
                let expected = if is_written {
                    2.0 * rest[k - 1]
                } else {
                    rest[k]
                };
                assert_eq!(scratch[k], expected, "{lanes} lanes, scalar {k}");
            }
        }
    }
    // the order matters, so the test can tell
    let numbers = column(&memory(ROWS), 0);
    assert_ne!(sum_of_lanes(&numbers, 8), sum_of_lanes(&numbers, 1));
}

#[test]
fn sums_of_products_and_differences_under_a_mask_are_shared() {
    let code = |cx: &mut Recorder, list: &List, x: &[Recorded]| {
        let (mut a, mut b) = (cx.var(x[0]), cx.var(x[1]));
        each!(cx, r in *list, {
            let (p, q) = (cx.load(TABLE, r, 0), cx.load(TABLE, r, 2));
            let more = p.fma(q, cx.get(&a));
            cx.set(&mut a, more);
            when!(cx, q.lt(p), {
                let less = cx.get(&b) - p;
                cx.set(&mut b, less);
            });
        });
        vec![cx.get(&a), cx.get(&b)]
    };
    // whole numbers: any order gives the same bits
    let mut scratch: Vec<f32> = (0..4 * ROWS + 4).map(|k| (k * 7 % 11) as f32).collect();
    scratch[COUNTS.base] = 11.0;
    let alone = kernels(&recorded(1, code), 100_000);
    let expected = evaluated(&alone, [3.0, -2.0], &mut scratch.clone());
    for lanes in LANES {
        let parts = kernels(&recorded(lanes, code), 100_000);
        assert!(texts(&parts).contains(&format!("+= {lanes}u")));
        assert_eq!(
            evaluated(&parts, [3.0, -2.0], &mut scratch.clone()),
            expected
        );
    }
}

#[test]
fn rows_whose_column_an_index_names_are_shared() {
    let code = |cx: &mut Recorder, list: &List, x: &[Recorded]| {
        // what gives a kernel its lanes
        let mut sum = cx.var(x[1]);
        each!(cx, r in *list, {
            let more = cx.get(&sum) + cx.load(TABLE, r, 0);
            cx.set(&mut sum, more);
        });
        let (first, end, columns) = (cx.at(0), cx.at(ROWS), cx.at(3));
        span!(cx, k in first, columns, {
            let column = cx.number(k);
            span!(cx, r in first, end, {
                let entry = cx.load_at(TABLE, r, 0, column);
                let sum = cx.load(TABLE, r, 3) * x[0] + entry;
                cx.store(TABLE, r, 3, sum);
            });
        });
        vec![cx.get(&sum)]
    };
    let (mut expected, alone) = (memory(0), kernels(&recorded(1, code), 100_000));
    evaluated(&alone, [0.5, 0.0], &mut expected);
    assert_ne!(expected, memory(0));
    for lanes in LANES {
        let parts = kernels(&recorded(lanes, code), 100_000);
        assert_eq!(texts(&parts).matches(&format!("+= {lanes}u")).count(), 2);
        let mut got = memory(0);
        evaluated(&parts, [0.5, 0.0], &mut got);
        assert_eq!(got, expected);
    }
}

#[test]
fn rows_that_read_the_one_behind_all_of_them_are_shared() {
    let code = |cx: &mut Recorder, list: &List, x: &[Recorded]| {
        // what gives a kernel its lanes
        let mut sum = cx.var(x[1]);
        each!(cx, r in *list, {
            let more = cx.get(&sum) + cx.load(TABLE, r, 0);
            cx.set(&mut sum, more);
        });
        let (first, end) = (cx.at(0), cx.at(ROWS));
        span!(cx, k in first, end, {
            span!(cx, r in first, k, {
                let entry = cx.load(TABLE, k, 0) * x[0] + cx.load(TABLE, k, 2);
                let sum = cx.load(TABLE, r, 1) + entry;
                cx.store(TABLE, r, 1, sum);
            });
        });
        vec![cx.get(&sum)]
    };
    let shared = |parts: &Split| texts(parts).matches("+= 8u").count();
    let (mut expected, alone) = (memory(ROWS), kernels(&recorded(1, code), 100_000));
    evaluated(&alone, [0.5, 0.0], &mut expected);
    let parts = kernels(&recorded(8, code), 100_000);
    let mut got = memory(ROWS);
    evaluated(&parts, [0.5, 0.0], &mut got);
    assert_eq!(got, expected);
    assert_eq!(shared(&parts), 2);
}

/// Asserts that no loop of it is shared, and that it gives the bits of one lane.
#[track_caller]
fn assert_alone(code: fn(&mut Recorder, &List, &[Recorded]) -> Vec<Recorded>) {
    let alone = kernels(&recorded(1, code), 100_000);
    let parts = kernels(&recorded(8, code), 100_000);
    assert!(!texts(&parts).contains("+= 8u"), "{}", texts(&parts));
    let (mut a, mut b) = (memory(ROWS), memory(ROWS));
    let expected = evaluated(&alone, [0.5, 2.0], &mut a);
    assert_eq!(evaluated(&parts, [0.5, 2.0], &mut b), expected);
    assert_eq!(a, b);
}

#[test]
fn an_iteration_that_needs_the_one_before_is_not_shared() {
    assert_alone(|cx, list, x| {
        let mut last = cx.var(x[0]);
        each!(cx, r in *list, {
            let more = cx.get(&last) * c(0.5) + cx.load(TABLE, r, 0);
            cx.set(&mut last, more);
        });
        vec![cx.get(&last)]
    });
    // what is added depends on the sum so far
    assert_alone(|cx, list, x| {
        let mut sum = cx.var(x[0]);
        each!(cx, r in *list, {
            let value = cx.load(TABLE, r, 0);
            let smaller = value.min(cx.get(&sum));
            let more = cx.get(&sum) + smaller;
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    // each iteration reads the row that the first one wrote
    assert_alone(|cx, list, x| {
        let mut sum = cx.var(x[0]);
        let first = cx.at(0);
        each!(cx, r in *list, {
            let value = cx.load(TABLE, first, 1);
            cx.store(TABLE, r, 1, value + x[1]);
            let more = cx.get(&sum) + value;
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
}

#[test]
fn a_loop_that_is_left_or_that_pushes_is_not_shared() {
    assert_alone(|cx, list, x| {
        let mut sum = cx.var(x[0]);
        each!(cx, r in *list, {
            let value = cx.load(TABLE, r, 0);
            break_if!(cx, c(500.0).lt(value));
            let more = cx.get(&sum) + value;
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_alone(|cx, list, _| {
        let mut positive = cx.list(4);
        each!(cx, r in *list, {
            let value = cx.load(TABLE, r, 0);
            push!(cx, positive, c(0.0).lt(value), row, {
                let _ = row;
            });
        });
        vec![cx.pushed(&positive)]
    });
}

/// A column of each lane, by the columns of the row that its number stands for, and what the lanes say of it.
fn exchanged(lanes: usize) -> Recording {
    recorded(lanes, move |cx, list, x| {
        let product = x[0] * x[1];
        let numbers: Vec<Recorded> = (0..lanes.min(4)).map(|k| c(k as f64)).collect();
        let lane_value = cx.own(&numbers);
        let mut sum = cx.var(lane_value * x[0]);
        each!(cx, r in *list, {
            let more = cx.get(&sum) + cx.load_at(TABLE, r, 0, lane_value);
            cx.set(&mut sum, more);
        });
        let sum = cx.get(&sum);
        let mut results: Vec<Recorded> = (0..lanes.min(4)).map(|k| cx.of_lane(sum, k)).collect();
        results.push(cx.max_lanes(lane_value) + cx.sum_lanes(lane_value));
        results.push(product);
        results
    })
}

#[test]
fn lanes_have_values_of_their_own_and_read_those_of_others() {
    for lanes in LANES {
        for most in [1, 40, 100_000] {
            let parts = kernels(&exchanged(lanes), most);
            let mut scratch = memory(ROWS);
            let got = evaluated(&parts, [0.25, 3.0], &mut scratch);
            let columns = lanes.min(4);
            assert_eq!(got.len(), columns + 2);
            for (k, got) in got[..columns].iter().enumerate() {
                let sum = column(&scratch, k)
                    .iter()
                    .fold(k as f32 * 0.25, |a, b| a + b);
                assert_eq!(*got, sum, "column {k} of {lanes} lanes");
            }
            let last = (columns - 1) as f32;
            let both = last + 0.5 * last * (last + 1.0);
            assert_eq!(got[columns..], [both, 0.75]);
        }
    }
}

#[test]
fn what_differs_between_lanes_stays_inside_a_kernel() {
    let whole = kernels(&exchanged(8), 100_000);
    let cut = kernels(&exchanged(8), 1);
    assert!(cut.kernels.len() > 1 && whole.kernels.len() == 1);
    let wide = |parts: &Split| {
        let kernels = parts.kernels.iter();
        kernels.filter(|k| k.recording().lanes() > 1).count()
    };
    // the loop with what reads its sums; then what needs no more than the lanes' numbers, which are chosen again
    assert_eq!((wide(&whole), wide(&cut)), (1, 2));
}

/// Statements that need one another.
fn chain(mut y: Recorded, x: Recorded) -> Recorded {
    for k in 0..60 {
        y = y.fma(x, c(0.01 * k as f64));
    }
    y
}

#[test]
fn what_a_lane_chose_is_chosen_again_behind_a_cut() {
    for lanes in LANES {
        let recording = recorded(lanes, |cx, _, x| {
            let values: Vec<Recorded> = (0..lanes).map(|k| x[k % 2] * c(k as f64 + 1.0)).collect();
            let own = cx.own(&values);
            let before = cx.sum_lanes(own);
            let between = chain(before, x[1]);
            let after = cx.max_lanes(own * between);
            vec![before, between, after]
        });
        let whole = kernels(&recording, 100_000);
        let cut = kernels(&recording, 60);
        assert!(cut.kernels.len() > 1, "{lanes} lanes");
        let given = [0.3, 0.9];
        let expected = evaluated(&whole, given, &mut memory(0));
        assert_eq!(evaluated(&cut, given, &mut memory(0)), expected);
    }
}

#[test]
fn a_block_that_uses_what_lanes_computed_is_not_cut_inside() {
    let code = |cx: &mut Recorder, _: &List, x: &[Recorded]| {
        let own = cx.own(&[x[0], x[1]]);
        // another number in each lane, which cannot be chosen again
        let mut squares = own * own;
        for _ in 0..20 {
            squares = squares.fma(own, own);
        }
        let mut sum = cx.var(x[0]);
        when!(cx, x[0].lt(x[1]), {
            let first = cx.sum_lanes(squares);
            let second = chain(first, x[1]);
            let third = cx.max_lanes(squares * second);
            cx.set(&mut sum, chain(third, x[0]));
        });
        vec![cx.get(&sum)]
    };
    let recording = recorded(4, code);
    let whole = kernels(&recording, 100_000);
    for given in [[0.3, 0.9], [0.9, 0.3]] {
        let expected = evaluated(&whole, given, &mut memory(0));
        // where the block alone is too large, and where nothing fits
        for most in [100, 20] {
            let cut = kernels(&recording, most);
            assert_eq!(evaluated(&cut, given, &mut memory(0)), expected, "{most}");
        }
    }
}

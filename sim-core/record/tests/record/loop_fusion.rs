//! Loops that become one, and variables that stay with a kernel: the same bits.

use crate::{accepted, c, toy};
use sim_physics::lane::{Cx, Fixed, Num, Table, Tables};
use sim_physics::{each, times, when};
use sim_record::split::{Limits, Prices, split};
use sim_record::wgsl::{ProgramOptions, wgsl};
use sim_record::{Recorded, Recorder, Recording, record};

/// Rows of three lists, then how many each has.
const ROWS: Table = Table {
    base: 0,
    stride: 2,
    rows: 9,
};
const COUNTS: Table = Table {
    base: 20,
    stride: 1,
    rows: 3,
};
const NUMBERS: usize = 23;
/// First row and room of each list.
const ROOMS: Fixed = Fixed {
    base: 1,
    stride: 2,
    rows: 3,
};

/// A list with three rows, or with those of its room.
fn list(cx: &mut Recorder, k: usize, is_read: bool) -> <Recorder as Cx>::List {
    let at = cx.at(k);
    let (first, capacity) = match is_read {
        true => (cx.index(ROOMS, at, 0, 7), cx.index(ROOMS, at, 1, 4)),
        false => (cx.at(3 * k), cx.at(3)),
    };
    cx.kept(COUNTS, at, first, capacity)
}

/// Goes over three lists; `constant` is what the body of each list adds.
fn over_lists(is_read: bool, constant: impl Fn(usize) -> f64) -> Recording {
    accepted(|cx, x| {
        let mut sum = cx.var(x[0]);
        for k in 0..3 {
            let rows = list(cx, k, is_read);
            each!(cx, r in rows, {
                let (a, b) = (cx.load(ROWS, r, 0), cx.load(ROWS, r, 1));
                cx.fill(ROWS, r, 1, a * b + x[1]);
                // no sum of three that is rounded alike in any order
                let more = (cx.get(&sum) * c(1.1) + a).sqrt() + c(constant(k));
                cx.set(&mut sum, more);
            });
        }
        vec![cx.get(&sum)]
    })
}

fn loops(recording: &Recording) -> usize {
    let text = wgsl(recording, &ProgramOptions::default());
    toy::validated(&text);
    text.matches("for (").count()
}

fn check_joined(is_read: bool, rooms: [[u32; 2]; 3]) {
    let joined = over_lists(is_read, |_| 0.5);
    let apart = over_lists(is_read, |k| 0.5 + k as f64);
    assert_eq!((loops(&joined), loops(&apart)), (1, 3));
    let indices: Vec<u32> = [9].into_iter().chain(rooms.into_iter().flatten()).collect();
    let tables = Tables {
        numbers: Vec::new(),
        indices,
    };
    let memory = |counts: [f32; 3]| -> Vec<f32> {
        let mut numbers: Vec<f32> = (0..NUMBERS).map(|i| 0.3 + i as f32).collect();
        numbers[COUNTS.base..].copy_from_slice(&counts);
        numbers
    };
    for counts in [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 3.0],
        [0.0, 1.0, 0.0],
        [3.0, 3.0, 3.0],
        [9.0, 1.0, 2.0],
    ] {
        // by hand, in the order of the code
        let mut expected = memory(counts);
        let mut sum = 0.7f32;
        for ([first, room], count) in rooms.into_iter().zip(counts) {
            for r in first as usize..first as usize + count.min(room as f32) as usize {
                let (a, b) = (expected[2 * r], expected[2 * r + 1]);
                expected[2 * r + 1] = a * b + 0.2;
                sum = (sum * 1.1 + a).sqrt() + 0.5;
            }
        }
        let mut got = memory(counts);
        let result = joined.evaluate(&[0.7, 0.2], &mut got, &tables);
        assert_eq!(result[0].to_bits(), sum.to_bits(), "{counts:?}");
        assert_eq!(got, expected, "{counts:?}");
    }
}

#[test]
fn loops_of_one_body_over_several_lists_are_one_loop() {
    check_joined(false, [[0, 3], [3, 3], [6, 3]]);
}

#[test]
fn loops_over_rooms_that_are_read_are_one_loop_too() {
    check_joined(true, [[0, 3], [3, 3], [6, 3]]);
    check_joined(true, [[0, 1], [1, 0], [1, 2]]);
}

#[test]
fn what_is_read_between_loops_that_write_it_keeps_them_apart() {
    let recording = |reads: usize| {
        accepted(move |cx, x| {
            let mut sum = cx.var(x[0]);
            for k in 0..3 {
                let rows = list(cx, k, false);
                each!(cx, r in rows, {
                    let a = cx.load(ROWS, r, 0);
                    cx.fill(ROWS, r, 1, a + x[1]);
                });
                // a column that is found at run time, of a row that the first loop writes
                if k < reads {
                    let row = cx.at(2);
                    let seen = cx.load_at(ROWS, row, 0, x[1]);
                    let more = cx.get(&sum) + seen;
                    cx.set(&mut sum, more);
                }
            }
            vec![cx.get(&sum)]
        })
    };
    assert_eq!(loops(&recording(0)), 1);
    let read = recording(1);
    assert_eq!(loops(&read), 2);
    let mut memory: Vec<f32> = (0..NUMBERS).map(|i| 0.5 * i as f32).collect();
    memory[COUNTS.base..].fill(3.0);
    // row 2 has 2 in column 0, so the loop writes 3 into column 1
    let got = read.evaluate(&[0.25, 1.0], &mut memory, &Tables::default());
    assert_eq!(got, [3.25]);
}

/// Rounds in which a variable is set and read under one mask, and added to in between.
fn masked(reads_always: bool) -> Recording {
    let text = |cx: &mut Recorder, x: &[Recorded]| {
        let mut variable = cx.var(x[0]);
        let mut sum = cx.var(x[1]);
        let rows = list(cx, 0, false);
        times!(cx, round in 4, {
            let at = cx.number(round);
            let mask = at.lt(x[2]);
            when!(cx, mask, { cx.set(&mut variable, at) });
            each!(cx, r in rows, {
                let more = cx.get(&variable) + cx.load(ROWS, r, 0);
                cx.set(&mut variable, more);
            });
            let read = |cx: &mut Recorder, sum: &mut _| {
                let more: Recorded = cx.get(&variable) * c(0.5) + cx.get(sum);
                cx.set(sum, more);
            };
            if reads_always {
                read(cx, &mut sum);
            } else {
                when!(cx, mask, { read(cx, &mut sum) });
            }
        });
        vec![cx.get(&sum)]
    };
    record(3, text).expect("a correct text is recorded")
}

#[test]
fn a_variable_that_is_read_only_where_it_was_set_does_not_cross_iterations() {
    let options = ProgramOptions::default();
    let limits = Limits {
        kernel: 10_000,
        repeated: 1,
        repeated_dispatch: 0,
        dispatch: 0,
        prices: Prices::SOFTWARE,
    };
    let mut read = Vec::new();
    for reads_always in [false, true] {
        let recording = masked(reads_always);
        let parts = split(&recording, &options, limits, 4);
        let inputs = parts
            .kernels
            .iter()
            .flat_map(|kernel| &kernel.options().inputs);
        read.push(inputs.map(Vec::len).sum::<usize>());
        for masked in [0.0, 1.0, 2.0, 5.0] {
            let mut memory: Vec<f32> = (0..NUMBERS).map(|i| 0.3 + i as f32).collect();
            memory[COUNTS.base] = 2.0;
            let inputs = [0.1, 0.2, masked];
            let expected = recording.evaluate(&inputs, &mut memory.clone(), &Tables::default());
            let got = parts.evaluate(&inputs, &mut memory, &Tables::default());
            assert_eq!(
                got[0].to_bits(),
                expected[0].to_bits(),
                "{reads_always}, {masked}"
            );
        }
    }
    assert!(read[0] < read[1], "{read:?}");
}

#[test]
fn equal_texts_are_equal_kernels_and_those_of_a_loop_find_their_worlds_in_a_list() {
    let cut = || {
        let limits = Limits {
            kernel: 300,
            repeated: 1,
            repeated_dispatch: 0,
            dispatch: 0,
            prices: Prices::SOFTWARE,
        };
        let parts = split(&masked(true), &ProgramOptions::default(), limits, 4);
        let texts: Vec<String> = parts.kernels.iter().map(|kernel| kernel.wgsl()).collect();
        texts
    };
    let first = cut();
    first.iter().for_each(|text| {
        toy::validated(text);
    });
    assert!(
        first
            .iter()
            .any(|text| text.contains("let world = list[thread.x];"))
    );
    for _ in 0..5 {
        assert_eq!(cut(), first);
    }
}

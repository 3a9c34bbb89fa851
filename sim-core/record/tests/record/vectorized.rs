//! Memory four numbers at a time: what shares an access, what must not, and the same bits.

use crate::{accepted, c, evaluated, toy};
use sim_physics::lane::{Cx, Num, Table};
use sim_physics::{times, when};
use sim_record::Recording;
use sim_record::wgsl::{ProgramOptions, wgsl};

/// Rows of a vector and a half, so to speak: the last two numbers of a row are nobody's.
const ROWS: Table = Table {
    base: 0,
    stride: 8,
    rows: 2,
};
const FOURS: Table = Table {
    base: 0,
    stride: 4,
    rows: 4,
};
/// The rows after those of `FOURS`.
const FOLLOWING: Table = Table {
    base: 4,
    stride: 4,
    rows: 3,
};

fn counts(recording: &Recording) -> (usize, usize) {
    let statements = recording.vectorized().statements();
    (statements.loads, statements.stores)
}

#[test]
fn random_programs_give_the_same_bits_vectorized() {
    let (mut plain, mut vectorized) = (0, 0);
    for seed in 0..400 {
        let mut random = toy::Random(seed);
        let steps = toy::program(&mut random, 3, 4, 12);
        let recording = toy::recorded(&steps);
        let fours = recording.vectorized();
        let accesses = |r: &Recording| r.statements().loads + r.statements().stores;
        plain += accesses(&recording);
        vectorized += accesses(&fours);
        for world in toy::worlds::<{ toy::INPUTS }>(&mut random, 12) {
            let (mut a, mut b) = ([0.5; toy::SCRATCH], [0.5; toy::SCRATCH]);
            let expected = recording.evaluate(&world, &mut a, &toy::tables());
            let got = fours.evaluate(&world, &mut b, &toy::tables());
            let bits = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&got), bits(&expected), "seed {seed}: {steps:#?}");
            assert_eq!(bits(&a), bits(&b), "seed {seed}: memory: {steps:#?}");
        }
    }
    assert!(
        4 * vectorized < 3 * plain,
        "{vectorized} accesses of {plain}"
    );
}

#[test]
fn a_row_is_read_and_written_in_vectors() {
    let copied = accepted(|cx, _| {
        times!(cx, row in 2, {
            for k in 0..6 {
                let x = cx.load(ROWS, row, k) * c(2.0);
                cx.store(ROWS, row, k, x);
            }
        });
        vec![]
    });
    // the numbers of the second vector that are not written are known, since it was read
    assert_eq!(counts(&copied), (2, 2));
}

#[test]
fn three_numbers_are_written_with_the_fourth_and_two_alone() {
    for (numbers, expected) in [(1, (0, 1)), (2, (0, 2)), (3, (1, 1)), (4, (0, 1))] {
        let stored = accepted(|cx, x| {
            times!(cx, row in 2, {
                for k in 0..numbers {
                    cx.store(ROWS, row, k, x[0] + c(k as f64));
                }
            });
            vec![]
        });
        let (loads, stores) = counts(&stored);
        // the input is a load
        assert_eq!((loads - 1, stores), expected, "{numbers}");
        let mut memory = [7.0; 16];
        stored
            .vectorized()
            .evaluate(&[1.0, 0.0], &mut memory, &Default::default());
        assert_eq!(memory[numbers..8], [7.0; 8][numbers..], "{numbers}");
    }
}

#[test]
fn a_store_through_a_view_one_row_on_is_seen() {
    let shifted = accepted(|cx, _| {
        let mut sum = cx.var(c(0.0));
        times!(cx, row in 3, {
            let before = cx.load(FOURS, row, 0);
            cx.store(FOLLOWING, row, 0, before + c(1.0));
            let after = cx.load(FOURS, row, 1);
            let more = cx.get(&sum) + before + after;
            cx.set(&mut sum, more);
        });
        let first = cx.at(3);
        vec![cx.get(&sum), cx.load(FOURS, first, 0)]
    });
    // both numbers of a row are in one vector, which the store to the next row leaves alone
    assert_eq!(shifted.vectorized().statements().loads, 2);
    let mut memory: [f32; 16] = std::array::from_fn(|i| i as f32);
    let got = shifted
        .vectorized()
        .evaluate(&[0.0; 2], &mut memory, &Default::default());
    assert_eq!(got, [0.0 + 1.0 + 1.0 + 5.0 + 2.0 + 9.0, 3.0]);
}

#[test]
fn a_row_at_hand_is_read_again_after_a_store_to_any_row() {
    let stored = accepted(|cx, x| {
        let first = cx.at(0);
        let before = cx.load(FOURS, first, 0);
        times!(cx, row in 4, {
            cx.store(FOURS, row, 0, x[0]);
        });
        let after = cx.load(FOURS, first, 1) + cx.load(FOURS, first, 0);
        // what is inside a block is not known after it
        when!(cx, x[0].lt(c(0.0)), {
            cx.store(FOURS, first, 2, c(1.0));
        });
        vec![before, after, cx.load(FOURS, first, 2)]
    });
    let vectorized = stored.vectorized();
    assert_eq!(vectorized.statements().loads, 1 + 3);
    for x in [-3.0, 3.0] {
        assert_eq!(
            evaluated(&vectorized, [x, 0.0]),
            evaluated(&stored, [x, 0.0]),
            "{x}"
        );
    }
}

#[test]
fn inputs_and_outputs_of_a_vector_share_an_access() {
    let swapped = accepted(|_, x| vec![x[1], x[0], x[0] + x[1]]);
    let fields = |inputs: Vec<u32>, outputs: Vec<u32>| {
        let options = ProgramOptions {
            inputs: Some(inputs),
            outputs: Some(outputs),
            ..ProgramOptions::default()
        };
        let program = wgsl(&swapped, &options);
        toy::validated(&program);
        program.matches("fields[").count()
    };
    // one vector in and out; its last number is written as it was read
    assert_eq!(fields(vec![4, 5], vec![4, 5, 6]), 2);
    // the first two outputs are the inputs of those fields, and stay
    assert_eq!(fields(vec![4, 5], vec![5, 4, 6]), 2);
    // the 32nd vector is not called f32
    assert_eq!(fields(vec![128, 129], vec![128, 129, 130]), 2);
    // two vectors
    assert_eq!(fields(vec![3, 4], vec![3, 4, 5]), 2 + 1 + 2);
}

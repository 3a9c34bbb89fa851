//! Recordings in several kernels: the same bits, however short the kernels.

use crate::{accepted, c, toy};
use sim_physics::lane::{Cx, Num, Tables};
use sim_physics::{break_if, times, when};
use sim_record::Recording;
use sim_record::split::{Limits, Part, Prices, split};
use sim_record::wgsl::ProgramOptions;

/// Longer than any recording here.
const WHOLE: usize = 1_000_000;

fn bits(x: &[f32]) -> Vec<u32> {
    x.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn random_programs_give_the_same_bits_in_kernels_of_any_length() {
    let (mut kernels, mut repeats) = (0, 0);
    for seed in 0..150 {
        let mut random = toy::Random(seed);
        let steps = toy::program(&mut random, 3, 4, 12);
        let recording = toy::recorded(&steps);
        let worlds = toy::worlds::<{ toy::INPUTS }>(&mut random, 8);
        for most in [1, 60, 250, WHOLE] {
            let parts = toy::in_kernels(&recording, most);
            if most == 1 {
                kernels += parts.kernels.len();
            }
            let is_repeat = |part: &&Part| matches!(part, Part::Repeat { .. });
            repeats += parts.order.iter().filter(is_repeat).count();
            for world in &worlds {
                let (mut a, mut b) = ([0.5; toy::SCRATCH], [0.5; toy::SCRATCH]);
                let expected = recording.evaluate(world, &mut a, &toy::tables());
                let got = parts.evaluate(world, &mut b, &toy::tables());
                let what = || format!("seed {seed}, at most {most}: {world:?}, {steps:#?}");
                assert_eq!(bits(&got), bits(&expected), "{}", what());
                assert_eq!(bits(&a), bits(&b), "memory: {}", what());
            }
        }
    }
    assert!(kernels > 5_000 && repeats > 250, "{kernels}, {repeats}");
}

#[test]
fn a_text_that_is_short_is_one_kernel() {
    let short = accepted(|_, x| vec![x[0] + x[1], x[0]]);
    let parts = toy::in_kernels(&short, WHOLE);
    assert_eq!(parts.order, [Part::Kernel(0)]);
    assert_eq!((parts.kernels.len(), parts.spare), (1, 0));
}

/// Newton's method on x² = a, with a search inside that halves a step.
fn search() -> Recording {
    accepted(|cx, x| {
        let mut root = cx.var(x[0]);
        let mut rounds = cx.var(c(0.0));
        times!(cx, 20, {
            let at = cx.get(&root);
            let error = at.fma(at, -x[1]);
            let mut step = cx.var(error.div(at + at));
            times!(cx, half in 10, {
                let tried = at - cx.get(&step);
                let better = tried.fma(tried, -x[1]).abs().lt(error.abs());
                break_if!(cx, better);
                let shorter = cx.get(&step) * c(0.5) + cx.number(half) * c(1e-6);
                cx.set(&mut step, shorter);
            });
            when!(cx, c(1e-6).lt(error.abs()), {
                let next = at - cx.get(&step);
                cx.set(&mut root, next);
            });
            break_if!(cx, error.abs().lt(c(1e-6)));
            let more = cx.get(&rounds) + c(1.0);
            cx.set(&mut rounds, more);
        });
        vec![cx.get(&root), cx.get(&rounds)]
    })
}

#[test]
fn loops_that_are_cut_inside_are_repeated_and_left_by_each_world() {
    let recording = search();
    let parts = toy::in_kernels(&recording, 1);
    fn depth(parts: &[Part]) -> usize {
        let depth_of = |part: &Part| match part {
            Part::Kernel(_) => 0,
            // blocks that are cut run once
            Part::Repeat {
                iterations, parts, ..
            } => usize::from(*iterations > 1) + depth(parts),
        };
        parts.iter().map(depth_of).max().unwrap_or(0)
    }
    assert_eq!(depth(&parts.order), 2, "{:?}", parts.order);
    for a in [0.25f32, 1.0, 2.0, 49.0] {
        let expected = recording.evaluate(&[1.0, a], &mut [], &Tables::default());
        let got = parts.evaluate(&[1.0, a], &mut [], &Tables::default());
        assert_eq!(bits(&got), bits(&expected));
        assert!(
            (got[0] * got[0] - a).abs() < 1e-5 * a.max(1.0),
            "{got:?} of {a}"
        );
    }
}

#[test]
fn outputs_in_the_fields_of_inputs_are_written_when_those_are_read() {
    let swapped = accepted(|_, x| {
        let sum = x[0] + x[1];
        let product = sum * x[0];
        vec![product, sum, x[0]]
    });
    let options = ProgramOptions {
        inputs: Some(vec![0, 1]),
        outputs: Some(vec![1, 0, 2]),
        ..ProgramOptions::default()
    };
    for most in [1, WHOLE] {
        let parts = split(
            &swapped,
            &options,
            Limits {
                kernel: most,
                repeated: most,
                repeated_dispatch: 0,
                dispatch: 0,
                prices: Prices::SOFTWARE,
            },
            4,
        );
        let got = parts.evaluate(&[2.0, 3.0], &mut [], &Tables::default());
        assert_eq!(got, [10.0, 5.0, 2.0], "at most {most}");
    }
}

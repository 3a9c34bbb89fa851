//! Programs of machine code beside the interpreter of recordings: every bit, in every lane.

mod beside;
mod listing;
mod random_code;

use beside::{Line, addresses, assert_same, compiled, outputs, tables, targets};
use random_code::{INPUTS, Random, code, run};
use sim_compile::{Address, Places, Program, Target};
use sim_physics::lane::{Cx, Fixed, Num, Table};
use sim_physics::{times, when};
use sim_record::{Recorded, Recorder, Recording, record};

#[test]
fn random_programs_have_the_bits_of_the_interpreter() {
    let (mut loops, mut spills) = (0, 0);
    for seed in 0..2000 {
        let mut random = Random::seeded(seed);
        let steps = code(&mut random, 2, 3, 14);
        let recording = record(INPUTS, |cx, inputs| run(cx, &steps, inputs)).expect("it is right");
        loops += recording.statements().loops;
        spills += assert_same(&recording, &mut random, &format!("seed {seed}"));
    }
    // the programs are of the kind that they are meant to be
    assert!(loops > 500, "{loops} loops");
    assert!(
        spills > 500 || targets().is_empty(),
        "{spills} values left the registers"
    );
}

#[test]
fn more_values_than_registers_come_back() {
    // every sum needs all products, which were made before
    let recording = record(INPUTS, |_, x| {
        let products: Vec<Recorded> = (0..90)
            .map(|k| x[k % INPUTS] * x[(k / 3) % INPUTS] + Num::c(f64::from(k as u32)))
            .collect();
        let sum = |skip: usize| {
            let rest = products.iter().enumerate().filter(|(k, _)| k % 7 != skip);
            rest.fold(x[0], |sum, (_, product)| sum.fma(Num::c(0.5), *product))
        };
        (0..7).map(sum).collect()
    });
    let spills = assert_same(
        &recording.unwrap(),
        &mut Random::seeded(1),
        "sums of products",
    );
    assert!(spills > 50 || targets().is_empty(), "{spills}");
}

#[test]
fn values_from_before_a_loop_are_there_in_every_iteration() {
    let recording = record(INPUTS, |cx, x| {
        let before: Vec<Recorded> = (0..40)
            .map(|k| x[k % INPUTS].fma(x[0], Num::c(k as f64)))
            .collect();
        let mut sum = cx.var(x[0]);
        let mut last = cx.var(x[1]);
        times!(cx, 3, {
            times!(cx, 2, {
                for value in &before {
                    let more = cx.get(&sum).fma(Num::c(0.25), *value);
                    cx.set(&mut sum, more);
                }
            });
            when!(cx, x[2].lt(x[3]), {
                let less = cx.get(&last) - before[39];
                cx.set(&mut last, less);
            });
        });
        vec![cx.get(&sum), cx.get(&last), before[0], before[39]]
    });
    assert_same(&recording.unwrap(), &mut Random::seeded(2), "two loops");
}

#[test]
fn scratch_memory_keeps_what_was_written_where_the_world_was_active() {
    let table = Table {
        base: 3,
        stride: 4,
        rows: 5,
    };
    let recording = record(INPUTS, |cx, x| {
        let [first, last] = [cx.at(0), cx.at(4)];
        cx.fill(table, last, 3, x[0]);
        cx.store(table, first, 1, x[1]);
        let before = cx.load(table, first, 2);
        when!(cx, x[2].lt(x[3]), {
            cx.store(table, last, 3, x[4]);
            cx.store(table, first, 2, x[5] * x[0]);
            when!(cx, x[1].lt(x[0]), {
                let more = cx.load(table, first, 2) + x[3];
                cx.store(table, first, 2, more);
            });
        });
        vec![
            cx.load(table, last, 3),
            cx.load(table, first, 1),
            cx.load(table, first, 2),
            before,
        ]
    });
    let recording = recording.unwrap();
    for seed in 0..20 {
        assert_same(&recording, &mut Random::seeded(seed), "a table");
    }
}

#[test]
fn outputs_may_change_places_with_the_inputs() {
    let recording = record(3, |_, x| vec![x[1], x[0], x[2] + x[0]]).unwrap();
    for (target, width) in targets() {
        let addresses: Vec<Address> = (0..3).map(|at| Address { array: 0, at }).collect();
        let places = Places {
            inputs: &addresses,
            outputs: &addresses,
            memory: None,
        };
        let program = Program::new(&recording, &places, &tables(), target).unwrap();
        let mut array = [Line([0.0; 16]); 3];
        let numbers = array.numbers_mut();
        for (k, x) in numbers.iter_mut().enumerate() {
            *x = k as f32;
        }
        let before = *numbers;
        let mut scratch = vec![Line([0.0; 16]); program.scratch() + 1];
        // SAFETY: the array has the three registers of the inputs, which are the outputs.
        let done =
            unsafe { program.run(&[array.as_mut_ptr().cast()], scratch.as_mut_ptr().cast()) };
        let after = *array.numbers_mut();
        assert!(done);
        for lane in 0..width {
            assert_eq!(after[lane], before[width + lane]);
            assert_eq!(after[width + lane], before[lane]);
            assert_eq!(
                after[2 * width + lane],
                before[2 * width + lane] + before[lane]
            );
        }
    }
}

/// Numbers of some lines, one after another.
trait Numbers {
    fn numbers_mut(&mut self) -> &mut [f32; 48];
}

impl Numbers for [Line; 3] {
    fn numbers_mut(&mut self) -> &mut [f32; 48] {
        let numbers = self.as_mut_ptr().cast::<[f32; 48]>();
        // SAFETY: lines are 16 numbers without gaps.
        unsafe { &mut *numbers }
    }
}

#[test]
fn a_program_refuses_worlds_in_which_what_it_assumes_to_hold_nowhere_holds() {
    let text = |cx: &mut Recorder, x: &[Recorded]| {
        let rare = x[0].lt(Num::c(0.0));
        match cx.anywhere(rare) {
            true => vec![Num::select(rare, x[1], x[2])],
            false => vec![x[2]],
        }
    };
    let assuming = record(3, |cx, x| {
        cx.assume_nowhere();
        text(cx, x)
    });
    let (assuming, full) = (assuming.unwrap(), record(3, text).unwrap());
    assert!(assuming.assumed().is_some() && full.assumed().is_none());
    for (target, width) in targets() {
        let program = compiled(&assuming, target).unwrap();
        let mut worlds = vec![vec![1.0, 2.0, 3.0]; width];
        let results = outputs(&program, &assuming, width, &worlds);
        assert_eq!(results, Some(vec![vec![3.0]; width]));
        // in one world alone
        worlds[width - 1][0] = -1.0;
        assert_eq!(outputs(&program, &assuming, width, &worlds), None);
    }
}

#[test]
fn an_assumption_may_be_of_what_does_not_hold_or_known_to_be_wrong() {
    let of_a_mask = |is_known: bool| {
        let recording = record(1, |cx, x| {
            cx.assume_nowhere();
            let zero: Recorded = Num::c(0.0);
            let is_positive = zero.lt(if is_known { Num::c(-1.0) } else { x[0] });
            assert!(!cx.anywhere(!is_positive), "it is assumed");
            vec![x[0] + Num::c(1.0)]
        });
        recording.unwrap()
    };
    for (target, width) in targets() {
        let (open, known) = (of_a_mask(false), of_a_mask(true));
        let mut worlds = vec![vec![2.0]; width];
        let run = |recording: &Recording, worlds: &[Vec<f32>]| {
            let program = compiled(recording, target).unwrap();
            outputs(&program, recording, width, worlds)
        };
        assert_eq!(run(&open, &worlds), Some(vec![vec![3.0]; width]));
        assert_eq!(run(&known, &worlds), None);
        worlds[3][0] = -2.0;
        assert_eq!(run(&open, &worlds), None);
    }
}

#[test]
fn what_is_not_finite_is_chosen_as_the_interpreter_does() {
    let recording = record(2, |_, x| {
        let mask = x[0].lt(x[1]);
        let choice = Num::select(mask, Num::c(1.0), Num::c(2.0));
        vec![
            x[0].min(x[1]),
            x[0].max(x[1]),
            choice,
            x[0].round(),
            x[1].abs().sqrt(),
        ]
    });
    let recording = recording.unwrap();
    let numbers = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.5];
    let worlds: Vec<Vec<f32>> = (0..16)
        .map(|k| vec![numbers[k / 4], numbers[k % 4]])
        .collect();
    for (target, width) in targets() {
        let program = compiled(&recording, target).unwrap();
        for worlds in worlds.chunks(width) {
            let results = outputs(&program, &recording, width, worlds).expect("nothing is assumed");
            for (world, result) in worlds.iter().zip(results) {
                let expected = recording.evaluate(world, &mut [], &tables());
                // of a NaN no more is promised than that it is one
                let same =
                    |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(
                    result.iter().zip(&expected).all(same),
                    "{world:?}: {result:?}, {expected:?}"
                );
            }
        }
    }
}

#[test]
fn more_masks_than_registers_come_back() {
    let recording = record(INPUTS, |_, x| {
        let masks: Vec<_> = (0..20)
            .map(|k| x[k % INPUTS].lt(Num::c(0.3 * k as f64 - 2.0)))
            .collect();
        let choice = |skip: usize| {
            let rest = masks.iter().enumerate().filter(|(k, _)| k % 5 != skip);
            rest.fold(x[0], |sum, (k, mask)| {
                sum + Num::select(*mask, x[k % 3], Num::c(0.5))
            })
        };
        (0..5).map(choice).collect()
    });
    let spills = assert_same(&recording.unwrap(), &mut Random::seeded(4), "masks");
    assert!(spills > 10 || targets().is_empty(), "{spills}");
}

#[test]
fn each_input_may_be_in_an_array_of_its_own() {
    const ARRAYS: usize = 15;
    let recording = record(ARRAYS, |_, x| {
        let sum =
            |step: usize| (0..60).fold(x[0], |sum, k| sum.fma(Num::c(0.5), x[k * step % ARRAYS]));
        vec![sum(1), sum(7)]
    });
    let recording = recording.unwrap();
    for (target, width) in targets() {
        let address = |array: usize| Address {
            array: array as u32,
            at: 0,
        };
        let inputs: Vec<Address> = (0..ARRAYS).map(address).collect();
        let results: Vec<Address> = (ARRAYS..ARRAYS + 2).map(address).collect();
        let places = Places {
            inputs: &inputs,
            outputs: &results,
            memory: None,
        };
        let program = Program::new(&recording, &places, &tables(), target).unwrap();
        let mut arrays: Vec<Line> = (0..ARRAYS + 2).map(|k| Line([k as f32; 16])).collect();
        let places: Vec<*mut f32> = arrays.iter_mut().map(|line| line.0.as_mut_ptr()).collect();
        let mut scratch = vec![Line([0.0; 16]); program.scratch() + 1];
        // SAFETY: each array has a register, and `targets` are those that this processor has.
        let done = unsafe { program.run(&places, scratch.as_mut_ptr().cast()) };
        let world: Vec<f32> = (0..ARRAYS).map(|k| k as f32).collect();
        let expected = recording.evaluate(&world, &mut [], &tables());
        assert!(done);
        for (line, expected) in arrays[ARRAYS..].iter().zip(expected) {
            assert_eq!(line.0[..width], vec![expected; width]);
        }
    }
}

#[test]
fn tables_of_the_model_are_folded_in_and_other_reads_of_them_are_refused_by_name() {
    let table = Fixed {
        base: 0,
        stride: 2,
        rows: 2,
    };
    let known = record(1, |cx, x| {
        let row = cx.at(1);
        vec![x[0] * cx.constant(table, row, 1)]
    });
    assert_same(&known.unwrap(), &mut Random::seeded(3), "a known row");
    let picked = record(1, |cx, x| vec![cx.pick(table, x[0], 0)]).unwrap();
    let error = compiled(&picked, Target::Avx2).unwrap_err();
    if cfg!(target_arch = "x86_64") {
        assert!(error.to_string().contains("Pick"), "{error}");
    }
}

//! The order of statements: the same bits, and values shortly before their use.

use crate::toy;
use sim_physics::lane::{Cx, Num, Tables};
use sim_record::wgsl::{ProgramOptions, sequence, wgsl};
use sim_record::{Recording, record};

/// Each output on its own, except for those that wait.
fn goals(recording: &Recording, waits: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let outputs = (0..recording.outputs()).filter(|k| !waits(*k));
    outputs.map(|k| vec![k]).collect()
}

#[test]
fn random_programs_give_the_same_bits_scheduled() {
    let mut moved = 0;
    for seed in 0..400 {
        let mut random = toy::Random(seed);
        let steps = toy::program(&mut random, 3, 4, 12);
        let recording = toy::recorded(&steps).vectorized();
        let waits = |k: usize| (seed as usize + k).is_multiple_of(3);
        let scheduled = recording.scheduled(&goals(&recording, waits));
        moved += usize::from(scheduled != recording);
        assert_eq!(scheduled.statements(), recording.statements());
        for world in toy::worlds::<{ toy::INPUTS }>(&mut random, 12) {
            let (mut a, mut b) = ([0.5; toy::SCRATCH], [0.5; toy::SCRATCH]);
            let expected = recording.evaluate(&world, &mut a, &toy::tables());
            let got = scheduled.evaluate(&world, &mut b, &toy::tables());
            let bits = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&got), bits(&expected), "seed {seed}: {steps:#?}");
            assert_eq!(bits(&a), bits(&b), "seed {seed}: memory: {steps:#?}");
        }
    }
    assert!(moved > 200, "{moved} of 400 programs were changed");
}

/// Squares of all inputs, then what each output makes of one.
#[test]
fn outputs_are_computed_and_written_one_after_the_other() {
    let recording = record(8, |_, x| {
        let squares: Vec<_> = x.iter().map(|x| *x * *x).collect();
        squares.iter().map(|y| *y + Num::c(1.0)).collect()
    })
    .unwrap();
    let text = wgsl(&recording, &ProgramOptions::default());
    let line = |what: &str| text.lines().position(|line| line.contains(what)).unwrap();
    // the first vector is written before the second one is read
    assert!(
        line("fields[2u * worlds + world] =") < line("= fields[1u"),
        "{text}"
    );
}

#[test]
fn what_reads_and_changes_variables_keeps_its_order() {
    let recording = record(2, |cx, x| {
        let mut v = cx.var(x[0] * x[1]);
        let before = cx.get(&v) + x[0];
        cx.set(&mut v, before * before);
        let after = cx.get(&v) - x[1];
        vec![after, before]
    })
    .unwrap();
    let run = |recording: &Recording| recording.evaluate(&[3.0, 0.5], &mut [], &Tables::default());
    for waits in 0..3 {
        let scheduled = recording.scheduled(&goals(&recording, |k| k == waits));
        assert_eq!(run(&scheduled), [19.75, 4.5]);
    }
    assert_eq!(run(&recording), [19.75, 4.5]);
}

#[test]
fn programs_in_sequence_are_scopes_that_share_their_fields() {
    let doubled = record(1, |_, x| vec![x[0] + x[0]]).unwrap();
    let squared = record(1, |_, x| vec![x[0] * x[0]]).unwrap();
    let fields = |input: u32, output: u32| ProgramOptions {
        inputs: Some(vec![input]),
        outputs: Some(vec![output]),
        ..ProgramOptions::default()
    };
    let (first, second) = (fields(0, 4), fields(4, 8));
    let text = sequence(&[(&doubled, &first), (&squared, &second)]);
    let place = |what: &str| text.find(what).unwrap_or_else(|| panic!("{what}: {text}"));
    // what the second one reads was written by the first
    assert!(place("fields[1u * worlds + world].x =") < place("= fields[1u * worlds + world].x;"));
    assert!(place("= fields[1u * worlds + world].x;") < place("fields[2u * worlds + world].x ="));
    assert_eq!(text.matches("\n    {\n").count(), 2, "{text}");
    assert_eq!(text.matches("let x0 =").count(), 2, "{text}");
    assert_eq!(text.matches("fn main").count(), 1, "{text}");
}

#[test]
#[should_panic(expected = "have one lane")]
fn programs_of_several_lanes_are_not_put_in_sequence() {
    let recording = record(1, |_, x| vec![x[0] + x[0]]).unwrap();
    let listed = ProgramOptions {
        is_listed: true,
        ..ProgramOptions::default()
    };
    sequence(&[
        (&recording, &ProgramOptions::default()),
        (&recording, &listed),
    ]);
}

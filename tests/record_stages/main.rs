//! Every stage of a step, for the FR3 and for a robot of every joint: recorded, printed, validated, and run against the CPU.

mod models;
#[path = "../../sim-core/tests/toy/mod.rs"]
mod toy;

use models::{every_joint, fr3, limits_only, random_state};
use sim_core::backend::gpu::program::{ProgramOptions, wgsl};
use sim_core::batch::{Block, Numbers, WorkSlot};
use sim_core::lane::memory::Cpu;
use sim_core::lane::record::{Recorded, RecordedVariable, Recorder, Recording, record};
use sim_core::lane::{Cx, Num, Tables};
use sim_core::model::constants::Constants;
use sim_core::step::{STAGES, Stage, step};
use sim_core::times;
use std::time::Instant;

/// Past this a GPU driver takes seconds to compile a kernel.
const STATEMENTS_MAX: usize = 5000;
const SUBSTEPS: usize = 8;
/// Stages that leave the state as it is.
const BEFORE_INTEGRATE: usize = STAGES.len() - 1;
const STATES: usize = 50;

type Scalar = Block<f32, f32>;
type OnTape = Block<Recorded, RecordedVariable>;

fn numbers(block: &mut Scalar, slot: WorkSlot) -> &mut [f32] {
    match block.numbers(slot) {
        Numbers::Cells(x) | Numbers::Values(x) => x,
    }
}

fn gathered(block: &mut Scalar, slots: &[WorkSlot]) -> Vec<f32> {
    slots
        .iter()
        .flat_map(|slot| numbers(block, *slot).to_vec())
        .collect()
}

/// A block whose slots are the inputs, in order.
fn given(cx: &mut Recorder, m: &Constants<f32>, slots: &[WorkSlot], x: &[Recorded]) -> OnTape {
    let cell = cx.var(Recorded::c(0.0));
    let mut block = Block::new(m, cell);
    let cells = [
        WorkSlot::JointQ,
        WorkSlot::JointQd,
        WorkSlot::JointQdd,
        WorkSlot::Unconverged,
        WorkSlot::EfcWeight,
        WorkSlot::EfcAref,
        WorkSlot::EfcForce,
        WorkSlot::ConstraintForce,
    ];
    for slot in cells {
        if let Numbers::Cells(cells) = block.numbers(slot) {
            cells.fill_with(|| cx.var(Recorded::c(0.0)));
        }
    }
    let mut inputs = x.iter().copied();
    let mut next = || inputs.next().expect("an input for every number read");
    for slot in slots {
        match block.numbers(*slot) {
            Numbers::Cells(cells) => cells.iter_mut().for_each(|v| cx.set(v, next())),
            Numbers::Values(values) => values.iter_mut().for_each(|v| *v = next()),
        }
    }
    block
}

fn results(cx: &mut Recorder, block: &mut OnTape, slots: &[WorkSlot]) -> Vec<Recorded> {
    let mut results = Vec::new();
    for slot in slots {
        match block.numbers(*slot) {
            Numbers::Cells(cells) => results.extend(cells.iter().map(|v| cx.get(v))),
            Numbers::Values(values) => results.extend_from_slice(values),
        }
    }
    results
}

/// The recording of a text between two sets of slots.
fn recorded(
    m: &Constants<f32>,
    reads: &[WorkSlot],
    writes: &[WorkSlot],
    text: impl FnOnce(&mut Recorder, &mut OnTape),
) -> Recording {
    let inputs = gathered(&mut Block::new(m, 0.0), reads).len();
    record(inputs, |cx, x| {
        let mut block = given(cx, m, reads, x);
        text(cx, &mut block);
        results(cx, &mut block, writes)
    })
    .unwrap_or_else(|e| panic!("refused: {e}"))
}

/// Equal in every bit but the sign of zeros: the recorder keeps every rounding of the text.
#[track_caller]
fn assert_same(got: &[f32], expected: &[f32], what: &str) {
    assert_eq!(got.len(), expected.len());
    for (i, (a, b)) in got.iter().zip(expected).enumerate() {
        assert_eq!(
            toy::bits(*a),
            toy::bits(*b),
            "{what}: output {i} is {a}, not {b}"
        );
    }
}

#[test]
fn every_stage_is_recorded_and_its_program_is_valid() {
    for m in [fr3(), every_joint()] {
        for stage in Stage::ALL {
            let start = Instant::now();
            let recording = recorded(&m, stage.reads(), stage.writes(), |cx, b| {
                stage.run(cx, &m, b)
            });
            let taken = start.elapsed();
            let statements = recording.statements();
            let program = wgsl(
                &recording,
                &ProgramOptions {
                    entry: stage.name().to_owned(),
                    ..ProgramOptions::default()
                },
            );
            toy::validated(&program);
            println!(
                "{:12} {:5} in {taken:.1?}: {statements:?}",
                stage.name(),
                statements.total()
            );
            assert!(
                statements.total() <= STATEMENTS_MAX,
                "{}: {statements:?}",
                stage.name()
            );
            assert_eq!(recording.scratch(), 0, "stages keep their numbers in slots");
        }
    }
}

#[test]
fn every_recorded_stage_gives_the_bits_of_the_scalar_run() {
    for m in [fr3(), every_joint(), limits_only()] {
        let mut random = toy::Random(1);
        let recordings: Vec<Recording> = Stage::ALL
            .iter()
            .map(|s| recorded(&m, s.reads(), s.writes(), |cx, b| s.run(cx, &m, b)))
            .collect();
        for _ in 0..STATES {
            let mut block = random_state(&m, &mut random);
            let tables = Tables::default();
            let cx = &mut Cpu::new(&mut [], &tables);
            // poses belong to the state before it moves on
            for stage in STAGES[..BEFORE_INTEGRATE].iter().chain(&[
                Stage::Accelerations,
                Stage::Poses,
                Stage::Integrate,
            ]) {
                let recording = &recordings[Stage::ALL.iter().position(|s| s == stage).unwrap()];
                let inputs = gathered(&mut block, stage.reads());
                stage.run(cx, &m, &mut block);
                let expected = gathered(&mut block, stage.writes());
                let got = recording.evaluate(&inputs, &mut [], &tables);
                assert_same(&got, &expected, stage.name());
            }
        }
    }
}

#[test]
fn the_random_states_of_these_tests_take_every_path() {
    for m in [fr3(), every_joint()] {
        let mut one_round = m.clone();
        one_round.solver.iterations = 1;
        let (mut random, mut same) = (toy::Random(1), toy::Random(1));
        let (mut active, mut hard) = (0, 0);
        for _ in 0..STATES {
            let tables = Tables::default();
            let cx = &mut Cpu::new(&mut [], &tables);
            let mut block = random_state(&m, &mut random);
            let mut hurried = random_state(&m, &mut same);
            for stage in &STAGES[..BEFORE_INTEGRATE] {
                stage.run(cx, &m, &mut block);
                stage.run(cx, &one_round, &mut hurried);
            }
            let limits = &block.efc_weight[m.rows() - m.limits.len()..];
            active += usize::from(limits.iter().any(|weight| *weight > 0.0));
            hard += usize::from(block.joint_qdd != hurried.joint_qdd);
        }
        println!(
            "{STATES} states: limits active in {active}, more than one Newton round in {hard}"
        );
        assert!(active > STATES / 4 && active < STATES && hard > STATES / 4);
    }
}

#[test]
fn a_control_frame_is_recorded_as_a_loop_over_substeps() {
    use WorkSlot::*;
    for m in [fr3(), every_joint()] {
        let reads = [
            JointQ,
            JointQd,
            JointQdd,
            Unconverged,
            JointF,
            JointTargetQ,
            JointTargetQd,
        ];
        let writes = [JointQ, JointQd, JointQdd, Unconverged];
        let start = Instant::now();
        let recording = recorded(&m, &reads, &writes, |cx, b| {
            times!(cx, SUBSTEPS, { step(cx, &m, b) });
        });
        let taken = start.elapsed();
        println!(
            "frame {} in {taken:.1?}: {:?}",
            recording.statements().total(),
            recording.statements()
        );
        toy::validated(&wgsl(&recording, &ProgramOptions::default()));

        let mut random = toy::Random(2);
        for _ in 0..10 {
            let mut block = random_state(&m, &mut random);
            let inputs = gathered(&mut block, &reads);
            let tables = Tables::default();
            let cx = &mut Cpu::new(&mut [], &tables);
            for _ in 0..SUBSTEPS {
                step(cx, &m, &mut block);
            }
            let expected = gathered(&mut block, &writes);
            assert_same(
                &recording.evaluate(&inputs, &mut [], &tables),
                &expected,
                "frame",
            );
        }
    }
}

#[test]
fn what_a_stage_does_not_name_it_neither_reads_nor_writes() {
    use WorkSlot::*;
    let all = [
        JointQ,
        JointQd,
        JointQdd,
        Unconverged,
        JointF,
        JointTargetQ,
        JointTargetQd,
        Rotation,
        Origin,
        Reference,
        Motion,
        Inertia,
        BiasForce,
        MassMatrix,
        SmoothForce,
        EfcWeight,
        EfcAref,
        LimitSide,
        EfcForce,
        ConstraintForce,
        BodyQ,
        Velocity,
        LinkCenter,
        BodyQd,
    ];
    for m in [fr3(), every_joint()] {
        let mut start = random_state(&m, &mut toy::Random(3));
        let tables = Tables::default();
        let cx = &mut Cpu::new(&mut [], &tables);
        for stage in Stage::ALL {
            let mut named = stage.reads().iter().chain(stage.writes());
            assert!(
                named.all(|slot| all.contains(slot)),
                "{} names a slot that is not here",
                stage.name()
            );
            let mut poisoned = Block::new(&m, 0.0);
            for slot in all {
                let (from, to) = (
                    numbers(&mut start, slot).to_vec(),
                    numbers(&mut poisoned, slot),
                );
                to.copy_from_slice(&from);
                if !stage.reads().contains(&slot) && !stage.writes().contains(&slot) {
                    to.fill(f32::NAN);
                }
            }
            stage.run(cx, &m, &mut start);
            stage.run(cx, &m, &mut poisoned);
            for slot in all {
                let (got, expected) = (numbers(&mut poisoned, slot), numbers(&mut start, slot));
                if stage.writes().contains(&slot) {
                    assert_same(got, expected, stage.name());
                } else if !stage.reads().contains(&slot) {
                    assert!(
                        got.iter().all(|x| x.is_nan()),
                        "{} writes {slot:?}",
                        stage.name()
                    );
                }
            }
        }
    }
}

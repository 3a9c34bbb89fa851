//! Every stage of a step, of robots and of shapes that touch: recorded, printed, validated, and run against the CPU.

mod bits;
#[path = "../../../../../tests/common/cases.rs"]
mod cases;
mod several_lanes;
#[path = "../../../../../tests/common/shapes.rs"]
mod shapes;
#[path = "../../../../record/tests/toy/mod.rs"]
mod toy;

use cases::{Case, SUBSTEPS, Scalar, arm_and_cube, cases, every_joint, every_param, fr3};
use sim_physics::arrays::{Array, Block, Flat, Writer};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::Cone;
use sim_physics::constants::contact::PAIR_KINDS;
use sim_physics::every_stage;
use sim_physics::lane::memory::Cpu;
use sim_physics::schedule::step_stages;
use sim_physics::step::{Stage, StageId};
use sim_physics::times;
use sim_record::wgsl::{ProgramOptions, wgsl};
use sim_record::{Recorder, Recording};
use stages_recorded::RecordedWorlds;
use std::time::Instant;

/// Past this a GPU driver takes seconds to compile a kernel.
const STATEMENTS_MAX: usize = 5000;
/// The solver unrolls the classes of contacts, seven of the arm at the cube: it is past that.
const SOLVER_STATEMENTS_MAX: usize = 12_000;
const STATES: usize = 50;
/// States in which each pair of kinds is to touch.
const MANY_STATES: usize = 200;

type RunStage = fn(&Constants<f32>, &mut Scalar, &mut [f32]);

/// A stage on a backend of one world. Here stands the only call, so that the physics is compiled once.
fn run(stage: StageId, m: &Constants<f32>, block: &mut Scalar, memory: &mut [f32]) {
    static STAGES: [RunStage; StageId::COUNT] = every_stage!(stage_functions(on_a_world));
    fn on_a_world<S: Stage>(m: &Constants<f32>, block: &mut Scalar, memory: &mut [f32]) {
        let cx = &mut Cpu::new(memory, &m.contacts.tables);
        S::run(cx, m, block);
    }
    STAGES[stage.index()](m, block, memory);
}

/// Scratch memory of the machine: it carries contacts from stage to stage.
fn memory(m: &Constants<f32>) -> Vec<f32> {
    vec![0.0; m.contacts.memory.len]
}

/// The stages that a model needs.
fn needed(m: &Constants<f32>) -> impl Iterator<Item = StageId> {
    StageId::all().filter(|stage| stage.is_needed(m))
}

/// The stages of a step that leave the state as it is.
fn before_integrate(m: &Constants<f32>) -> impl Iterator<Item = StageId> {
    needed(m).filter(|stage| stage.row().runs.is_shared())
}

/// Arrays that a stage leaves for others.
fn lasting() -> impl Iterator<Item = Array> {
    let all = Array::ALL.iter().copied();
    all.filter(|array| array.writer() != Writer::Scratch)
}

fn numbers(block: &mut Scalar, array: Array) -> &mut [f32] {
    match block.array_mut(array) {
        Flat::Cells(x) | Flat::Values(x) => x,
    }
}

fn gathered(block: &mut Scalar, arrays: &[Array]) -> Vec<f32> {
    arrays
        .iter()
        .flat_map(|array| numbers(block, *array).to_vec())
        .collect()
}

/// The recording of a text between two sets of slots.
fn recorded(
    m: &Constants<f32>,
    reads: &[Array],
    writes: &[Array],
    text: impl FnOnce(&mut Recorder, &mut RecordedWorlds),
) -> Recording {
    let recording = stages_recorded::between(m, reads, writes, |cx, b| {
        text(cx, b);
        Vec::new()
    });
    recording.unwrap_or_else(|e| panic!("refused: {e}"))
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

/// The recording of a stage.
fn recorded_stage(m: &Constants<f32>, stage: StageId) -> Recording {
    recorded(m, stage.reads(), stage.writes(), |cx, b| {
        stages_recorded::run(stage, cx, m, b);
    })
}

#[test]
fn every_stage_is_recorded_and_its_program_is_valid() {
    for Case { name, m, .. } in cases() {
        for stage in needed(&m) {
            let start = Instant::now();
            let recording = recorded_stage(&m, stage);
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
                "{name:12} {:17} {:5} in {taken:.1?}: {statements:?}",
                stage.name(),
                statements.total()
            );
            let most = match stage.name() {
                "solver" | "solver_turning" if !m.contacts.classes.is_empty() => {
                    SOLVER_STATEMENTS_MAX
                }
                _ => STATEMENTS_MAX,
            };
            assert!(
                statements.total() <= most,
                "{name}: {}: {statements:?}",
                stage.name()
            );
            assert!(recording.scratch() <= m.contacts.memory.len);
        }
    }
}

#[test]
fn the_random_states_of_these_tests_take_every_path() {
    for case in [fr3(), every_joint()] {
        let m = &case.m;
        let mut one_round = m.clone();
        one_round.solver.iterations = 1;
        let (mut random, mut same) = (toy::Random(1), toy::Random(1));
        let (mut active, mut hard) = (0, 0);
        for _ in 0..STATES {
            let mut block = case.random_state(|| random.unit());
            let mut hurried = case.random_state(|| same.unit());
            let (mut memory, mut other) = (memory(m), memory(m));
            for stage in before_integrate(m) {
                run(stage, m, &mut block, &mut memory);
                run(stage, &one_round, &mut hurried, &mut other);
            }
            let limits = &block.efc_weight[m.rows() - m.limits.len()..];
            active += usize::from(limits.iter().any(|weight| *weight > 0.0));
            hard += usize::from(block.joint_qdd != hurried.joint_qdd);
        }
        println!(
            "{}: {STATES} states: limits active in {active}, more than one Newton iteration in {hard}",
            case.name
        );
        assert!(active > STATES / 4 && active < STATES && hard > STATES / 4);
    }
}

/// Contacts of every class of a world, by what pair they are of.
fn contacts(m: &Constants<f32>, memory: &[f32]) -> Vec<usize> {
    let t = &m.contacts;
    let mut pairs = Vec::new();
    for (k, class) in t.classes.iter().enumerate() {
        let count = memory[t.memory.counts.base + k] as usize;
        for row in class.first..class.first + count.min(class.capacity) {
            let place = t.memory.rows.base + row * t.memory.rows.stride;
            pairs.push(memory[place + sim_physics::constants::contact::row::PAIR] as usize);
        }
    }
    pairs
}

#[test]
fn the_random_shapes_of_these_tests_touch_in_every_pair_of_kinds() {
    let (free, tight) = (
        cases::shapes(Cone::Elliptic, None),
        cases::shapes(Cone::Pyramidal, Some(5)),
    );
    for case in [&free, &tight] {
        let m = &case.m;
        let mut random = toy::Random(1);
        let (mut touching, mut left_out, mut coupled) = ([0; PAIR_KINDS.len()], 0, 0);
        for _ in 0..MANY_STATES {
            let mut block = case.random_state(|| random.unit());
            let mut memory = memory(m);
            for stage in before_integrate(m) {
                run(stage, m, &mut block, &mut memory);
            }
            let touching_pairs = contacts(m, &memory);
            for (kinds, count) in PAIR_KINDS.into_iter().zip(&mut touching) {
                let group = m
                    .contacts
                    .group(kinds)
                    .expect("every pair of kinds is there");
                let touches = touching_pairs
                    .iter()
                    .any(|p| (group.first..group.end).contains(p));
                *count += usize::from(touches);
            }
            let couples = |&p: &usize| m.contacts.classes[m.contacts.pairs[p].class].couples;
            coupled += usize::from(touching_pairs.iter().any(couples));
            left_out += usize::from(block.left_out[0] > 0.0);
        }
        println!(
            "{}: {touching:?} of {MANY_STATES}, {left_out} too many, {coupled} coupled",
            case.name
        );
        if case.m.contacts.may_overflow {
            assert!(left_out > MANY_STATES / 4 && left_out < MANY_STATES);
        } else {
            assert!(
                touching
                    .iter()
                    .all(|&count| count > 0 && count < MANY_STATES)
            );
            assert!(coupled > MANY_STATES / 4 && coupled < MANY_STATES && left_out == 0);
        }
    }
}

#[test]
fn a_control_frame_is_recorded_as_a_loop_over_substeps() {
    use Array::*;
    // the searches of hulls are loops as deep as a text may have them: with those of a frame around them, too deep
    for case in [
        fr3(),
        every_joint(),
        arm_and_cube(),
        every_param(),
        cases::mujoco("implicit"),
        cases::mujoco("runge_kutta"),
    ] {
        let m = &case.m;
        let reads = [
            JointQ,
            JointQRest,
            JointQd,
            JointQdd,
            Unconverged,
            LeftOut,
            JointF,
            JointTargetQ,
            JointTargetQd,
            Params,
            Substep,
            CommandHistory,
            CommandNoise,
            Ctrl,
            ControlHistory,
        ];
        let writes = [
            JointQ,
            JointQRest,
            JointQd,
            JointQdd,
            Unconverged,
            LeftOut,
            ControlHistory,
        ];
        let start = Instant::now();
        let recording = recorded(m, &reads, &writes, |cx, b| {
            times!(cx, SUBSTEPS, {
                for stage in step_stages(m) {
                    stages_recorded::run(stage, cx, m, b);
                }
            });
        });
        let taken = start.elapsed();
        println!(
            "{}: frame {} in {taken:.1?}: {:?}",
            case.name,
            recording.statements().total(),
            recording.statements()
        );
        toy::validated(&wgsl(&recording, &ProgramOptions::default()));

        let mut random = toy::Random(2);
        for _ in 0..10 {
            let mut block = case.random_state(|| random.unit());
            let inputs = gathered(&mut block, &reads);
            let (mut memory, mut scratch) = (memory(m), memory(m));
            for _ in 0..SUBSTEPS {
                for stage in step_stages(m) {
                    run(stage, m, &mut block, &mut memory);
                }
            }
            let expected = gathered(&mut block, &writes);
            let got = recording.evaluate(&inputs, &mut scratch, &m.contacts.tables);
            assert_same(&got, &expected, case.name);
        }
    }
}

#[test]
fn what_a_stage_does_not_name_it_neither_reads_nor_writes() {
    for case in [
        fr3(),
        every_joint(),
        cases::shapes(Cone::Elliptic, None),
        cases::shapes_as_mujoco(),
        arm_and_cube(),
        cases::mujoco("implicit"),
        cases::mujoco("runge_kutta"),
        cases::sensors(),
    ] {
        let m = &case.m;
        let mut random = toy::Random(3);
        let mut start = case.random_state(|| random.unit());
        let mut memory = memory(m);
        for stage in needed(m) {
            let mut named = stage.reads().iter().chain(stage.writes());
            assert!(
                named.all(|array| array.writer() != Writer::Scratch),
                "{} names scratch of another stage",
                stage.name()
            );
            let mut poisoned = Block::new(m, 0.0);
            for array in lasting() {
                let (from, to) = (
                    numbers(&mut start, array).to_vec(),
                    numbers(&mut poisoned, array),
                );
                to.copy_from_slice(&from);
                if !stage.reads().contains(&array) && !stage.writes().contains(&array) {
                    to.fill(f32::NAN);
                }
            }
            for &array in Array::ALL {
                if array.writer() == Writer::Scratch {
                    numbers(&mut poisoned, array).fill(f32::NAN);
                }
            }
            let mut other = memory.clone();
            run(stage, m, &mut start, &mut memory);
            run(stage, m, &mut poisoned, &mut other);
            assert_same(&other, &memory, stage.name());
            for array in lasting() {
                let (got, expected) = (numbers(&mut poisoned, array), numbers(&mut start, array));
                if stage.writes().contains(&array) {
                    assert_same(got, expected, stage.name());
                } else if !stage.reads().contains(&array) {
                    assert!(
                        got.iter().all(|x| x.is_nan()),
                        "{} writes {array:?}",
                        stage.name()
                    );
                }
            }
        }
    }
}

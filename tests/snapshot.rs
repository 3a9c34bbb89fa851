//! A run that is resumed from a snapshot goes on with the same bits; what is no good snapshot is refused and changes nothing.

mod common;

use common::{Demo, Run, lesson_with_table};
use common::{noise, shapes::shapes};
use sim_engine::backend::{COUNTERS, Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_engine::snapshot::SnapshotError;
use sim_model::{Body, Collision, Cone, Description, Model, Pose, Shape, UrdfOptions};
use sim_physics::arrays::{Field, status};
use std::sync::Arc;

const WORLDS: usize = 37;
const FIELDS: [Field; 13] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::JointF,
    Field::JointTargetQ,
    Field::JointTargetQd,
    Field::BodyQ,
    Field::MassMatrix,
    Field::EfcForce,
    Field::ContactCount,
    Field::ContactForce,
    Field::ContactPos,
    Field::BodyContactForce,
];
/// Frames before the snapshot: contacts of the lesson begin in frame 14.
const BEFORE: usize = 16;
const AFTER: usize = 12;

/// The arm with a cube, a robot with every kind of joint, and bodies of every shape.
fn models() -> [Arc<Model>; 3] {
    let mut joints = Description::new(1.0 / 480.0, 8);
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("r")
    };
    let urdf = common::repo("sim-core/stages/recorded/tests/record_stages/every_joint.urdf");
    joints.add_urdf(urdf, options).unwrap();
    let scenes = [
        lesson_with_table(Demo::Target, true),
        joints,
        shapes(Cone::Elliptic),
    ];
    scenes.map(|scene| scene.compile().unwrap())
}

fn options(precision: Precision, lanes: Lanes, threads: usize, worlds: usize) -> Options {
    Options {
        worlds,
        precision,
        lanes,
        threads: Some(threads),
        fields: FIELDS.to_vec(),
        ..Options::default()
    }
}

/// Worlds that all differ in velocity, after some frames in which they were pushed.
fn under_way(model: &Arc<Model>, options: Options) -> Run {
    let worlds = options.worlds;
    let mut run = Run::new(model, options);
    let dofs = model.dofs();
    let rows = (0..worlds).flat_map(|w| (0..dofs).map(move |k| 0.3 * noise(w, k)));
    let rows: Vec<f64> = rows.collect();
    run.sim
        .write(Field::JointQd, 0..dofs, Values::F64(&rows), None)
        .unwrap();
    for frame in 0..BEFORE {
        push(&mut run, frame);
        run.step();
    }
    run
}

/// Forces of a frame, each world's own.
fn push(run: &mut Run, frame: usize) {
    let dofs = run.sim.model().dofs();
    let rows = (0..run.sim.worlds())
        .flat_map(|w| (0..dofs).map(move |k| 0.5 * noise(w + 1, k + 100 * frame)));
    let rows: Vec<f64> = rows.collect();
    run.sim
        .command(Field::JointF, 0..dofs, Values::F64(&rows))
        .unwrap();
}

/// Bits of all fields of a world, the counters included.
fn bits(run: &Run, world: usize) -> Vec<u64> {
    let slots = &run.sim.layout().slots;
    let mut bits = Vec::new();
    for slot in slots {
        if matches!(slot.field, Field::Step | Field::Time) {
            bits.push(run.arena[slot.offset / 8 + world]);
        } else {
            bits.extend(run.get(slot.field, world).into_iter().map(f64::to_bits));
        }
    }
    bits
}

fn all_bits(run: &Run) -> Vec<Vec<u64>> {
    (0..run.sim.worlds())
        .map(|world| bits(run, world))
        .collect()
}

/// Bits of all worlds in every frame after the snapshot, half of which go on under the commands that it holds.
fn go_on(run: &mut Run) -> Vec<Vec<Vec<u64>>> {
    let mut frames = Vec::new();
    run.forward();
    frames.push(all_bits(run));
    for frame in 0..AFTER {
        if frame > AFTER / 2 {
            push(run, BEFORE + frame);
        }
        run.step();
        frames.push(all_bits(run));
    }
    frames
}

fn machines() -> Vec<(Precision, Lanes)> {
    let machines = [
        (Precision::F32, Lanes::Sixteen),
        (Precision::F32, Lanes::Eight),
        (Precision::F32, Lanes::Scalar),
        (Precision::F64, Lanes::Scalar),
    ];
    machines
        .into_iter()
        .filter(|&(_, lanes)| cpu::available(lanes))
        .collect()
}

#[test]
fn run_resumed_from_a_snapshot_has_the_same_bits() {
    for model in models() {
        for (precision, lanes) in machines() {
            let mut run = under_way(&model, options(precision, lanes, 1, WORLDS));
            let snapshot = run.sim.snapshot();
            let first = go_on(&mut run);
            run.sim.restore(&snapshot, None, None).unwrap();
            assert!(run.sim.snapshot() == snapshot, "{precision:?} {lanes:?}");
            assert!(
                first == go_on(&mut run),
                "{precision:?} {lanes:?}: the same run"
            );
            // in a simulation that is new
            let mut other = Run::new(&model, options(precision, lanes, 1, WORLDS));
            other.sim.restore(&snapshot, None, None).unwrap();
            assert!(
                first == go_on(&mut other),
                "{precision:?} {lanes:?}: another"
            );
        }
    }
}

#[test]
fn snapshot_does_not_depend_on_lanes_or_threads() {
    for model in models() {
        let mut run = under_way(&model, options(Precision::F32, Lanes::Auto, 2, WORLDS));
        let snapshot = run.sim.snapshot();
        let first = go_on(&mut run);
        for (_, lanes) in machines()
            .into_iter()
            .filter(|&(precision, _)| precision == Precision::F32)
        {
            for threads in [1, 2, 5] {
                let mut other = Run::new(&model, options(Precision::F32, lanes, threads, WORLDS));
                other.sim.restore(&snapshot, None, None).unwrap();
                assert!(
                    other.sim.snapshot() == snapshot,
                    "{lanes:?}, {threads} threads"
                );
                assert!(go_on(&mut other) == first, "{lanes:?}, {threads} threads");
            }
        }
    }
}

#[test]
fn worlds_outside_the_mask_keep_their_bits() {
    let [model, ..] = models();
    for (precision, lanes) in machines() {
        let mut run = under_way(&model, options(precision, lanes, 2, WORLDS));
        let snapshot = run.sim.snapshot();
        run.forward();
        let old = all_bits(&run);
        for frame in 0..AFTER {
            push(&mut run, frame);
            run.step();
        }
        run.forward();
        let new = all_bits(&run);
        let mask: Vec<bool> = (0..WORLDS).map(|world| world % 3 == 1).collect();
        run.sim.restore(&snapshot, Some(&mask), None).unwrap();
        run.forward();
        for (world, bits) in all_bits(&run).into_iter().enumerate() {
            let expected = if mask[world] {
                &old[world]
            } else {
                &new[world]
            };
            assert!(bits == *expected, "{precision:?} {lanes:?}: world {world}");
        }
    }
}

#[test]
fn one_world_is_forked_into_those_of_the_mask_and_into_any_number() {
    for model in models() {
        for (precision, lanes) in machines() {
            let mut run = under_way(&model, options(precision, lanes, 1, WORLDS));
            let snapshot = run.sim.snapshot();
            let mask: Vec<bool> = (0..WORLDS).map(|world| world > 4).collect();
            run.sim.restore(&snapshot, Some(&mask), Some(3)).unwrap();
            run.forward();
            let forked = all_bits(&run);
            assert!((5..WORLDS).all(|world| forked[world] == forked[3]) && forked[4] != forked[3]);
            // where there are more worlds, or fewer
            for worlds in [1, 100] {
                let mut other = Run::new(&model, options(precision, Lanes::Auto, 2, worlds));
                other.sim.restore(&snapshot, None, Some(3)).unwrap();
                for _ in 0..3 {
                    other.step();
                }
                run.sim.restore(&snapshot, None, None).unwrap();
                for _ in 0..3 {
                    run.step();
                }
                let expected = bits(&run, 3);
                assert!(
                    (0..worlds).all(|world| bits(&other, world) == expected),
                    "{precision:?} {lanes:?}"
                );
            }
        }
    }
}

#[test]
fn a_frozen_world_stays_frozen_and_a_healthy_one_frees_it() {
    for (precision, lanes) in machines() {
        let model = lesson_with_table(Demo::Torque, true).compile().unwrap();
        let dofs = model.dofs();
        let mut run = under_way(&model, options(precision, lanes, 1, WORLDS));
        let well = run.sim.snapshot();
        let mut blow = vec![0.0; WORLDS * dofs];
        for (world, size) in [(7, 1e38), (8, 1e36), (9, 3e38), (10, 1e33)] {
            let largest = if precision == Precision::F64 {
                1e269
            } else {
                1.0
            };
            blow[world * dofs..][..dofs].fill(size * largest);
        }
        run.sim
            .command(Field::JointF, 0..dofs, Values::F64(&blow))
            .unwrap();
        run.step();
        let frozen =
            |run: &Run, world| run.get(Field::Status, world)[0] == f64::from(status::NOT_FINITE);
        assert!(frozen(&run, 7) && frozen(&run, 9) && !frozen(&run, 6));
        let sick = run.sim.snapshot();
        let first = go_on(&mut run);
        run.sim.restore(&well, None, None).unwrap();
        run.step();
        assert!((0..WORLDS).all(|world| !frozen(&run, world)));
        run.sim.restore(&sick, None, None).unwrap();
        assert!(first == go_on(&mut run), "{precision:?} {lanes:?}");
        assert!(frozen(&run, 7));
        let mask: Vec<bool> = (0..WORLDS).map(|world| world == 7).collect();
        run.sim.restore(&well, Some(&mask), None).unwrap();
        run.step();
        assert!(!frozen(&run, 7) && frozen(&run, 9));
    }
}

/// Worlds of a falling ball of a density [kg/m³], after a step.
fn ball(density: f64, precision: Precision, worlds: usize) -> Run {
    let mut scene = Description::new(1.0 / 480.0, 2);
    let mut body = Body::new("ball", Pose::at([0.0, 0.0, 1.0]));
    let sphere = Shape::Sphere { radius: 0.1 };
    let shape = Collision::new(None, sphere, Pose::identity());
    body.shapes.push((shape, density));
    scene.add_body(body).unwrap();
    let options = Options {
        worlds,
        precision,
        threads: Some(1),
        ..Options::default()
    };
    let mut run = Run::new(&scene.compile().unwrap(), options);
    run.step();
    run
}

/// Why bytes are refused; what the simulation holds is as before.
fn refused(
    run: &mut Run,
    bytes: &[u8],
    mask: Option<&[bool]>,
    from_world: Option<usize>,
) -> SnapshotError {
    let before = run.sim.snapshot();
    let error = run.sim.restore(bytes, mask, from_world).unwrap_err();
    assert!(run.sim.snapshot() == before, "{error}");
    error
}

#[test]
fn every_changed_byte_and_every_other_length_is_refused() {
    let mut run = ball(400.0, Precision::F32, 2);
    let snapshot = run.sim.snapshot();
    assert_eq!(snapshot.len(), run.sim.snapshot_bytes(run.sim.worlds()));
    run.step();
    for at in 0..snapshot.len() {
        for change in [1, 0x80, 0xff] {
            let mut bytes = snapshot.clone();
            bytes[at] ^= change;
            refused(&mut run, &bytes, None, None);
            refused(&mut run, &bytes, None, Some(0));
        }
        refused(&mut run, &snapshot[..at], None, None);
        refused(&mut run, &snapshot[..at], None, Some(0));
    }
    let longer = [&snapshot[..], &[0]].concat();
    assert_eq!(
        refused(&mut run, &longer, None, None),
        SnapshotError::Damaged
    );
    run.sim.restore(&snapshot, None, None).unwrap();
}

/// The snapshot with a changed word, and the checksum that belongs to it.
fn forged(snapshot: &[u8], at: usize, word: u32) -> Vec<u8> {
    let mut bytes = snapshot.to_vec();
    bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
    let checksum = crc32fast::hash(&bytes[16..]);
    bytes[12..16].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

#[test]
fn refusals_name_what_is_wrong() {
    use SnapshotError as Wrong;
    let mut run = ball(400.0, Precision::F32, 3);
    let good = run.sim.snapshot();
    let numbers = ((good.len() - 40) / 3 - COUNTERS) / 4;
    run.step();
    let snapshot_of = |density, precision, worlds| ball(density, precision, worlds).sim.snapshot();
    assert_eq!(
        refused(&mut run, b"<robot/>", None, None),
        Wrong::NotASnapshot
    );
    assert_eq!(refused(&mut run, b"", None, None), Wrong::NotASnapshot);
    assert_eq!(
        refused(&mut run, &forged(&good, 8, 2), None, None),
        Wrong::Version { got: 2 }
    );
    let (got, expected) = (good.len() - 1, good.len() as u128);
    assert_eq!(
        refused(&mut run, &good[..got], None, None),
        Wrong::CutShort { got, expected }
    );
    let mut damaged = good.clone();
    damaged[60] ^= 4;
    assert_eq!(refused(&mut run, &damaged, None, None), Wrong::Damaged);
    let heavy = snapshot_of(500.0, Precision::F32, 3);
    assert!(matches!(
        refused(&mut run, &heavy, None, None),
        Wrong::Model { .. }
    ));
    let double = snapshot_of(400.0, Precision::F64, 3);
    // the model is the same, so the error names the precision
    let (got, expected) = (64, 32);
    assert_eq!(
        refused(&mut run, &double, None, None),
        Wrong::Precision { got, expected }
    );
    // twice the numbers of half the size, as another release might have them
    let halves = forged(&forged(&double, 36, 4), 32, 2 * numbers as u32);
    let (got, expected) = (2 * numbers, numbers);
    assert_eq!(
        refused(&mut run, &halves, None, None),
        Wrong::Numbers { got, expected }
    );
    let four = snapshot_of(400.0, Precision::F32, 4);
    let (got, expected) = (4, 3);
    assert_eq!(
        refused(&mut run, &four, None, None),
        Wrong::Worlds { got, expected }
    );
    assert_eq!(
        refused(&mut run, &four, None, Some(4)),
        Wrong::FromWorld { got: 4, last: 3 }
    );
    let mask = [true; 4];
    let (got, worlds) = (4, 3);
    assert_eq!(
        refused(&mut run, &good, Some(&mask), None),
        Wrong::Mask { got, worlds }
    );
    // worlds of 2⁶⁴ - 1, of which the size overflows
    let huge = forged(&forged(&good, 24, u32::MAX), 28, u32::MAX);
    assert!(matches!(
        refused(&mut run, &huge, None, None),
        Wrong::CutShort { .. }
    ));
}

#[test]
fn numbers_that_are_not_finite_are_refused_in_the_worlds_asked_for() {
    let mut run = ball(400.0, Precision::F32, 3);
    let good = run.sim.snapshot();
    let record = (good.len() - 40) / 3;
    for bits in [
        f32::NAN.to_bits(),
        f32::INFINITY.to_bits(),
        f32::NEG_INFINITY.to_bits(),
    ] {
        for at in (40 + record + COUNTERS..40 + 2 * record).step_by(4) {
            let bytes = forged(&good, at, bits);
            let expected = SnapshotError::NotFinite { world: 1 };
            assert_eq!(refused(&mut run, &bytes, None, None), expected);
            assert_eq!(refused(&mut run, &bytes, None, Some(1)), expected);
            run.sim.restore(&bytes, None, Some(2)).unwrap();
            let others = [true, false, true];
            run.sim.restore(&bytes, Some(&others), None).unwrap();
            assert!(run.sim.snapshot() != bytes);
        }
    }
}

#[test]
fn quaternions_that_are_no_rotation_are_refused_in_the_worlds_asked_for() {
    for precision in [Precision::F32, Precision::F64] {
        let mut run = ball(400.0, precision, 3);
        let good = run.sim.snapshot();
        let real = if precision == Precision::F32 { 4 } else { 8 };
        let record = (good.len() - 40) / 3;
        // velocities, accelerations and commands of six dofs, then the position of the free joint
        let first = 40 + record + COUNTERS + (5 * 6 + 3) * real;
        for (factor, length) in [
            (0.0, "0.000"),
            (1e-4, "0.000"),
            (0.5, "0.500"),
            (2.0, "2.000"),
        ] {
            let mut bytes = good.clone();
            for i in 0..4 {
                let at = first + i * real;
                match precision {
                    Precision::F32 => {
                        let value = f32::from_le_bytes(bytes[at..][..4].try_into().unwrap());
                        bytes[at..][..4].copy_from_slice(&(factor as f32 * value).to_le_bytes());
                    }
                    Precision::F64 => {
                        let value = f64::from_le_bytes(bytes[at..][..8].try_into().unwrap());
                        bytes[at..][..8].copy_from_slice(&(factor * value).to_le_bytes());
                    }
                }
            }
            // the checksum follows
            let word = u32::from_le_bytes(bytes[first..][..4].try_into().unwrap());
            let bytes = forged(&bytes, first, word);
            let length = length.to_owned();
            let expected = SnapshotError::Quaternion { world: 1, length };
            assert_eq!(refused(&mut run, &bytes, None, None), expected);
            assert_eq!(refused(&mut run, &bytes, None, Some(1)), expected);
            run.sim.restore(&bytes, None, Some(2)).unwrap();
            let others = [true, false, true];
            run.sim.restore(&bytes, Some(&others), None).unwrap();
            run.sim.restore_first(&bytes).unwrap();
            assert!(run.sim.snapshot() != bytes);
        }
        run.sim.restore(&good, None, None).unwrap();
    }
}

#[test]
fn a_scene_in_which_nothing_moves_has_snapshots_too() {
    let mut scene = Description::new(1.0 / 480.0, 1);
    scene.add_ground("ground", 0.0);
    let model = scene.compile().unwrap();
    for (precision, lanes) in machines() {
        let mut run = Run::new(&model, options(precision, lanes, 1, 5));
        run.step();
        let snapshot = run.sim.snapshot();
        let first = go_on(&mut run);
        run.sim.restore(&snapshot, None, None).unwrap();
        assert!(go_on(&mut run) == first, "{precision:?} {lanes:?}");
    }
}

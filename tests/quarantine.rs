//! A world that is no longer finite stands still until it is reset, and its neighbours do not notice.

mod common;

use common::{Demo, Run, command, lesson_with_table};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Faults, FirstFrozen, Frozen, Lanes, Options, Precision, Simulation};
use sim_model::{Body, Collision, Description, Pose, Shape};
use sim_physics::arrays::{Field, status};

const WORLDS: usize = 37;
const FIELDS: [Field; 8] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::BodyQ,
    Field::ContactCount,
    Field::ContactForce,
    Field::Status,
    Field::Step,
];
/// The frame in which the sick worlds are struck, and the frames in all: contacts begin in frame 14.
const STRUCK: usize = 15;
const FRAMES: usize = 22;

/// Beyond any number that stays finite for a frame [N·m].
fn blow(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e38,
        Precision::F64 => 1e307,
    }
}

/// Bits of the fields of every world, frame by frame; the sick worlds are struck once, and reset in the last frame but two
/// if `heals`.
fn run(
    lanes: Lanes,
    precision: Precision,
    threads: usize,
    sick: &[usize],
    heals: bool,
) -> Vec<Vec<Vec<u64>>> {
    let model = lesson_with_table(Demo::Torque, true).compile().unwrap();
    let options = Options {
        worlds: WORLDS,
        precision,
        lanes,
        threads: Some(threads),
        fields: FIELDS[..6].to_vec(),
        ..Options::default()
    };
    let mut run = Run::new(&model, options);
    let dofs = model.dofs();
    (0..FRAMES)
        .map(|frame| {
            let (_, row) = command(Demo::Torque, frame);
            let mut rows = vec![0.0; WORLDS * dofs];
            for world in 0..WORLDS {
                for (j, tau) in row.iter().enumerate() {
                    rows[world * dofs + j] = tau * (1.0 + 0.01 * world as f64);
                }
                if frame == STRUCK && sick.contains(&world) {
                    rows[world * dofs..(world + 1) * dofs].fill(blow(precision));
                }
            }
            run.sim
                .command(Field::JointF, 0..dofs, Values::F64(&rows))
                .unwrap();
            if heals && frame == FRAMES - 2 {
                let mask: Vec<bool> = (0..WORLDS).map(|world| sick.contains(&world)).collect();
                run.sim.reset(Some(&mask), None).unwrap();
                run.sim
                    .command(Field::JointF, 0..dofs, Values::F64(&rows))
                    .unwrap();
            }
            run.step();
            let bits = |world: usize| {
                FIELDS[..7]
                    .iter()
                    .flat_map(|&field| run.get(field, world))
                    .map(f64::to_bits)
                    .collect()
            };
            (0..WORLDS).map(bits).collect()
        })
        .collect()
}

fn machines() -> impl Iterator<Item = (Lanes, Precision)> {
    [
        (Lanes::Sixteen, Precision::F32),
        (Lanes::Eight, Precision::F32),
        (Lanes::Scalar, Precision::F32),
        (Lanes::Scalar, Precision::F64),
    ]
    .into_iter()
    .filter(|&(lanes, _)| cpu::available(lanes))
}

#[test]
fn a_world_that_is_not_finite_is_frozen_and_the_others_keep_their_bits() {
    for (lanes, precision) in machines() {
        let sick = [0, 5, 17, 36];
        let well = run(lanes, precision, 2, &[], false);
        let frames = run(lanes, precision, 1, &sick, false);
        for (frame, (worlds, expected)) in frames.iter().zip(&well).enumerate() {
            for world in 0..WORLDS {
                if frame < STRUCK || !sick.contains(&world) {
                    assert_eq!(
                        worlds[world], expected[world],
                        "{lanes:?} {precision:?}: world {world}, frame {frame}"
                    );
                    continue;
                }
                let (status, state) = worlds[world].split_last().unwrap();
                assert_eq!(f64::from_bits(*status), f64::from(status::NOT_FINITE));
                assert!(
                    state.iter().all(|&bits| f64::from_bits(bits).is_finite()) || frame == STRUCK,
                    "{lanes:?} {precision:?}: world {world}, frame {frame}"
                );
                // positions and velocities are those before the blow
                let moving = 2 * 16 - 1;
                assert_eq!(
                    state[..moving],
                    well[STRUCK - 1][world][..moving],
                    "{lanes:?} {precision:?}: world {world}, frame {frame}"
                );
            }
        }
    }
}

#[test]
fn a_frozen_world_that_is_reset_is_as_good_as_new() {
    for (lanes, precision) in machines() {
        let sick = [3, 20];
        let frames = run(lanes, precision, 1, &sick, true);
        for world in sick {
            let (status, state) = frames[FRAMES - 2][world].split_last().unwrap();
            assert_eq!(*status, 0f64.to_bits());
            assert_ne!(state, &frames[FRAMES - 3][world][..state.len()]);
            assert_ne!(state, &frames[FRAMES - 1][world][..state.len()]);
        }
    }
}

#[test]
fn steps_of_a_frozen_world_stand_still() {
    let model = lesson_with_table(Demo::Torque, false).compile().unwrap();
    let options = Options {
        worlds: 20,
        fields: vec![Field::JointQ],
        threads: Some(1),
        ..Options::default()
    };
    let mut run = Run::new(&model, options);
    let steps = |run: &Run| -> Vec<u64> {
        let slots = &run.sim.layout().slots;
        let slot = slots.iter().find(|slot| slot.field == Field::Step).unwrap();
        run.arena[slot.offset / 8..slot.offset / 8 + 20].to_vec()
    };
    run.step();
    let mut blow = vec![0.0; 20 * 9];
    blow[7 * 9 + 3] = 1e38;
    run.sim
        .command(Field::JointF, 0..9, Values::F64(&blow))
        .unwrap();
    run.step();
    run.command(Field::JointF, &[0.0; 9]);
    run.step();
    let mut expected = vec![3; 20];
    expected[7] = 1;
    assert_eq!(steps(&run), expected);
}

/// Status, steps and velocities of every world, frame by frame, of a ball that is pushed harder the larger the world's number.
fn pushed(faults: Faults, worlds: usize) -> Vec<(Vec<f64>, Vec<u64>, Vec<f64>)> {
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.gravity = [0.0; 3];
    let mut ball = Body::new("ball", Pose::identity());
    let shape = Collision::new(None, Shape::Sphere { radius: 0.1 }, Pose::identity());
    ball.shapes.push((shape, 240.0));
    scene.add_body(ball).unwrap();
    let model = scene.compile().unwrap();
    let options = Options {
        worlds,
        threads: Some(1),
        fields: vec![Field::JointQd],
        faults,
        ..Options::default()
    };
    let mut run = Run::new(&model, options);
    let mut rows = vec![0.0; worlds * 6];
    for world in 0..worlds {
        rows[world * 6] = 0.5 * world as f64;
    }
    let steps = |run: &Run| -> Vec<u64> {
        let slots = &run.sim.layout().slots;
        let slot = slots.iter().find(|slot| slot.field == Field::Step).unwrap();
        run.arena[slot.offset / 8..slot.offset / 8 + worlds].to_vec()
    };
    (0..40)
        .map(|_| {
            run.sim
                .command(Field::JointF, 0..6, Values::F64(&rows))
                .unwrap();
            run.step();
            let status = (0..worlds).flat_map(|w| run.get(Field::Status, w));
            let qd = (0..worlds).flat_map(|w| run.get(Field::JointQd, w));
            (status.collect(), steps(&run), qd.collect())
        })
        .collect()
}

/// Largest part of a world's velocity.
fn speed(qd: &[f64], world: usize) -> f64 {
    let row = &qd[world * 6..(world + 1) * 6];
    row.iter().fold(0.0, |most, x| most.max(x.abs()))
}

#[test]
fn a_world_beyond_the_bounds_is_frozen_within_them() {
    const BOUND: f64 = 2.0;
    let bounds = Faults {
        joint_qd_max: BOUND,
        ..Faults::default()
    };
    let (free, bound) = (pushed(Faults::default(), 19), pushed(bounds, 19));
    let mut frozen = [false; 19];
    for ((_, _, plain), (status, _, qd)) in free.iter().zip(&bound) {
        for (world, frozen) in frozen.iter_mut().enumerate() {
            *frozen |= speed(plain, world) > BOUND;
            let expected = if *frozen { status::OUT_OF_BOUNDS } else { 0 };
            assert_eq!(status[world], f64::from(expected), "world {world}");
            assert!(speed(qd, world) <= BOUND);
            let row = world * 6..(world + 1) * 6;
            assert!(*frozen || plain[row.clone()] == qd[row]);
        }
    }
    assert!(frozen.contains(&true) && frozen.contains(&false));
}

#[test]
fn a_world_that_is_reset_by_itself_begins_anew() {
    let faults = Faults {
        joint_qd_max: 2.0,
        resets: true,
        ..Faults::default()
    };
    let frames = pushed(faults, 19);
    let mut again = 0;
    for (before, after) in frames.iter().zip(&frames[1..]) {
        for world in 0..19 {
            if before.0[world] == f64::from(status::OUT_OF_BOUNDS) {
                assert_eq!(
                    (after.0[world], after.1[world]),
                    (0.0, 1),
                    "it has made a step since"
                );
                // as in its first frame
                let row = world * 6..(world + 1) * 6;
                assert_eq!(after.2[row.clone()], frames[0].2[row]);
                again += 1;
            }
        }
    }
    assert!(again > 3);
}

#[test]
fn bounds_that_no_world_keeps_are_refused() {
    let model = lesson_with_table(Demo::Torque, false).compile().unwrap();
    for value in [0.0, -1.0, f64::NAN] {
        let faults = Faults {
            joint_q_max: value,
            ..Faults::default()
        };
        let options = Options {
            faults,
            ..Options::default()
        };
        let error = Simulation::new(model.clone(), &options).err().unwrap();
        assert!(error.to_string().starts_with("the bound of joint_q is"));
    }
}

#[test]
fn worlds_that_are_frozen_are_counted_once() {
    const WORLDS: usize = 100;
    let model = lesson_with_table(Demo::Torque, false).compile().unwrap();
    let dofs = model.dofs();
    for (resets, threads) in [(false, 1), (false, 2), (true, 2)] {
        let faults = Faults {
            joint_qd_max: 5.0,
            resets,
            ..Faults::default()
        };
        let options = Options {
            worlds: WORLDS,
            threads: Some(threads),
            faults,
            ..Options::default()
        };
        let mut run = Run::new(&model, options);
        let strike = |run: &mut Run, torque: f64, struck: &[usize]| {
            let mut rows = vec![0.0; WORLDS * dofs];
            for world in struck {
                rows[world * dofs] = torque;
            }
            let dofs = 0..dofs;
            run.sim
                .command(Field::JointF, dofs, Values::F64(&rows))
                .unwrap();
            run.step();
        };
        strike(&mut run, 0.0, &[]);
        assert_eq!(run.sim.take_frozen(), Frozen::default());
        strike(&mut run, 1e4, &[40, 70]);
        strike(&mut run, blow(Precision::F32), &[3, 40, 99]);
        let first = FirstFrozen {
            frame: 2,
            world: 40,
            steps: 1,
            is_finite: true,
        };
        // a world that stays frozen is not counted again, one that was reset is
        let expected = Frozen {
            not_finite: if resets { 3 } else { 2 },
            out_of_bounds: 2,
            first: Some(first),
            now: if resets { 0 } else { 4 },
        };
        assert_eq!(
            run.sim.take_frozen(),
            expected,
            "{threads} threads, resets: {resets}"
        );
        strike(&mut run, 0.0, &[]);
        run.forward();
        assert_eq!(run.sim.take_frozen(), Frozen::default());
    }
}

#[test]
fn a_world_whose_rotation_is_lost_is_frozen_and_a_write_leaves_its_rotations_alone() {
    let mut scene = Description::new(1.0 / 480.0, 2);
    for name in ["top", "other"] {
        let mut body = Body::new(name, Pose::identity());
        body.mass = Some(1.0);
        scene.add_body(body).unwrap();
    }
    let model = scene.compile().unwrap();
    for (lanes, precision) in machines() {
        // spins from those that a step survives to those whose square is infinite, one per world
        let most = blow(precision).log10();
        let spins: Vec<f64> = (0..WORLDS)
            .map(|world| 10f64.powf(most * world as f64 / WORLDS as f64))
            .collect();
        let options = Options {
            worlds: WORLDS,
            precision,
            lanes,
            threads: Some(1),
            fields: FIELDS[..3].to_vec(),
            ..Options::default()
        };
        let mut run = Run::new(&model, options);
        run.sim
            .write(Field::JointQd, 4..5, Values::F64(&spins), None)
            .unwrap();
        let places: Vec<f64> = (0..3 * WORLDS).map(|k| k as f64).collect();
        let mut frozen = 0;
        for _ in 0..4 {
            run.step();
            for world in 0..WORLDS {
                let rotation = &run.get(Field::JointQ, world)[3..7];
                let square: f64 = rotation.iter().map(|x| x * x).sum();
                assert!((square - 1.0).abs() < 1e-5, "world {world}: {rotation:?}");
                frozen += usize::from(run.get(Field::Status, world)[0] > 0.0);
            }
            // of the other body
            run.sim
                .write(Field::JointQ, 7..10, Values::F64(&places), None)
                .unwrap();
        }
        assert!(0 < frozen && frozen < 4 * WORLDS, "{frozen}");
    }
}

//! Bookkeeping of worlds: episodes, parameters, snapshots, faults, delays. The CPU's bits, wherever no step lies between.

use crate::common::drawn;
use crate::common::{Demo, Run, command, lesson, lesson_with_table, shapes::shapes};
use crate::{assert_alive, gpu, options, run};
use sim_engine::backend::Values;
use sim_engine::simulation::{Device, Faults, Options, Precision};
use sim_model::{Cone, Model};
use sim_physics::arrays::{Field, status};
use sim_physics::constants::params::Param;
use std::sync::Arc;

const WORLDS: usize = 70;

/// Does the same on both backends. Then a frame of each shows the same state, and both snapshots are the same bytes.
fn both(model: &Arc<Model>, options: &Options, what: impl Fn(&mut Run)) -> [Run; 2] {
    let runs = [gpu(), Device::Cpu].map(|device| {
        let mut run = Run::new(
            model,
            Options {
                device,
                ..options.clone()
            },
        );
        what(&mut run);
        run.forward();
        run
    });
    assert_alive(&runs[0]);
    assert!(runs[0].sim.snapshot() == runs[1].sim.snapshot());
    runs
}

#[test]
fn starts_that_are_drawn_resets_with_masks_and_seeds_and_writes_are_the_cpus() {
    let model = drawn::model();
    let options = drawn::options(
        WORLDS,
        Precision::F32,
        sim_engine::simulation::Lanes::Auto,
        1,
    );
    let mask: Vec<bool> = (0..WORLDS).map(|w| w % 3 == 1).collect();
    let seeds: Vec<u64> = (0..WORLDS as u64).map(|w| w * w).collect();
    both(&model, &options, |_| {});
    both(&model, &options, |run| {
        run.sim.reset(None, Some(&[7])).unwrap()
    });
    both(&model, &options, |run| {
        run.sim.reset(Some(&mask), None).unwrap();
        run.sim.reset(None, Some(&seeds)).unwrap();
        run.sim.reset(Some(&mask), None).unwrap();
        let coords = run.sim.model().coords();
        let q: Vec<f64> = (0..WORLDS * coords)
            .map(|k| 0.3 + 0.01 * k as f64)
            .collect();
        run.sim
            .write(Field::JointQ, 0..coords, Values::F64(&q), Some(&mask))
            .unwrap();
    });
}

#[test]
fn parameters_are_written_read_and_reach_the_next_step() {
    let mut scene = lesson(Demo::Target);
    scene.params = [Param::Gravity, Param::JointDamping].into();
    let model = scene.compile().unwrap();
    let mask: Vec<bool> = (0..WORLDS).map(|w| w % 2 == 1).collect();
    let gravity: Vec<f64> = (0..WORLDS).flat_map(|w| [0.0, 0.0, -(w as f64)]).collect();
    let options = options(gpu(), WORLDS, &[Field::JointQ, Field::BiasForce]);
    let [mut here, mut there] = both(&model, &options, |run| {
        run.sim
            .write_param(Param::Gravity, 0..3, Values::F64(&gravity), Some(&mask))
            .unwrap();
    });
    for run in [&mut here, &mut there] {
        run.step();
    }
    assert_eq!(
        here.sim.param(Param::Gravity).unwrap(),
        there.sim.param(Param::Gravity).unwrap()
    );
    for world in 0..WORLDS {
        let (a, b) = (
            here.get(Field::BiasForce, world),
            there.get(Field::BiasForce, world),
        );
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 1e-3, "world {world}: {a} {b}");
        }
    }
    assert!(
        here.get(Field::BiasForce, 69)[1].abs()
            > 5.0 * here.get(Field::BiasForce, 0)[1].abs() - 1.0
    );
}

#[test]
fn a_load_waits_for_the_frame_and_a_later_write_of_it_counts_as_on_the_cpu() {
    let mut scene = lesson(Demo::Target);
    scene.params = [Param::BodyF].into();
    let model = scene.compile().unwrap();
    let columns = Param::BodyF.columns(&model.sizes());
    let loads: Vec<f32> = (0..WORLDS * columns).map(|k| 0.1 * k as f32).collect();
    let later: Vec<f32> = (0..WORLDS * 3).map(|k| -(k as f32)).collect();
    let mask: Vec<bool> = (0..WORLDS).map(|w| w % 3 == 1).collect();
    let options = options(gpu(), WORLDS, &[Field::JointQ]);
    let runs = both(&model, &options, |run| {
        run.sim
            .command(Param::BodyF, 0..columns, Values::F32(&loads))
            .unwrap();
        run.sim
            .write_param(Param::BodyF, 0..3, Values::F32(&later), Some(&mask))
            .unwrap();
    });
    let [here, there] = runs.map(|run| run.sim.param(Param::BodyF).unwrap());
    assert_eq!(here, there);
    assert_eq!(here[columns], -3.0);
    assert_eq!(here[0], 0.0);
    assert_eq!(here[3], f64::from(loads[3]));
}

#[test]
fn a_run_resumes_from_a_snapshot_bit_for_bit_and_takes_the_cpus() {
    let model = lesson(Demo::Target).compile().unwrap();
    let fields = [Field::JointQ, Field::JointQd];
    let mut first = run(&model, gpu(), WORLDS, &fields);
    let advance = |run: &mut Run, from: usize, to: usize| {
        for frame in from..to {
            let (field, row) = command(Demo::Target, frame);
            run.command(field, &row);
            run.step();
        }
    };
    advance(&mut first, 0, 5);
    let kept = first.sim.snapshot();
    advance(&mut first, 5, 9);
    let end = first.sim.snapshot();
    let mut second = run(&model, gpu(), WORLDS, &fields);
    advance(&mut second, 0, 2);
    second.sim.restore(&kept, None, None).unwrap();
    assert!(second.sim.snapshot() == kept);
    advance(&mut second, 5, 9);
    assert!(second.sim.snapshot() == end);
    // the processor goes on from there, and back
    let mut there = run(&model, Device::Cpu, WORLDS, &fields);
    there.sim.restore(&end, None, None).unwrap();
    assert!(there.sim.snapshot() == end);
    advance(&mut there, 9, 10);
    advance(&mut second, 9, 10);
    for (a, b) in there
        .get(Field::JointQ, 3)
        .iter()
        .zip(second.get(Field::JointQ, 3))
    {
        assert!((a - b).abs() < 1e-5);
    }
    second.sim.restore(&end, None, Some(4)).unwrap();
    second.forward();
    assert_eq!(second.get(Field::JointQ, 0), second.get(Field::JointQ, 69));
    assert_alive(&second);
}

/// Statuses, steps and joint positions of every world, frame by frame, where some worlds are struck once.
fn struck(device: Device, faults: Faults) -> Vec<Vec<[f64; 2]>> {
    let model = lesson(Demo::Torque).compile().unwrap();
    let options = Options {
        faults,
        ..options(device, WORLDS, &[Field::JointQ])
    };
    let mut run = Run::new(&model, options);
    let mut records = Vec::new();
    for frame in 0..6 {
        let (_, row) = command(Demo::Torque, frame);
        let mut rows: Vec<f64> = (0..WORLDS).flat_map(|_| row.iter().copied()).collect();
        if frame == 2 {
            rows[9 * 5..9 * 6].fill(1e38);
            rows[9 * 64..9 * 65].fill(1e38);
            // fast, but finite
            rows[9 * 30 + 3] = 3e3;
        }
        run.sim
            .command(Field::JointF, 0..9, Values::F64(&rows))
            .unwrap();
        run.step();
        assert_alive(&run);
        let world = |w| [run.get(Field::Status, w)[0], run.get(Field::Step, w)[0]];
        records.push((0..WORLDS).map(world).collect());
        for w in 0..WORLDS {
            assert!(run.get(Field::JointQ, w).iter().all(|x| x.is_finite()));
        }
    }
    let frozen = run.sim.take_frozen();
    records.push(vec![
        [frozen.not_finite as f64, frozen.out_of_bounds as f64];
        1
    ]);
    records
}

#[test]
fn faulted_worlds_are_frozen_or_reset_as_on_the_cpu() {
    for resets in [false, true] {
        let faults = Faults {
            joint_qd_max: 50.0,
            resets,
            ..Faults::default()
        };
        let here = struck(gpu(), faults);
        assert_eq!(here, struck(Device::Cpu, faults), "resets: {resets}");
        let counted = here.last().unwrap()[0];
        assert_eq!(counted, [2.0, 1.0]);
        let expected = if resets {
            0.0
        } else {
            f64::from(status::NOT_FINITE)
        };
        assert_eq!(here[5][5][0], expected);
    }
}

#[test]
fn contacts_that_do_not_fit_are_counted_as_on_the_cpu() {
    let mut scene = shapes(Cone::Pyramidal);
    scene.contacts_max = Some(5);
    let model = scene.compile().unwrap();
    let frames = [gpu(), Device::Cpu].map(|device| {
        let mut run = run(&model, device, 8, &[Field::ContactCount, Field::JointQ]);
        let mut counts = Vec::new();
        for _ in 0..30 {
            run.step();
            counts.push((
                run.get(Field::Status, 7),
                run.get(Field::ContactsLeftOut, 7),
                run.get(Field::ContactCount, 7),
            ));
        }
        assert_alive(&run);
        counts
    });
    assert!(
        frames[0]
            .iter()
            .any(|(status, ..)| status[0] == f64::from(status::CONTACTS_LEFT_OUT))
    );
    // until rounding lets a contact begin a frame earlier
    let equal = frames[0]
        .iter()
        .zip(&frames[1])
        .take_while(|(a, b)| a == b)
        .count();
    println!("{equal} frames alike: {:?}", &frames[0][..30]);
    assert!(equal >= 10, "{equal} frames alike");
}

#[test]
fn a_cube_on_a_table_stays_there() {
    let model = lesson_with_table(Demo::Target, true).compile().unwrap();
    let mut run = run(&model, gpu(), 3, &[Field::JointQ, Field::ContactCount]);
    for _ in 0..20 {
        run.step();
    }
    assert_alive(&run);
    assert!((run.get(Field::JointQ, 2)[11] - 0.125).abs() < 2e-3);
    assert_eq!(run.get(Field::ContactCount, 2), [4.0]);
}

#[test]
fn commands_come_late_and_noisy_as_on_the_cpu() {
    let mut scene = lesson(Demo::Target);
    scene.command_delay_max = Some(20);
    scene.params = [
        Param::CommandDelay,
        Param::JointTargetQNoise,
        Param::JointQNoise,
    ]
    .into();
    let model = scene.compile().unwrap();
    let fields = [Field::JointQ, Field::JointQd, Field::JointQMeasured];
    let runs = [gpu(), Device::Cpu].map(|device| {
        let mut run = run(&model, device, WORLDS, &fields);
        let delay: Vec<f64> = (0..WORLDS).map(|w| 0.3 * w as f64 % 20.0).collect();
        let noise = vec![0.01; WORLDS * 9];
        for (param, n, values) in [
            (Param::CommandDelay, 1, &delay),
            (Param::JointTargetQNoise, 9, &noise),
            (Param::JointQNoise, 9, &noise),
        ] {
            run.sim
                .write_param(param, 0..n, Values::F64(values), None)
                .unwrap();
        }
        let mut seen = Vec::new();
        for frame in 0..6 {
            let (field, row) = command(Demo::Target, 20 * frame);
            run.command(field, &row);
            run.step();
            let all = (0..WORLDS).flat_map(|w| fields.map(|field| run.get(field, w)).concat());
            seen.push(all.collect::<Vec<f64>>());
        }
        assert!(run.sim.lost().is_none());
        seen
    });
    for (frame, (here, there)) in runs[0].iter().zip(&runs[1]).enumerate() {
        for (a, b) in here.iter().zip(there) {
            assert!((a - b).abs() < 1e-4, "frame {frame}: {a} {b}");
        }
    }
    let measured = &runs[0][5][18..27];
    assert!(
        measured
            .iter()
            .zip(&runs[0][5][..9])
            .any(|(a, b)| (a - b).abs() > 1e-3)
    );
}

#[test]
fn a_snapshot_has_the_commands_that_no_frame_has_taken_yet() {
    let model = lesson(Demo::Target).compile().unwrap();
    let options = options(gpu(), WORLDS, &[Field::JointQ]);
    let [here, there] = both(&model, &options, |_| {});
    let kept = [here, there].map(|mut run| {
        let goal: Vec<f32> = (0..WORLDS * 9).map(|k| 0.01 * k as f32).collect();
        run.sim
            .command(Field::JointTargetQ, 0..9, Values::F32(&goal))
            .unwrap();
        let kept = run.sim.snapshot();
        run.step();
        assert!(run.sim.lost().is_none());
        kept
    });
    assert!(kept[0] == kept[1]);
}

#[test]
fn a_scene_in_which_nothing_moves_runs() {
    let mut scene = sim_model::Description::new(0.01, 4);
    scene.add_ground("ground", 0.0);
    let model = scene.compile().unwrap();
    let mut run = run(&model, gpu(), 3, Field::ALL);
    run.sim.reset(None, Some(&[1])).unwrap();
    run.step();
    run.step();
    let kept = run.sim.snapshot();
    run.sim.restore(&kept, None, None).unwrap();
    run.forward();
    assert_alive(&run);
    assert_eq!(run.get(Field::Step, 2), [2.0]);
    assert_eq!(run.get(Field::Time, 0), [0.08]);
}

//! A world's result, bit for bit, whatever runs beside it.

mod common;

use common::{Demo, Run, command, lesson, noise};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Description, Model, UrdfOptions};
use sim_physics::arrays::Field;
use std::sync::Arc;

const FIELDS: [Field; 6] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::BodyQ,
    Field::MassMatrix,
    Field::EfcForce,
];

/// The lesson, and the same with a narrow range of the first joint as its only constraint: some worlds are
/// within it, for whom the solver does nothing, while others beside them bounce off its ends.
fn models(demo: Demo) -> [Arc<Model>; 2] {
    let mut limited = lesson(demo);
    let mut half_range = Some(0.2);
    for joint in &mut limited.robots[0].joints {
        if joint.range.is_some() {
            joint.range = half_range.take().map(|x| [joint.q[0] - x, joint.q[0] + x]);
            joint.mimic = None;
            joint.dofs[0].friction = 0.0;
        }
    }
    [lesson(demo), limited].map(|scene| scene.compile().unwrap())
}

/// Does a constraint act in the last frame of a run? Its last field is the forces of the rows.
fn is_constrained(model: &Model, bits: &[u64]) -> bool {
    bits[bits.len() - model.rows()..]
        .iter()
        .any(|&force| f64::from_bits(force) != 0.0)
}

/// Bits of all fields of each world after some frames; world w starts and is driven by `seeds[w]`.
fn run(
    model: &Arc<Model>,
    demo: Demo,
    seeds: &[usize],
    lanes: Lanes,
    threads: usize,
    precision: Precision,
) -> Vec<Vec<u64>> {
    let worlds = seeds.len();
    let options = Options {
        worlds,
        precision,
        threads: Some(threads),
        lanes,
        fields: FIELDS.to_vec(),
        ..Options::default()
    };
    let mut run = Run::new(model, options);
    let rows = |scale: f64, base: &dyn Fn(usize) -> f64, salt: usize| -> Vec<f64> {
        seeds
            .iter()
            .flat_map(|&s| (0..9).map(move |j| (s, j)))
            .map(|(s, j)| base(j) + scale * noise(s, salt + j))
            .collect()
    };
    // starts so far apart that some worlds meet limits, others do not
    let q = rows(0.6, &|j| common::START[j], 0);
    run.sim
        .write(Field::JointQ, 0..9, Values::F64(&q), None)
        .unwrap();
    let qd = rows(1.0, &|_| 0.0, 100);
    run.sim
        .write(Field::JointQd, 0..9, Values::F64(&qd), None)
        .unwrap();
    for frame in 0..12 {
        let (field, row) = command(demo, frame);
        let values = rows(0.3, &|j| row[j], 1000 * (frame + 1));
        run.sim.command(field, 0..9, Values::F64(&values)).unwrap();
        run.step();
    }
    (0..worlds)
        .map(|w| {
            FIELDS
                .iter()
                .flat_map(|&f| run.get(f, w))
                .map(f64::to_bits)
                .collect()
        })
        .collect()
}

#[test]
fn world_alone_equals_the_same_world_among_others_at_any_position() {
    for (demo, precision) in [
        (Demo::Torque, Precision::F32),
        (Demo::Target, Precision::F32),
        (Demo::Target, Precision::F64),
    ] {
        for model in models(demo) {
            let many: Vec<usize> = (0..67).collect();
            let together = run(&model, demo, &many, Lanes::Auto, 1, precision);
            let backwards: Vec<usize> = many.iter().rev().copied().collect();
            let moved = run(&model, demo, &backwards, Lanes::Auto, 1, precision);
            for world in 0..67 {
                assert_eq!(
                    together[world],
                    moved[66 - world],
                    "{demo:?}: world {world} elsewhere"
                );
            }
            for world in [0, 15, 16, 66] {
                let alone = run(&model, demo, &[world], Lanes::Auto, 1, precision);
                assert_eq!(together[world], alone[0], "{demo:?}: world {world} alone");
            }
        }
    }
}

#[test]
fn worlds_with_and_without_active_constraints_run_side_by_side_here() {
    for demo in [Demo::Torque, Demo::Target] {
        let [_, limited] = models(demo);
        let seeds: Vec<usize> = (0..16).collect();
        let block = run(&limited, demo, &seeds, Lanes::Auto, 1, Precision::F32);
        let constrained = block.iter().filter(|bits| is_constrained(&limited, bits));
        let constrained = constrained.count();
        assert!(0 < constrained && constrained < 16, "{constrained} of 16");
    }
}

#[test]
fn two_threads_equal_one() {
    let model = lesson(Demo::Target).compile().unwrap();
    let seeds: Vec<usize> = (0..300).collect();
    let one_thread = run(&model, Demo::Target, &seeds, Lanes::Auto, 1, Precision::F32);
    let two_threads = run(&model, Demo::Target, &seeds, Lanes::Auto, 2, Precision::F32);
    assert!(one_thread == two_threads);
}

#[test]
fn scalar_equals_eight_equals_sixteen_worlds_a_block() {
    let seeds: Vec<usize> = (0..40).collect();
    for demo in [Demo::Torque, Demo::Target] {
        for model in models(demo) {
            let scalar = run(&model, demo, &seeds, Lanes::Scalar, 1, Precision::F32);
            for lanes in [Lanes::Eight, Lanes::Sixteen] {
                if cpu::available(lanes) {
                    let wide = run(&model, demo, &seeds, lanes, 1, Precision::F32);
                    assert!(scalar == wide, "{demo:?} {lanes:?}");
                } else {
                    println!("skipped: this processor has no {lanes:?}");
                }
            }
        }
    }
}

/// Bits of the state of each world of a robot of every joint, whose accelerations are refined.
fn run_every_joint(seeds: &[usize], lanes: Lanes) -> Vec<Vec<u64>> {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("r")
    };
    let urdf = common::repo("sim-core/stages/recorded/tests/record_stages/every_joint.urdf");
    scene.add_urdf(urdf, options).unwrap();
    let model = scene.compile().unwrap();
    assert!(model.constants().solver.refinements > 0);
    let fields = vec![
        Field::JointQ,
        Field::JointQd,
        Field::JointQdd,
        Field::EfcForce,
    ];
    let options = Options {
        worlds: seeds.len(),
        precision: Precision::F32,
        threads: Some(1),
        lanes,
        fields: fields.clone(),
        ..Options::default()
    };
    let mut run = Run::new(&model, options);
    for (field, columns) in [
        (Field::JointQ, model.coords()),
        (Field::JointQd, model.dofs()),
    ] {
        let rows = seeds
            .iter()
            .flat_map(|&s| (0..columns).map(move |k| noise(s, k)));
        let rows: Vec<f64> = rows.collect();
        run.sim
            .write(field, 0..columns, Values::F64(&rows), None)
            .unwrap();
    }
    for _ in 0..6 {
        run.step();
    }
    (0..seeds.len())
        .map(|world| {
            let numbers = fields.iter().flat_map(|&field| run.get(field, world));
            numbers.map(f64::to_bits).collect()
        })
        .collect()
}

#[test]
fn robot_of_every_joint_moves_alike_in_every_lane_and_width() {
    let seeds: Vec<usize> = (0..40).collect();
    let scalar = run_every_joint(&seeds, Lanes::Scalar);
    assert!(
        scalar
            .iter()
            .flatten()
            .all(|&bits| f64::from_bits(bits).is_finite())
    );
    for lanes in [Lanes::Eight, Lanes::Sixteen] {
        if cpu::available(lanes) {
            assert!(scalar == run_every_joint(&seeds, lanes), "{lanes:?}");
        } else {
            println!("skipped: this processor has no {lanes:?}");
        }
    }
    for world in [0, 17, 39] {
        assert_eq!(
            scalar[world],
            run_every_joint(&[world], Lanes::Auto)[0],
            "world {world} alone"
        );
    }
}

#[test]
fn fields_that_are_asked_for_do_not_change_the_motion() {
    let [lesson, limited] = models(Demo::Target);
    let motion = |model: &Arc<Model>, fields: &[Field]| {
        let options = Options {
            fields: fields.to_vec(),
            threads: Some(1),
            ..Options::default()
        };
        let mut run = Run::new(model, options);
        for frame in 0..20 {
            let (field, row) = command(Demo::Target, frame);
            run.command(field, &row);
            run.step();
            if frame % 3 == 0 {
                run.forward();
            }
        }
        run.get(Field::JointQ, 0)
            .iter()
            .map(|q| q.to_bits())
            .collect::<Vec<_>>()
    };
    for model in [lesson, limited] {
        assert_eq!(motion(&model, &[Field::JointQ]), motion(&model, Field::ALL));
    }
}

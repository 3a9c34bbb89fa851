//! Parameters that a reset draws: their distributions, what a draw depends on, whom it leaves alone, and what it moves.

#[path = "../common/mod.rs"]
mod common;

mod motion;

use common::{Demo, Run, command, lesson_with_table};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Description, Distribution, Model};
use sim_physics::arrays::Field;
use sim_physics::constants::params::{NO_LIMIT, Param};
use std::sync::Arc;

const FIELDS: [Field; 4] = [
    Field::JointQ,
    Field::JointQd,
    Field::MassMatrix,
    Field::ContactForce,
];

fn uniform(low: f64, high: f64) -> Distribution {
    Distribution::Uniform { low, high }
}

fn normal(mean: f64, std: f64) -> Distribution {
    Distribution::Normal { mean, std }
}

/// The arm over a table with a cube on it.
fn plain() -> Description {
    lesson_with_table(Demo::Target, true)
}

fn range(scene: &mut Description, param: Param, name: &str, distribution: Distribution) {
    let ranges = scene.param_ranges.entry(param).or_default();
    ranges.insert(name.to_owned(), distribution);
}

/// The same, with something drawn of parameters of every kind.
fn drawn() -> Description {
    let mut scene = plain();
    range(&mut scene, Param::Gravity, "z", normal(-9.81, 0.1));
    range(&mut scene, Param::BodyMassScale, "arm", uniform(0.9, 1.1));
    range(
        &mut scene,
        Param::BodyMassScale,
        "arm/fr3_link3",
        normal(1.0, 0.2),
    );
    range(&mut scene, Param::JointArmature, "arm", uniform(0.05, 0.2));
    range(
        &mut scene,
        Param::JointDamping,
        "arm/fr3_joint1",
        uniform(0.0, 2.0),
    );
    range(
        &mut scene,
        Param::JointTargetKe,
        "arm",
        uniform(1000.0, 4000.0),
    );
    range(&mut scene, Param::JointTargetKd, "arm", normal(200.0, 10.0));
    range(
        &mut scene,
        Param::JointEffortLimit,
        "arm",
        uniform(40.0, 90.0),
    );
    range(&mut scene, Param::ShapeMu, "cube/0", uniform(0.1, 1.0));
    range(&mut scene, Param::ShapeMu, "table", normal(0.5, 0.1));
    scene
}

fn options(worlds: usize, precision: Precision, lanes: Lanes, threads: usize) -> Options {
    common::options(&FIELDS, worlds, precision, lanes, threads)
}

fn launched(model: &Arc<Model>, worlds: usize, precision: Precision) -> Run {
    Run::new(model, options(worlds, precision, Lanes::Auto, 1))
}

/// All parameters of each world, one after the other.
fn params(run: &Run) -> Vec<Vec<f64>> {
    let worlds = run.sim.worlds();
    let mut rows = vec![Vec::new(); worlds];
    for param in run.sim.model().constants().varying.params() {
        let numbers = run.sim.param(param).unwrap();
        for (row, numbers) in rows
            .iter_mut()
            .zip(numbers.chunks_exact(numbers.len() / worlds))
        {
            row.extend_from_slice(numbers);
        }
    }
    rows
}

/// A column of a parameter, in every world.
fn column(run: &Run, param: Param, column: usize) -> Vec<f64> {
    let numbers = run.sim.param(param).unwrap();
    let columns = param.columns(&run.sim.model().sizes());
    numbers.into_iter().skip(column).step_by(columns).collect()
}

fn place(names: &[String], name: &str) -> usize {
    names.iter().position(|other| other == name).unwrap()
}

/// Bits of all fields of a world.
fn bits(run: &Run, world: usize) -> Vec<u64> {
    let fields = FIELDS.iter().flat_map(|&field| run.get(field, world));
    fields.map(f64::to_bits).collect()
}

/// Some frames of the demo, the same in every world.
fn play(run: &mut Run, frames: usize) {
    for frame in 0..frames {
        let (field, row) = command(Demo::Target, frame);
        let mut all = row.to_vec();
        all.resize(run.sim.model().dofs(), 0.0);
        run.command(field, &all);
        run.step();
    }
}

#[test]
fn numbers_are_drawn_as_the_scene_says() {
    const WORLDS: usize = 4096;
    let model = drawn().compile().unwrap();
    let run = launched(&model, WORLDS, Precision::F64);
    let (dofs, bodies, shapes) = (model.dof_names(), model.body_names(), model.shape_names());
    let [first, second] = ["arm/fr3_joint1", "arm/fr3_joint2"].map(|name| place(dofs, name));
    let [link, wrist] = ["arm/fr3_link3", "arm/fr3_link6"].map(|name| place(bodies, name));
    let [cube, table] = ["cube/0", "table"].map(|name| place(shapes, name));
    for (param, index, distribution) in [
        (Param::Gravity, 2, normal(-9.81, 0.1)),
        (Param::BodyMassScale, wrist, uniform(0.9, 1.1)),
        (Param::BodyMassScale, link, normal(1.0, 0.2)),
        (Param::JointArmature, second, uniform(0.05, 0.2)),
        (Param::JointDamping, first, uniform(0.0, 2.0)),
        (Param::JointTargetKe, second, uniform(1000.0, 4000.0)),
        (Param::JointTargetKd, first, normal(200.0, 10.0)),
        (Param::JointEffortLimit, first, uniform(40.0, 90.0)),
        (Param::ShapeMu, cube, uniform(0.1, 1.0)),
        (Param::ShapeMu, table, normal(0.5, 0.1)),
    ] {
        let values = column(&run, param, index);
        let n = WORLDS as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        // 4.5 standard errors are passed by one sample in 100 000; kurtosis is 9/5 and 3
        let (center, expected, kurtosis) = match distribution {
            Distribution::Uniform { low, high } => {
                assert!(values.iter().all(|x| (low..=high).contains(x)), "{param:?}");
                let reached = values.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b))
                    - values.iter().fold(f64::INFINITY, |a, &b| a.min(b));
                assert!(reached > 0.99 * (high - low), "{param:?}");
                ((low + high) / 2.0, (high - low).powi(2) / 12.0, 1.8)
            }
            Distribution::Normal { mean, std } => (mean, std * std, 3.0),
        };
        let errors = (mean - center).abs() / (expected / n).sqrt();
        assert!(errors < 4.5, "{param:?}: the mean is {errors} errors off");
        let errors = (variance / expected - 1.0).abs() / ((kurtosis - 1.0) / n).sqrt();
        assert!(
            errors < 4.5,
            "{param:?}: the variance is {errors} errors off"
        );
    }
    // what has no range is the scene's
    let arm = &plain().robots[0];
    let damping = arm.joints.iter().find(|joint| joint.name == "fr3_joint2");
    let damping = damping.unwrap().dofs[0].damping;
    assert!(
        column(&run, Param::JointDamping, second)
            .iter()
            .all(|&x| x == damping)
    );
    let free = place(dofs, "cube/free.vx");
    assert!(
        column(&run, Param::JointEffortLimit, free)
            .iter()
            .all(|&x| x == NO_LIMIT)
    );
    assert!(column(&run, Param::Gravity, 0).iter().all(|&x| x == 0.0));
}

#[test]
fn a_draw_is_the_same_for_any_number_of_worlds_lanes_threads_and_precision() {
    let model = drawn().compile().unwrap();
    let mut reference = launched(&model, 4096, Precision::F64);
    reference.sim.reset(None, Some(&[77])).unwrap();
    let many = params(&reference);
    let rounded: Vec<Vec<f64>> = many
        .iter()
        .map(|row| row.iter().map(|&x| f64::from(x as f32)).collect())
        .collect();
    for worlds in [1, 17, 4096] {
        for (lanes, precision, threads) in [
            (Lanes::Scalar, Precision::F64, 2),
            (Lanes::Scalar, Precision::F32, 1),
            (Lanes::Eight, Precision::F32, 2),
            (Lanes::Sixteen, Precision::F32, 2),
        ] {
            if !cpu::available(lanes) {
                println!("skipped: this processor has no {lanes:?}");
                continue;
            }
            let mut run = Run::new(&model, options(worlds, precision, lanes, threads));
            run.sim.reset(None, Some(&[77])).unwrap();
            let expected = if precision == Precision::F64 {
                &many
            } else {
                &rounded
            };
            assert!(
                params(&run) == expected[..worlds],
                "{worlds} worlds, {lanes:?}"
            );
        }
    }
}

#[test]
fn a_seed_gives_the_same_episodes_again_and_each_another_draw() {
    let model = drawn().compile().unwrap();
    let mut run = launched(&model, 20, Precision::F32);
    let mut seen = vec![params(&run)];
    for _ in 0..3 {
        play(&mut run, 1);
        run.sim.reset(None, None).unwrap();
        seen.push(params(&run));
    }
    for (episode, rows) in seen.iter().enumerate() {
        for other in &seen[..episode] {
            assert!(rows.iter().zip(other).all(|(a, b)| a != b), "{episode}");
        }
    }
    // a launch is episode 0 of seed 0
    run.sim.reset(None, Some(&[0])).unwrap();
    assert!(params(&run) == seen[0]);
    for rows in &seen[1..] {
        run.sim.reset(None, None).unwrap();
        assert!(params(&run) == *rows);
    }
}

#[test]
fn a_range_of_another_parameter_joint_or_start_moves_no_draw() {
    let mut few = plain();
    range(&mut few, Param::ShapeMu, "cube/0", uniform(0.1, 1.0));
    range(
        &mut few,
        Param::JointTargetKd,
        "arm/fr3_joint4",
        normal(200.0, 10.0),
    );
    let mut many = drawn();
    for joint in &mut many.robots[0].joints {
        joint
            .dofs
            .iter_mut()
            .for_each(|dof| dof.offset_q = Some(uniform(-0.1, 0.1)));
        if joint.mimic.is_some() {
            joint.dofs.iter_mut().for_each(|dof| dof.offset_q = None);
        }
    }
    let [few, many] = [few, many].map(|scene| scene.compile().unwrap());
    let joint = place(few.dof_names(), "arm/fr3_joint4");
    let cube = place(few.shape_names(), "cube/0");
    let [few, many] = [few, many].map(|model| launched(&model, 50, Precision::F64));
    for (param, index) in [(Param::ShapeMu, cube), (Param::JointTargetKd, joint)] {
        assert_eq!(column(&few, param, index), column(&many, param, index));
    }
}

#[test]
fn a_partial_reset_draws_in_its_worlds_alone() {
    let model = drawn().compile().unwrap();
    for (precision, lanes) in [
        (Precision::F32, Lanes::Auto),
        (Precision::F32, Lanes::Scalar),
        (Precision::F64, Lanes::Auto),
    ] {
        let mask: Vec<bool> = (0..45).map(|world| world % 7 == 3 || world == 44).collect();
        let [mut left, mut reset] = [0; 2].map(|_| {
            let mut run = Run::new(&model, options(45, precision, lanes, 2));
            play(&mut run, 16);
            run
        });
        reset.sim.reset(Some(&mask), None).unwrap();
        for (world, (a, b)) in params(&left).iter().zip(&params(&reset)).enumerate() {
            assert_eq!(a != b, mask[world], "world {world}");
        }
        for frame in 0..3 {
            left.step();
            reset.step();
            for (world, &is_reset) in mask.iter().enumerate() {
                let differs = bits(&left, world) != bits(&reset, world);
                assert_eq!(differs, is_reset, "world {world}, frame {frame}");
            }
        }
    }
}

#[test]
fn what_is_written_holds_until_the_next_reset_where_there_is_a_range() {
    let model = drawn().compile().unwrap();
    let mut run = launched(&model, 6, Precision::F64);
    let dofs = model.dofs();
    let before = run.sim.param(Param::JointDamping).unwrap();
    let written = vec![7.0; 6 * dofs];
    run.sim
        .write_param(Param::JointDamping, 0..dofs, Values::F64(&written), None)
        .unwrap();
    play(&mut run, 2);
    assert_eq!(run.sim.param(Param::JointDamping).unwrap(), written);
    let mask = [true, false, true, false, false, false];
    run.sim.reset(Some(&mask), None).unwrap();
    let drawn = place(model.dof_names(), "arm/fr3_joint1");
    let after = run.sim.param(Param::JointDamping).unwrap();
    for (place, &x) in after.iter().enumerate() {
        let (world, dof) = (place / dofs, place % dofs);
        let is_drawn = mask[world] && dof == drawn;
        assert_eq!(x != 7.0, is_drawn, "world {world}, dof {dof}");
        assert!(
            !is_drawn || x != before[place],
            "another episode, another draw"
        );
    }
}

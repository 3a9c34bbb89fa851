//! What drawn numbers do to the motion of a world.

use crate::common::Run;
use crate::{bits, column, drawn, launched, normal, options, place, plain, play, range, uniform};
use sim_engine::backend::Values;
use sim_engine::simulation::{Faults, Lanes, Precision};
use sim_model::{Body, Description, Pose, TargetMode};
use sim_physics::arrays::{Field, status};
use sim_physics::constants::params::Param;

#[test]
fn drawn_numbers_move_worlds_as_the_same_numbers_written_do() {
    let model = drawn().compile().unwrap();
    let mut writable = plain();
    writable.params.extend(drawn().param_ranges.keys());
    let writable = writable.compile().unwrap();
    for (precision, lanes) in [
        (Precision::F32, Lanes::Auto),
        (Precision::F32, Lanes::Scalar),
        (Precision::F64, Lanes::Scalar),
    ] {
        let mut run = Run::new(&model, options(19, precision, lanes, 1));
        let mut by_hand = Run::new(&writable, options(19, precision, lanes, 1));
        for episode in 0..2 {
            for param in model.constants().varying.params() {
                let columns = 0..param.columns(&model.sizes());
                let numbers = run.sim.param(param).unwrap();
                by_hand
                    .sim
                    .write_param(param, columns, Values::F64(&numbers), None)
                    .unwrap();
            }
            // from the first step on, and through contacts
            for frames in [1, 30] {
                play(&mut run, frames);
                play(&mut by_hand, frames);
                let differ: Vec<usize> = (0..19)
                    .filter(|&world| bits(&run, world) != bits(&by_hand, world))
                    .collect();
                assert!(differ.is_empty(), "episode {episode}, worlds {differ:?}");
                assert!(
                    bits(&run, 0) != bits(&run, 1),
                    "worlds differ from one another"
                );
            }
            run.sim.reset(None, None).unwrap();
            by_hand.sim.reset(None, None).unwrap();
        }
    }
}

#[test]
fn drawn_gravity_counts_from_the_first_step() {
    let mut scene = Description::new(1.0 / 480.0, 4);
    let mut ball = Body::new("ball", Pose::identity());
    ball.mass = Some(2.0);
    scene.add_body(ball).unwrap();
    range(&mut scene, Param::Gravity, "z", uniform(-12.0, -6.0));
    let model = scene.compile().unwrap();
    let mut run = launched(&model, 8, Precision::F64);
    let vz = place(model.dof_names(), "ball/free.vz");
    for _ in 0..2 {
        let gravity = column(&run, Param::Gravity, 2);
        run.step();
        let fallen = model.dt() * model.substeps() as f64;
        for (world, gravity) in gravity.into_iter().enumerate() {
            // a rounding a substep, of a velocity below 1/8 m/s
            let error = (run.get(Field::JointQd, world)[vz] - gravity * fallen).abs();
            assert!(error < f64::EPSILON, "world {world}: {error}");
        }
        run.sim.reset(None, None).unwrap();
    }
}

#[test]
fn a_world_that_is_reset_by_itself_draws_too() {
    let mut scene = plain();
    range(&mut scene, Param::ShapeMu, "cube/0", uniform(0.1, 1.0));
    let model = scene.compile().unwrap();
    let cube = place(model.shape_names(), "cube/0");
    let mut options = options(9, Precision::F32, Lanes::Auto, 1);
    options.fields.push(Field::Status);
    options.faults = Faults {
        joint_qd_max: 5.0,
        resets: true,
        ..Faults::default()
    };
    let mut run = Run::new(&model, options.clone());
    let mut asked = Run::new(&model, options);
    let before = column(&run, Param::ShapeMu, cube);
    let mut push = vec![0.0; 9 * model.dofs()];
    // the cube, of 50 g, is shot away in world 4
    push[4 * model.dofs() + place(model.dof_names(), "cube/free.vx")] = 1e3;
    let dofs = 0..model.dofs();
    run.sim
        .command(Field::JointF, dofs, Values::F64(&push))
        .unwrap();
    run.step();
    assert_eq!(
        run.get(Field::Status, 4),
        [f64::from(status::OUT_OF_BOUNDS)]
    );
    let after = column(&run, Param::ShapeMu, cube);
    for world in 0..9 {
        assert_eq!(after[world] != before[world], world == 4, "world {world}");
    }
    asked.sim.reset(None, None).unwrap();
    assert_eq!(
        after[4],
        column(&asked, Param::ShapeMu, cube)[4],
        "as a reset draws"
    );
}

#[test]
fn normal_draws_below_the_least_are_the_least() {
    let mut scene = plain();
    range(&mut scene, Param::ShapeMu, "cube", normal(0.0, 1.0));
    range(
        &mut scene,
        Param::BodyMassScale,
        "arm/fr3_link3",
        normal(0.5, 1.0),
    );
    let model = scene.compile().unwrap();
    let cube = place(model.shape_names(), "cube/0");
    let link = place(model.body_names(), "arm/fr3_link3");
    let mut run = launched(&model, 1000, Precision::F32);
    for (param, index, least) in [
        (Param::ShapeMu, cube, 0.0),
        (Param::BodyMassScale, link, f64::from(1e-3f32)),
    ] {
        let values = column(&run, param, index);
        assert!(values.iter().all(|&x| x >= least));
        let clamped = values.iter().filter(|&&x| x == least).count();
        assert!((200..600).contains(&clamped), "{param:?}: {clamped}");
    }
    play(&mut run, 3);
    assert!(run.get(Field::JointQ, 0).iter().all(|x| x.is_finite()));
}

#[test]
fn a_drive_that_follows_velocities_may_keep_its_gain_of_0() {
    let mut scene = plain();
    let arm = &mut scene.robots[0];
    let joint = arm
        .joints
        .iter_mut()
        .find(|joint| joint.name == "fr3_joint2");
    joint.unwrap().dofs[0].target_mode = TargetMode::Velocity;
    range(
        &mut scene,
        Param::JointTargetKe,
        "arm",
        uniform(1000.0, 4000.0),
    );
    let refused = scene.compile().unwrap_err().to_string();
    assert_eq!(
        refused,
        "randomize: joint_target_ke of `arm`: the drive of `arm/fr3_joint2` follows velocity targets only; give that joint Uniform(0, 0), or another target mode"
    );
    range(
        &mut scene,
        Param::JointTargetKe,
        "arm/fr3_joint2",
        uniform(0.0, 0.0),
    );
    let model = scene.compile().unwrap();
    let run = launched(&model, 5, Precision::F64);
    let joint = place(model.dof_names(), "arm/fr3_joint2");
    assert_eq!(column(&run, Param::JointTargetKe, joint), [0.0; 5]);
    assert!(
        column(&run, Param::JointTargetKe, joint + 1)
            .iter()
            .all(|&x| x >= 1000.0)
    );
}

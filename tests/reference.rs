//! The lesson's demos against the recorded runs of MuJoCo C (tests/data/README.md).

mod common;

use common::recorded::{self, worst};
use common::{Demo, FRAMES, Run, lesson, lesson_with_table};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::Description;
use sim_physics::arrays::Field;

fn run(scene: &Description, precision: Precision) -> Run {
    let options = Options {
        precision,
        lanes: if precision == Precision::F64 {
            Lanes::Scalar
        } else {
            Lanes::Auto
        },
        threads: Some(1),
        fields: vec![Field::JointQ, Field::JointQd],
        ..Options::default()
    };
    Run::new(&scene.compile().unwrap(), options)
}

/// Distance in joint positions from the recorded run, a frame.
fn deviations_of(scene: &Description, demo: Demo, file: &str, precision: Precision) -> Vec<f64> {
    recorded::deviations(&mut run(scene, precision), demo, file, FRAMES)
}

fn deviations(demo: Demo, file: &str, precision: Precision) -> Vec<f64> {
    deviations_of(&lesson(demo), demo, file, precision)
}

/// Distances in joint positions and in the cube's position from the recorded grasp, a frame.
fn grasp_deviations(precision: Precision) -> [Vec<f64>; 2] {
    let scene = lesson_with_table(Demo::Target, true);
    recorded::grasp_deviations(&mut run(&scene, precision))
}

#[test]
fn target_demo_in_f64_stays_within_1e_7_of_mujoco() {
    let d = deviations(Demo::Target, "tests/data/mujoco_target.csv", Precision::F64);
    assert!(worst(&d, FRAMES) < 1e-7, "{:e}", worst(&d, FRAMES));
}

#[test]
fn target_demo_in_f32_stays_within_2e_6_of_mujoco() {
    let d = deviations(Demo::Target, "tests/data/mujoco_target.csv", Precision::F32);
    assert!(worst(&d, FRAMES) < 2e-6, "{:e}", worst(&d, FRAMES));
}

#[test]
fn free_torque_demo_in_f64_stays_near_mujoco() {
    let d = deviations(
        Demo::Torque,
        "tests/data/mujoco_torque_free.csv",
        Precision::F64,
    );
    assert!(worst(&d, 60) < 1e-7, "{:e}", worst(&d, 60));
    assert!(worst(&d, 120) < 1e-5, "{:e}", worst(&d, 120));
}

#[test]
fn free_torque_demo_in_f32_stays_near_mujoco() {
    let d = deviations(
        Demo::Torque,
        "tests/data/mujoco_torque_free.csv",
        Precision::F32,
    );
    assert!(worst(&d, 30) < 5e-6, "{:e}", worst(&d, 30));
    assert!(worst(&d, 60) < 5e-5, "{:e}", worst(&d, 60));
    assert!(worst(&d, 120) < 1e-2, "{:e}", worst(&d, 120));
}

/// In frame 14 the fingers touch the table, and from there it is chaotic.
const TOUCHES: usize = 13;

fn torque_over_table(precision: Precision) -> Vec<f64> {
    let scene = lesson_with_table(Demo::Torque, false);
    deviations_of(
        &scene,
        Demo::Torque,
        "tests/data/mujoco_torque.csv",
        precision,
    )
}

#[test]
fn torque_demo_over_the_table_in_f64_is_mujocos_until_it_touches() {
    let d = torque_over_table(Precision::F64);
    assert!(worst(&d, TOUCHES) < 1e-7, "{:e}", worst(&d, TOUCHES));
}

#[test]
fn torque_demo_over_the_table_in_f32_is_mujocos_until_it_touches() {
    let d = torque_over_table(Precision::F32);
    assert!(worst(&d, TOUCHES) < 2e-6, "{:e}", worst(&d, TOUCHES));
}

#[test]
fn grasp_demo_in_f64_stays_within_5e_7_of_mujoco_until_the_fingers_close() {
    let [joints, cube] = grasp_deviations(Precision::F64);
    for d in [joints, cube] {
        println!(
            "{:e} to frame 90, {:e} to the end",
            worst(&d, 89),
            worst(&d, FRAMES - 1)
        );
        assert!(worst(&d, 89) < 5e-7, "{:e}", worst(&d, 89));
    }
}

#[test]
fn grasp_demo_in_f32_stays_within_1e_4_of_mujoco_to_the_end() {
    let [joints, cube] = grasp_deviations(Precision::F32);
    assert!(worst(&joints, 89) < 5e-6, "{:e}", worst(&joints, 89));
    assert!(
        worst(&joints, FRAMES - 1) < 1e-4,
        "{:e}",
        worst(&joints, FRAMES - 1)
    );
    assert!(
        worst(&cube, FRAMES - 1) < 2e-4,
        "{:e}",
        worst(&cube, FRAMES - 1)
    );
}

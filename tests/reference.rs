//! The lesson's demos against the recorded runs of MuJoCo C (tests/data/README.md).

mod common;

use common::{Demo, FRAMES, Run, command, csv, distance, lesson, repo};
use sim_core::batch::Field;
use sim_core::simulation::{Lanes, Options, Precision};

/// Distance in joint positions from the recorded run, a frame.
fn deviations(demo: Demo, file: &str, precision: Precision) -> Vec<f64> {
    let model = lesson(demo).compile().unwrap();
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
    let mut run = Run::new(&model, options);
    run.forward();
    let recorded = csv(repo(file));
    let mut found = vec![distance(&run.get(Field::JointQ, 0), &recorded[0][1..10])];
    for frame in 0..FRAMES {
        let (field, row) = command(demo, frame);
        run.command(field, &row);
        run.step();
        found.push(distance(
            &run.get(Field::JointQ, 0),
            &recorded[frame + 1][1..10],
        ));
    }
    found
}

fn worst(deviations: &[f64], to_frame: usize) -> f64 {
    deviations[..=to_frame].iter().copied().fold(0.0, f64::max)
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

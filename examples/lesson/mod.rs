//! The first lesson (NVIDIA Newton, "Controlling a Robot") as a scene and its commands, without contacts:
//! what the Rust twin of the lesson, the tests and the benches share.

use sim_model::{Description, Pose, Robot, UrdfOptions};
use sim_physics::arrays::Field;

/// Start of the lesson, joints 1..7 and fingers [rad, m]; the fingers start outside their range.
pub const START: [f64; 9] = [
    -3.6802115e-3,
    2.3901723e-2,
    3.6804110e-3,
    -2.3683236,
    -1.2918962e-4,
    2.3922248,
    7.8549200e-1,
    0.05,
    0.05,
];
/// Control frames of a demo.
pub const FRAMES: usize = 180;

/// Which of the lesson's demos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demo {
    /// Gains 0, a torque on joint 3.
    Torque,
    /// Position targets.
    Target,
}

/// The lesson's scene (Newton, "Controlling a Robot"), without contacts.
pub fn lesson(demo: Demo) -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let options = UrdfOptions {
        name: Some("arm".into()),
        pose: Pose::at([-0.5, -0.5, 0.1]),
        ..UrdfOptions::default()
    };
    // within the program, so that it runs without this repository; `add_urdf` reads a file
    let text = include_str!("../assets/fr3/fr3_franka_hand.urdf");
    let arm = Robot::from_urdf_text(text, "fr3_franka_hand.urdf", options)
        .expect("the project's own robot loads");
    let arm = scene.add_robot(arm).expect("the only robot");
    // the reference runs start from float32 values
    let start = START.map(|q| f64::from(q as f32));
    arm.set_joint_q(&start).unwrap();
    let ke = [
        4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0, 100.0, 100.0,
    ];
    if demo == Demo::Target {
        arm.set_joint_target_ke(&ke).unwrap();
        arm.set_joint_target_kd(&ke.map(|k| k / 10.0)).unwrap();
    }
    arm.set_joint_effort_limit(&[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0, 100.0, 100.0])
        .unwrap();
    arm.set_joint_armature(&[0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074, 0.1, 0.1])
        .unwrap();
    scene
}

/// The command of a frame of a demo, one robot.
pub fn command(demo: Demo, frame: usize) -> (Field, [f64; 9]) {
    let phase = (2.0 * std::f64::consts::PI * frame as f64 / 180.0).sin();
    match demo {
        Demo::Torque => {
            let mut torque = [0.0; 9];
            torque[2] = f64::from((35.0 * phase) as f32);
            (Field::JointF, torque)
        }
        Demo::Target => {
            let mut target = START.map(|q| q as f32);
            target[3] = (f64::from(target[3]) + 0.4 * phase) as f32;
            (target[7], target[8]) = (0.04, 0.04);
            (Field::JointTargetQ, target.map(f64::from))
        }
    }
}

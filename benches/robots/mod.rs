//! Floating robots without contacts, each joint driven to a target that swings about the middle of its
//! range; benches/physics/legged.py is the same in Python, with a swing of each world's own.
#![allow(dead_code)] // each bench uses its part

use sim_model::{Description, JointKind, Robot, UrdfOptions};

/// Control frames of a run.
pub const FRAMES: usize = 100;
/// Stiffness [N·m/rad], damping [N·m·s/rad] and armature [kg·m²] of every drive.
const DRIVE: [f64; 3] = [60.0, 2.0, 0.01];
/// Swing of a target, as a share of half the joint's range.
const SWING: f64 = 0.5;

/// A robot on a floating base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// Four legs of three joints: 18 dofs.
    Quadruped,
    /// Waist, legs and arms of one, six and five joints: 29 dofs.
    Humanoid23,
    /// Of three, six and seven: 35 dofs.
    Humanoid29,
}

/// Joints of the humanoid that are locked where it has 23.
const LOCKED: [&str; 4] = ["waist_roll", "waist_pitch", "wrist_pitch", "wrist_yaw"];

impl Case {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Case::Quadruped => "quadruped",
            Case::Humanoid23 => "humanoid_23",
            Case::Humanoid29 => "humanoid_29",
        }
    }

    /// The robot in a scene of its own, at 400 steps and 50 control frames a second.
    pub fn scene(self) -> Description {
        // within the program, so that a bench runs without this repository
        let text = match self {
            Case::Quadruped => include_str!("quadruped.urdf"),
            Case::Humanoid23 | Case::Humanoid29 => include_str!("humanoid.urdf"),
        };
        let options = UrdfOptions {
            floating: true,
            ..UrdfOptions::named("robot")
        };
        let mut scene = Description::new(1.0 / 400.0, 8);
        let robot = Robot::from_urdf_text(text, "robot.urdf", options).expect("the robot loads");
        let robot = scene.add_robot(robot).expect("the only robot");
        for joint in &mut robot.joints {
            let locked = LOCKED.iter().any(|name| joint.name.ends_with(name));
            if self == Case::Humanoid23 && locked {
                joint.kind = JointKind::Fixed;
                (joint.range, joint.dofs, joint.q) = (None, Vec::new(), Vec::new());
            }
            if let Some([lower, upper]) = joint.range {
                joint.q[0] = 0.5 * (lower + upper);
                let dof = &mut joint.dofs[0];
                [dof.target_ke, dof.target_kd, dof.armature] = DRIVE;
            }
        }
        scene
    }
}

/// Targets of a frame [rad], one per dof; those of the free base are not used.
pub fn targets(robot: &Robot, frame: usize) -> Vec<f64> {
    let seconds = frame as f64 / 50.0;
    let mut targets = Vec::new();
    for index in robot.moving_joints() {
        let joint = &robot.joints[index];
        let Some([lower, upper]) = joint.range else {
            targets.extend([0.0; 6]);
            continue;
        };
        // frequencies of 0.3 to 1.3 Hz and phases that never meet again
        let share = (targets.len() as f64 * 0.618_034).fract();
        let angle = std::f64::consts::TAU * ((0.3 + share) * seconds + share);
        targets.push(0.5 * (lower + upper) + SWING * 0.5 * (upper - lower) * angle.sin());
    }
    targets
}

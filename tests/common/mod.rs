//! What several tests share: the lesson's scene, and frames of a simulation as numbers.
#![allow(dead_code)] // each test binary uses its part

use sim_core::backend::Values;
use sim_core::batch::Field;
use sim_core::model::{Description, Model, Pose, UrdfOptions};
use sim_core::simulation::{Lanes, Options, Precision, Simulation};
use std::path::PathBuf;
use std::sync::Arc;

/// Start of the lesson, joints 1..7 and fingers [rad, m]; the fingers start outside their range.
pub const START: [f64; 9] = [
    -3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1,
    0.05, 0.05,
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

/// A path in the repository.
pub fn repo(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The lesson's scene (Newton, "Controlling a Robot"), without contacts.
pub fn lesson(demo: Demo) -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.add_box("table", [0.4, 0.4, 0.05], Pose::at([0.0, -0.5, 0.05]));
    let options = UrdfOptions {
        name: Some("arm".into()),
        pose: Pose::at([-0.5, -0.5, 0.1]),
        ..UrdfOptions::default()
    };
    let arm = scene
        .add_urdf(std::path::PathBuf::from("../shared/reference/fr3_franka_hand/urdf/fr3_franka_hand.urdf"), options)
        .expect("the project's own robot loads");
    // the reference runs start from float32 values
    let start = START.map(|q| f64::from(q as f32));
    arm.set_joint_q(&start).unwrap();
    let ke = [4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0, 100.0, 100.0];
    if demo == Demo::Target {
        arm.set_joint_target_ke(&ke).unwrap();
        arm.set_joint_target_kd(&ke.map(|k| k / 10.0)).unwrap();
    }
    arm.set_joint_effort_limit(&[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0, 100.0, 100.0]).unwrap();
    arm.set_joint_armature(&[0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074, 0.1, 0.1]).unwrap();
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

/// A simulation and the arena of its frames.
pub struct Run {
    /// The simulation.
    pub sim: Simulation,
    /// The last frame.
    pub arena: Vec<u64>,
}

impl Run {
    /// Worlds of a model with these fields.
    pub fn new(model: &Arc<Model>, options: Options) -> Run {
        let sim = Simulation::new(model.clone(), &options).unwrap();
        let arena = vec![0; sim.layout().bytes / 8];
        Run { sim, arena }
    }

    /// One world in f64.
    pub fn reference(model: &Arc<Model>, fields: &[Field]) -> Run {
        let options = Options {
            precision: Precision::F64,
            lanes: Lanes::Scalar,
            threads: Some(1),
            fields: fields.to_vec(),
            ..Options::default()
        };
        Run::new(model, options)
    }

    /// Sets a command to the same row in every world.
    pub fn command(&mut self, field: Field, row: &[f64]) {
        let all: Vec<f64> = (0..self.sim.worlds()).flat_map(|_| row.iter().copied()).collect();
        self.sim.command(field, 0..row.len(), Values::F64(&all)).unwrap();
    }

    /// Sets a part of the state to the same row in every world.
    pub fn write(&mut self, field: Field, row: &[f64]) {
        let all: Vec<f64> = (0..self.sim.worlds()).flat_map(|_| row.iter().copied()).collect();
        self.sim.write(field, 0..row.len(), Values::F64(&all), None).unwrap();
    }

    /// One control frame.
    pub fn step(&mut self) {
        self.sim.step(&mut self.arena);
    }

    /// Evaluates without stepping.
    pub fn forward(&mut self) {
        self.sim.forward(&mut self.arena);
    }

    /// A real-valued field of a world.
    pub fn get(&self, field: Field, world: usize) -> Vec<f64> {
        let slot = self.sim.layout().slots.iter().find(|slot| slot.field == field);
        let slot = slot.expect("the field was asked for");
        let n: usize = slot.shape[1..].iter().product();
        let bytes: Vec<u8> = self.arena.iter().flat_map(|word| word.to_ne_bytes()).collect();
        let size = slot.dtype.bytes();
        let first = slot.offset + world * n * size;
        bytes[first..first + n * size]
            .chunks_exact(size)
            .map(|x| match self.sim.precision() {
                Precision::F32 => f64::from(f32::from_ne_bytes(x.try_into().unwrap())),
                Precision::F64 => f64::from_ne_bytes(x.try_into().unwrap()),
            })
            .collect()
    }
}

/// Rows of a CSV file of numbers, comments left out.
pub fn csv(path: PathBuf) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(',').map(|x| x.trim().parse().unwrap()).collect())
        .collect()
}

/// Largest absolute difference.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

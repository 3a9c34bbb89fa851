//! A scene whose worlds start where they are drawn.

use super::{Run, repo};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Body, Description, Distribution, Model, Pose, UrdfOptions};
use sim_physics::arrays::Field;
use std::sync::Arc;

/// Fields of its frames.
pub const STATE: [Field; 3] = [Field::JointQ, Field::JointQd, Field::JointQdd];

/// A robot of every joint and a body, all of which start where they are drawn; `times` scales the offsets.
pub fn scene(times: f64) -> Description {
    let mut scene = Description::new(1.0 / 480.0, 4);
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("r")
    };
    let urdf = repo("sim-core/stages/recorded/tests/record_stages/every_joint.urdf");
    scene.add_urdf(urdf, options).unwrap();
    let mut body = Body::new("ball", Pose::from_rpy([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]));
    body.mass = Some(0.5);
    scene.add_body(body).unwrap();
    for robot in &mut scene.robots {
        for joint in robot
            .joints
            .iter_mut()
            .filter(|joint| joint.mimic.is_none())
        {
            for (k, dof) in joint.dofs.iter_mut().enumerate() {
                let (low, high) = (-0.1 * times, 0.3 * times);
                let (mean, std) = (0.01, 0.1 * times);
                dof.offset_q = Some(if k % 2 == 0 {
                    Distribution::Uniform { low, high }
                } else {
                    Distribution::Normal { mean, std }
                });
                dof.offset_qd = Some(Distribution::Normal { mean, std });
            }
        }
    }
    scene
}

/// The scene as it is, compiled.
pub fn model() -> Arc<Model> {
    scene(1.0).compile().unwrap()
}

/// How to run it.
pub fn options(worlds: usize, precision: Precision, lanes: Lanes, threads: usize) -> Options {
    Options {
        worlds,
        precision,
        threads: Some(threads),
        lanes,
        fields: STATE.to_vec(),
        ..Options::default()
    }
}

/// A run on one thread, its frame evaluated at the launch.
pub fn launched(model: &Arc<Model>, worlds: usize, precision: Precision) -> Run {
    let mut run = Run::new(model, options(worlds, precision, Lanes::Auto, 1));
    run.forward();
    run
}

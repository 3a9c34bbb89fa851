//! Pairs of shapes that are tested by blocks: contacts are found as pair by pair.

use crate::common::Run;
use crate::{assert_alive, gpu, options};
use sim_engine::backend::Values;
use sim_engine::simulation::{Device, Options};
use sim_model::{Body, Collision, Description, Model, Pose, Robot, Shape, UrdfOptions};
use sim_physics::arrays::Field;
use std::fmt::Write;
use std::sync::Arc;

const FIELDS: [Field; 5] = [
    Field::JointQ,
    Field::ContactCount,
    Field::ContactPos,
    Field::ContactDistance,
    Field::ContactNormal,
];

/// A ball above a row of so many static balls.
pub fn scene(balls: usize) -> Arc<Model> {
    let mut scene = Description::new(1.0 / 240.0, 2);
    let mut urdf = "<robot name=\"row\"><link name=\"base\">".to_owned();
    for ball in 0..balls {
        let x = 0.1 * ball as f64;
        write!(
            urdf,
            "<collision><origin xyz=\"{x} 0 0\"/><geometry><sphere radius=\"0.06\"/></geometry></collision>"
        )
        .unwrap();
    }
    urdf += "</link></robot>";
    let row = Robot::from_urdf_text(&urdf, "row.urdf", UrdfOptions::named("row")).unwrap();
    scene.add_robot(row).unwrap();
    let mut ball = Body::new("ball", Pose::at([0.0, 0.0, 0.1]));
    let shape = Collision::new(None, Shape::Sphere { radius: 0.05 }, Pose::identity());
    ball.shapes.push((shape, 500.0));
    scene.add_body(ball).unwrap();
    scene.compile().unwrap()
}

/// World k has its ball between balls k and k + 1 of the row, and touches both.
fn played(model: &Arc<Model>, device: Device, threads: Option<usize>, worlds: usize) -> Run {
    let options = Options {
        world_threads: threads,
        ..options(device, worlds, &FIELDS)
    };
    let mut run = Run::new(model, options);
    let places: Vec<f64> = (0..worlds)
        .flat_map(|k| [0.1 * k as f64 + 0.05, 0.002, 0.097])
        .collect();
    let values = Values::F64(&places);
    run.sim.write(Field::JointQ, 0..3, values, None).unwrap();
    run.step();
    assert_alive(&run);
    run
}

#[test]
fn contacts_in_any_place_of_a_block_are_those_of_the_cpu() {
    // a block and a pair, whole blocks, and blocks with one pair left over
    for balls in [9, 16, 17] {
        let model = scene(balls);
        let cpu = played(&model, Device::Cpu, None, balls);
        let blocks = played(&model, gpu(), Some(8), balls);
        for world in 0..balls {
            let count = cpu.get(Field::ContactCount, world)[0];
            assert_eq!(
                count,
                if world + 1 < balls { 2.0 } else { 1.0 },
                "world {world}"
            );
            assert_eq!(
                blocks.get(Field::ContactCount, world)[0],
                count,
                "{balls} balls, world {world}"
            );
            for field in FIELDS {
                let both = cpu
                    .get(field, world)
                    .into_iter()
                    .zip(blocks.get(field, world));
                let worst = both.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
                assert!(
                    worst < 1e-5,
                    "{balls} balls, world {world}, {field:?}: {worst:e}"
                );
            }
        }
    }
}

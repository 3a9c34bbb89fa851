//! What `write` looks at of a masked array, and what it leaves.

use sim_engine::backend::{BackendError, Values};
use sim_engine::simulation::{Options, Precision, Simulation};
use sim_model::{Description, UrdfOptions};
use sim_physics::arrays::Field;
use std::path::Path;

const WORLDS: usize = 3;
/// A mask of the world in the middle.
const MIDDLE: [bool; WORLDS] = [false, true, false];

fn simulation() -> Simulation {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../sim-core/stages/recorded/tests/record_stages/every_joint.urdf");
    let mut scene = Description::new(1e-3, 1);
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("r")
    };
    scene
        .add_urdf(path, options)
        .expect("the robot is in the repository");
    let options = Options {
        worlds: WORLDS,
        precision: Precision::F64,
        threads: Some(1),
        fields: vec![Field::JointQ],
        ..Options::default()
    };
    Simulation::new(scene.compile().expect("it compiles"), &options).expect("it fits")
}

/// Positions of all worlds.
fn positions(simulation: &mut Simulation) -> Vec<f64> {
    let mut arena = vec![0; simulation.layout().bytes / 8];
    simulation.forward(&mut arena);
    let slots = &simulation.layout().slots;
    let slot = slots.iter().find(|slot| slot.field == Field::JointQ);
    let first = slot.expect("it was asked for").offset / 8;
    let all = WORLDS * simulation.model().coords();
    arena[first..first + all]
        .iter()
        .map(|&word| f64::from_bits(word))
        .collect()
}

#[test]
fn rows_of_worlds_outside_the_mask_are_not_looked_at() {
    let mut simulation = simulation();
    let before = positions(&mut simulation);
    let coords = simulation.model().coords();
    for nothing in [0.0, f64::NAN, f64::INFINITY] {
        let mut q = vec![nothing; WORLDS * coords];
        let row = coords..2 * coords;
        q[row.clone()].copy_from_slice(&before[row.clone()]);
        q[coords] = 7.0;
        simulation
            .write(Field::JointQ, 0..coords, Values::F64(&q), Some(&MIDDLE))
            .expect("the row of the mask makes sense");
        let after = positions(&mut simulation);
        assert_eq!(after[row.clone()], q[row.clone()]);
        assert_eq!(after[..coords], before[..coords]);
        assert_eq!(after[2 * coords..], before[2 * coords..]);
    }
}

#[test]
fn rows_of_worlds_inside_the_mask_are_refused_by_the_world_they_are_of() {
    let mut simulation = simulation();
    let before = positions(&mut simulation);
    let coords = simulation.model().coords();
    let quaternion = simulation
        .model()
        .constants()
        .quaternions()
        .next()
        .expect("it floats");
    for (value, expected) in [(f64::NAN, "NotFinite"), (0.0, "Quaternion")] {
        let mut q = before.clone();
        q[coords + quaternion..coords + quaternion + 4].fill(value);
        for mask in [Some(MIDDLE.as_slice()), None] {
            let refused = simulation.write(Field::JointQ, 0..coords, Values::F64(&q), mask);
            match (refused, expected) {
                (Err(BackendError::NotFinite { world: 1, .. }), "NotFinite") => {}
                (Err(BackendError::Quaternion { world: 1, .. }), "Quaternion") => {}
                (other, _) => panic!("{value}: {other:?}"),
            }
        }
        assert_eq!(positions(&mut simulation), before, "nothing was written");
    }
}

//! Worlds whose solve goes on in a block of other worlds: the bits of those that stay.

mod common;
#[path = "../benches/robots/mod.rs"]
mod robots;

use common::{Run, noise};
use robots::Case;
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Options, Profile};
use sim_model::{Cone, Model};
use sim_physics::arrays::Field;
use std::sync::Arc;

const FIELDS: [Field; 6] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::ConstraintForce,
    Field::EfcForce,
    Field::Status,
];
/// As many as fill groups of blocks of every width, and a part of one.
const WORLDS: usize = 203;
const FRAMES: usize = 25;

/// The quadruped above the ground.
fn quadruped(cone: Cone) -> Arc<Model> {
    let mut scene = Case::Quadruped.scene();
    scene.add_ground("", -0.32);
    scene.solver.cone = cone;
    scene.compile().unwrap()
}

/// Worlds that fall and kick, each in its own way: their bits, and what the solver did.
fn fall(model: &Arc<Model>, worlds: usize, lanes: Lanes) -> (Vec<Vec<u64>>, Profile) {
    let options = Options {
        worlds,
        lanes,
        threads: Some(1),
        fields: FIELDS.to_vec(),
        ..Options::default()
    };
    let mut run = Run::new(model, options);
    let rows = |columns: usize, scale: f64, salt: usize| -> Vec<f64> {
        let row = |world| (0..columns).map(move |k| scale * noise(world, salt + k));
        (0..worlds).flat_map(row).collect()
    };
    run.sim
        .write(Field::JointQd, 0..18, Values::F64(&rows(18, 1.0, 0)), None)
        .unwrap();
    let mut profile = Profile::new();
    for frame in 0..FRAMES {
        if frame % 5 == 0 {
            let targets = rows(12, 0.8, 1000 * (frame + 1));
            run.sim
                .command(Field::JointTargetQ, 6..18, Values::F64(&targets))
                .unwrap();
        }
        assert!(run.sim.step_profiled(&mut run.arena, &mut profile));
    }
    let world = |world| {
        let numbers = FIELDS.iter().flat_map(|&field| run.get(field, world));
        // a zero may have either sign on ARM, see `touching.rs`
        numbers.map(|x| (x + 0.0).to_bits()).collect()
    };
    ((0..worlds).map(world).collect(), profile)
}

#[test]
fn gathered_worlds_have_the_bits_of_worlds_by_themselves() {
    for cone in [Cone::Pyramidal, Cone::Elliptic] {
        let model = quadruped(cone);
        let (alone, profile) = fall(&model, WORLDS, Lanes::Scalar);
        assert_eq!(profile.moves, 0);
        for lanes in [Lanes::Eight, Lanes::Sixteen] {
            if !cpu::available(lanes) {
                continue;
            }
            let (gathered, profile) = fall(&model, WORLDS, lanes);
            assert!(profile.moves > WORLDS as u64, "{} moves", profile.moves);
            for world in 0..WORLDS {
                assert_eq!(
                    alone[world], gathered[world],
                    "{cone:?}, {lanes:?}, world {world}"
                );
            }
        }
    }
}

#[test]
fn more_of_the_iterations_are_needed_where_worlds_are_gathered() {
    if !cpu::available(Lanes::Eight) {
        return;
    }
    let model = quadruped(Cone::Elliptic);
    // few blocks wait for their slowest world instead
    let (_, few) = fall(&model, 24, Lanes::Eight);
    let (_, many) = fall(&model, WORLDS, Lanes::Eight);
    assert_eq!(few.moves, 0);
    let [few, many] = [few, many].map(|profile| profile.lane_iterations.share().unwrap());
    assert!(
        many > few,
        "{many} of the iterations are needed, {few} in few blocks"
    );
}

//! Contacts that are millions of times as stiff as what they move: the solver adds them to the factor of the mass matrix.

mod common;
#[path = "../benches/robots/mod.rs"]
mod robots;

use common::{Run, noise, options};
use robots::Case;
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Precision};
use sim_model::{Cone, Model};
use sim_physics::arrays::{Field, status};
use std::sync::Arc;

const FIELDS: [Field; 6] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::EfcForce,
    Field::ContactCount,
    Field::Status,
];
/// As many as fill groups of blocks of every width, and a part of one.
const WORLDS: usize = 70;
const FRAMES: usize = 40;

/// The quadruped above the ground, whose legs may touch each other. Friction is
/// 10⁶ times as stiff as the robot is heavy.
fn quadruped(cone: Cone) -> Arc<Model> {
    let mut scene = Case::Quadruped.scene();
    scene.robots[0].self_collisions = true;
    scene.add_ground("", -0.32);
    scene.solver.cone = cone;
    // pyramids have the stiffness of double precision up to some 2e4
    scene.solver.impratio = match cone {
        Cone::Elliptic => 1e5,
        Cone::Pyramidal => 1e4,
    };
    scene.compile().unwrap()
}

fn run(model: &Arc<Model>, precision: Precision, lanes: Lanes) -> Run {
    let mut run = Run::new(model, options(&FIELDS, WORLDS, precision, lanes, 1));
    let speeds = rows(18, 1.0, 0);
    run.sim
        .write(Field::JointQd, 0..18, Values::F64(&speeds), None)
        .unwrap();
    run
}

fn rows(columns: usize, scale: f64, salt: usize) -> Vec<f64> {
    let row = |world| (0..columns).map(move |k| scale * noise(world, salt + k));
    (0..WORLDS).flat_map(row).collect()
}

/// Targets of a frame, which change every fifth.
fn targets(frame: usize) -> Vec<f64> {
    rows(12, 0.8, 1000 * (frame / 5 + 1))
}

fn frame(run: &mut Run, frame: usize) {
    let targets = targets(frame);
    run.sim
        .command(Field::JointTargetQ, 6..18, Values::F64(&targets))
        .unwrap();
    run.step();
}

#[test]
fn accelerations_of_stiff_contacts_are_those_of_double_precision() {
    for cone in [Cone::Elliptic, Cone::Pyramidal] {
        let model = quadruped(cone);
        let mut single = run(&model, Precision::F32, Lanes::Auto);
        let mut double = run(&model, Precision::F64, Lanes::Auto);
        let (mut compared, mut off, mut unconverged) = (0, 0, 0);
        for n in 0..FRAMES {
            frame(&mut single, n);
            let flags = (0..WORLDS).map(|world| single.get(Field::Status, world)[0] as u32);
            unconverged += flags
                .filter(|flags| flags & status::NOT_CONVERGED != 0)
                .count();
            // both from the same state, under the same targets
            for (field, columns) in [(Field::JointQ, 0..19), (Field::JointQd, 0..18)] {
                let state: Vec<f64> = (0..WORLDS)
                    .flat_map(|world| single.get(field, world))
                    .collect();
                double
                    .sim
                    .write(field, columns, Values::F64(&state), None)
                    .unwrap();
            }
            double
                .sim
                .command(Field::JointTargetQ, 6..18, Values::F64(&targets(n)))
                .unwrap();
            single.forward();
            double.forward();
            for world in 0..WORLDS {
                let touches = double.get(Field::ContactCount, world)[0];
                if touches == 0.0 || touches != single.get(Field::ContactCount, world)[0] {
                    continue;
                }
                let [a, b] = [&single, &double].map(|run| run.get(Field::JointQdd, world));
                let size = b.iter().map(|x| x.abs()).fold(1.0, f64::max);
                compared += 1;
                off += usize::from(common::distance(&a, &b) > 0.01 * size);
            }
        }
        println!("{cone:?}: {off} of {compared} off, {unconverged} frames unconverged");
        assert!(compared > WORLDS * FRAMES / 2, "{compared} states touch");
        assert!(100 * off <= compared, "{cone:?}: {off} of {compared} off");
        assert!(
            100 * unconverged <= WORLDS * FRAMES,
            "{cone:?}: {unconverged} unconverged"
        );
    }
}

#[test]
fn stiff_contacts_give_the_same_bits_at_every_width() {
    for cone in [Cone::Elliptic, Cone::Pyramidal] {
        let model = quadruped(cone);
        let bits = |lanes| {
            let mut run = run(&model, Precision::F32, lanes);
            let mut all = Vec::new();
            for n in 0..FRAMES {
                frame(&mut run, n);
                let worlds =
                    (0..WORLDS).flat_map(|world| FIELDS.map(|field| run.get(field, world)));
                // a zero may have either sign on ARM, see `touching.rs`
                all.extend(worlds.flatten().map(|x| (x + 0.0).to_bits()));
            }
            all
        };
        let alone = bits(Lanes::Scalar);
        for lanes in [Lanes::Eight, Lanes::Sixteen] {
            if cpu::available(lanes) {
                assert!(bits(lanes) == alone, "{cone:?}, {lanes:?}");
            }
        }
    }
}

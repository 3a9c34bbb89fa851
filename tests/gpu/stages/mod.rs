//! Every stage by itself on random states: on a GPU and in registers of the processor, against double precision.
//!
//! All machines are given the same numbers, those that the stages before left in `f32`, so that errors do not add up.

mod compare;
mod cpu;
mod device;
mod worlds;

use crate::common::cases::{self, Case};
use compare::{POSITIONS, errors, list, parts, touches};
use device::Gpu;
use sim_physics::constants::Constants;
use sim_physics::constants::contact::Cone;
use sim_physics::constants::contact::{Kind, PAIR_KINDS};
use sim_physics::step::StageId;
use worlds::{Left, Worlds};

/// How far from double precision a stage may be, in each part of what it leaves.
struct Tolerance {
    /// Largest difference over the largest number of the part.
    near: f64,
    /// Worlds of [`WORLDS`] that may be farther away: where a search takes another way by the last bit.
    beyond: usize,
}

const WORLDS: usize = 128;
/// A GPU may be so many times as far away as the processor, and by this share of the tolerance more.
const TIMES: f64 = 3.0;
const MORE: f64 = 0.125;

/// The tolerance of a stage.
fn tolerance(stage: StageId, part: &str) -> Tolerance {
    let within = |near, beyond| Tolerance { near, beyond };
    if let Some(kinds) = pair(stage) {
        return match kinds {
            // corners cut from faces: the cut divides by how fast an edge leaves the face
            (Kind::Box, Kind::Box) => within(1e-5, 0),
            (Kind::Plane, _) => within(1e-6, 0),
            // walls and rims of cylinders: a search, which ends where `f32` sees no progress; a wall that lies on a face or along
            // another wall may touch it anywhere
            (Kind::Sphere, _) => within(1e-6, 0),
            (Kind::Box, Kind::Cylinder) => within(1e-3, 10),
            // curved everywhere: the direction is good to the root of the search's tolerance
            (_, Kind::Ellipsoid) | (Kind::Ellipsoid, _) => within(5e-3, 2),
            (Kind::Cylinder, Kind::Cylinder) => within(5e-3, 1),
            (_, Kind::Cylinder) | (Kind::Cylinder, _) => within(5e-3, 0),
            _ => within(1e-6, 0),
        };
    }
    match stage.name() {
        // forces of contacts are stiffness times what is left of accelerations that cancel
        "solver" | "solver_turning" => within(2e-3, 4),
        "refine" | "accelerations" => within(1e-5, 0),
        // a matrix that is nearly singular where the arm is stretched
        "site_inverse" => within(1e-4, 0),
        // a rounding of a position is what its rest keeps
        "integrate" if part == POSITIONS => within(3e-8, 0),
        "integrate" => within(1e-5, 0),
        // some roundings of the largest number
        _ => within(1e-6, 0),
    }
}

/// The kinds of shapes that a stage finds the contacts of: `plane_sphere` is of planes and spheres.
fn pair(stage: StageId) -> Option<(Kind, Kind)> {
    let named = |(a, b): &(Kind, Kind)| format!("{a:?}_{b:?}").to_lowercase() == stage.name();
    PAIR_KINDS.into_iter().find(named)
}

/// The stages that a model needs: those of a step, those that show its state, and at last the one that moves it on.
fn order(m: &Constants<f32>) -> Vec<StageId> {
    let needed = StageId::all().filter(|stage| stage.is_needed(m));
    let (moves, others): (Vec<_>, Vec<_>) = needed.partition(|stage| stage.row().runs.moves());
    others.into_iter().chain(moves).collect()
}

/// Compares every stage of a case; on the GPU those that `wanted` names. Returns in how many worlds the shapes of each stage touched.
#[track_caller]
fn compare(case: &Case, wanted: impl Fn(StageId) -> bool) -> Vec<(StageId, usize)> {
    let m = &case.m;
    let exact: Constants<f64> = m.cast();
    let stages = order(m);
    let here: Vec<StageId> = stages.iter().copied().filter(|s| wanted(*s)).collect();
    let gpu = Gpu::new(m, &here, WORLDS);
    let mut worlds = Worlds::random(case, WORLDS);
    // the same from stage to stage in double precision
    let mut ideal = Worlds::random(case, WORLDS);
    let (mut wrong, mut touched) = (Vec::new(), Vec::new());
    for stage in stages {
        let given = worlds.given(stage);
        let scalar = cpu::scalar(m, stage, &given);
        for registers in cpu::registers(m, stage, &given) {
            assert_same(m, stage, &registers, &scalar);
        }
        let ideally = cpu::double(&exact, stage, &ideal.given(stage));
        let reference = match stage.name() {
            // corrects what rounding of the mass matrix did, which is given
            "refine" | "accelerations" if m.solver.refinements > 0 => &ideally,
            "integrate" => &cpu::double(&exact, stage, &worlds.given_uncancelled(m)),
            _ => &cpu::double(&exact, stage, &given),
        };
        let passed_over = worlds.passed_over(m, stage);
        let cpu = errors(m, stage, reference, &scalar, &passed_over);
        let gpu = wanted(stage)
            .then(|| errors(m, stage, reference, &gpu.run(stage, &given), &passed_over));
        for (k, cpu) in cpu.iter().enumerate() {
            let Tolerance { near, beyond } = tolerance(stage, &cpu.part);
            let a = cpu.but_for(beyond);
            let mut is_near = a <= near;
            let mut told = format!("{}: {}: processor {cpu}", stage.name(), cpu.part);
            if let Some(gpu) = gpu.as_ref().map(|parts| &parts[k]) {
                let b = gpu.but_for(beyond);
                is_near &= b <= near && b <= TIMES * a + MORE * near;
                told += &format!("; GPU {gpu}");
            }
            println!("{}: {told}", case.name);
            if !is_near {
                wrong.push(told);
            }
        }
        if let Some(kinds) = pair(stage) {
            let touching = scalar.iter().filter(|left| touches(m, kinds, left));
            touched.push((stage, touching.count()));
        }
        worlds.take(stage, &scalar);
        ideal.take(stage, &ideally);
    }
    assert!(wrong.is_empty(), "{}: {wrong:#?}", case.name);
    touched
}

/// Registers of any width give the bits of the scalar run, in all that is in use.
#[track_caller]
fn assert_same(m: &Constants<f32>, stage: StageId, some: &[Left], others: &[Left]) {
    for (world, (a, b)) in some.iter().zip(others).enumerate() {
        assert_eq!(list(m, a), list(m, b), "{} of world {world}", stage.name());
        for (a, b) in parts(m, stage, a).iter().zip(parts(m, stage, b)) {
            let what = format!("{}: {} of world {world}", stage.name(), b.name);
            assert!(a.numbers == b.numbers, "{what}");
        }
    }
}

#[test]
fn stages_of_an_arm_are_those_of_double_precision() {
    compare(&cases::fr3(), |_| true);
}

#[test]
fn stages_of_every_joint_are_those_of_double_precision() {
    compare(&cases::every_joint(), |_| true);
}

#[test]
fn stages_of_an_arm_with_limits_only_are_those_of_double_precision() {
    compare(&cases::limits_only(), |_| true);
}

#[test]
fn stages_of_every_shape_are_those_of_double_precision() {
    let touched = compare(&cases::shapes(Cone::Elliptic, None), |_| true);
    assert_eq!(touched.len(), PAIR_KINDS.len());
    for (stage, worlds) in touched {
        println!("{} touch in {worlds} worlds", stage.name());
        assert!(
            worlds > tolerance(stage, "").beyond,
            "{}: {worlds}",
            stage.name()
        );
    }
}

#[test]
fn stages_of_too_many_contacts_are_those_of_double_precision() {
    // the searches of cylinders, ellipsoids and hulls are what the test before has compiled for half a minute
    let is_quick = |stage: StageId| match pair(stage) {
        Some((a, b)) => {
            a == Kind::Plane
                || ![Kind::Cylinder, Kind::Ellipsoid, Kind::Hull]
                    .iter()
                    .any(|k| [a, b].contains(k))
        }
        None => true,
    };
    compare(&cases::shapes(Cone::Pyramidal, Some(5)), is_quick);
}

#[test]
fn stages_of_an_arm_at_a_cube_are_those_of_double_precision() {
    // its solver takes as long to compile as all other stages: it is in the next test, and in the grasp
    compare(&cases::arm_and_cube(), |stage| stage.name() != "solver");
}

#[test]
fn stages_where_every_parameter_varies_are_those_of_double_precision() {
    compare(&cases::every_param(), |_| true);
}

//! Checks results before anything is measured.

use crate::agreement;
use crate::arguments::Arguments;
use crate::common::{distance, numbers};
use crate::scenes::{Plan, Scene, WorldSet};
use crate::{Place, options};
use anyhow::{Context, ensure};
use sim_engine::backend::Values;
use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;

/// Joint positions of MuJoCo C's runs, as tests/gpu/agreement.rs reads them.
const TARGET: &str = include_str!("../../tests/data/mujoco_target.csv");
const GRASP: &str = include_str!("../../tests/data/mujoco_grasp.csv");
/// Distance from them [rad, m]: tests/gpu/agreement.rs has the same, and why.
const TARGET_MAX: f64 = 2e-6;
const GRASP_MAX: f64 = 1e-4;
const CUBE_MAX: f64 = 2e-4;
/// Frames of the runs whose bits are compared.
const FRAMES: usize = 12;
/// What runs show.
pub const SHOWN: [Field; 2] = [Field::JointQ, Field::JointQd];

/// Runs all checks of the scenes on an adapter. Worlds must have the same bits alone, among seven, and among each of `check_worlds`.
pub fn check(place: &Place, arguments: &Arguments) -> anyhow::Result<()> {
    for scene in &arguments.scenes {
        let plan = arguments.plan(scene)?;
        if place.cpu_bits {
            agreement::has_cpu_bits(place, &plan)?;
        }
        match scene {
            Scene::Target => follows_target(place, &plan)?,
            Scene::Grasp => follows_grasp(place, &plan)?,
            Scene::File(_) if !place.cpu_bits => agreement::follows_cpu(place, &plan)?,
            _ => {}
        }
        has_same_bits(place, &plan, &arguments.check_worlds)?;
    }
    Ok(())
}

fn follows_target(place: &Place, plan: &Plan) -> anyhow::Result<()> {
    let [target, _] = deviation(place, plan, TARGET)?;
    println!("target demo: within {target:.1e} of MuJoCo C (at most {TARGET_MAX:.0e})");
    ensure!(
        target < TARGET_MAX,
        "the target demo is wrong by {target:e}"
    );
    Ok(())
}

fn follows_grasp(place: &Place, plan: &Plan) -> anyhow::Result<()> {
    let [arm, cube] = deviation(place, plan, GRASP)?;
    println!(
        "grasp: arm within {arm:.1e} (at most {GRASP_MAX:.0e}), cube within {cube:.1e} (at most {CUBE_MAX:.0e})"
    );
    ensure!(arm < GRASP_MAX, "the arm of the grasp is wrong by {arm:e}");
    ensure!(
        cube < CUBE_MAX,
        "the cube of the grasp is wrong by {cube:e}"
    );
    Ok(())
}

/// Compares worlds of the largest number with the same worlds among fewer. Programs are made for a number of worlds.
fn has_same_bits(place: &Place, plan: &Plan, counts: &[usize]) -> anyhow::Result<()> {
    let name = plan.scene.name();
    let many = counts.iter().copied().max().context("a number of worlds")?;
    ensure!(many > 7, "give more than 7 worlds to compare with");
    let last = many - 1;
    let all = bits(place, plan, &WorldSet::all(many))?;
    // from the first to the last, as far apart as they may be
    let spread = |count: usize| (0..count).map(move |k| k * last / (count - 1)).collect();
    let fewer = counts.iter().filter(|count| (2..many).contains(*count));
    let mut sets: Vec<Vec<usize>> = fewer.map(|count| spread(*count)).collect();
    sets.push(vec![last, 2, 0, many / 2, 1, 5, 3]);
    sets.push(vec![last]);
    for ids in &sets {
        let states = bits(place, plan, &WorldSet::some(ids, many))?;
        for (id, state) in ids.iter().zip(states) {
            ensure!(
                state == all[*id],
                "{name}: world {id} of {many} has other bits among {}",
                ids.len()
            );
        }
    }
    ensure!(
        all[0] != all[last],
        "{name}: worlds that differ show the same"
    );
    let among: Vec<String> = sets.iter().rev().map(|ids| ids.len().to_string()).collect();
    println!(
        "{name}: same bits among {} and {many} worlds",
        among.join(", ")
    );
    Ok(())
}

/// Largest distance of world 0 from a recorded run: of the arm, and of the cube's position.
fn deviation(place: &Place, plan: &Plan, recorded: &str) -> anyhow::Result<[f64; 2]> {
    let rows = numbers(recorded);
    let mut worst = [0.0_f64; 2];
    let coords = plan.model.coords();
    let options = options(place, 1, &SHOWN);
    run(
        plan,
        &options,
        &WorldSet::all(1),
        plan.frames(),
        |frame, q| {
            let q: Vec<f64> = q[..coords].iter().map(|x| f64::from(*x)).collect();
            let row = &rows[frame + 1][1..];
            worst[0] = worst[0].max(distance(&q[..9], &row[..9]));
            if q.len() > 9 {
                worst[1] = worst[1].max(distance(&q[9..12], &row[9..12]));
            }
        },
    )?;
    Ok(worst)
}

/// Positions and velocities of each world after some frames.
fn bits(place: &Place, plan: &Plan, crowd: &WorldSet) -> anyhow::Result<Vec<Vec<u32>>> {
    let mut states = Vec::new();
    let (coords, dofs) = (plan.model.coords(), plan.model.dofs());
    let options = options(place, crowd.len(), &SHOWN);
    run(plan, &options, crowd, FRAMES, |_, shown| {
        let (q, qd) = shown.split_at(coords * crowd.len());
        states = (q.chunks_exact(coords).zip(qd.chunks_exact(dofs)))
            .map(|(q, qd)| q.iter().chain(qd).map(|x| x.to_bits()).collect())
            .collect();
    })?;
    Ok(states)
}

/// Runs frames and shows `joint_q` of all worlds, then `joint_qd`.
pub fn run(
    plan: &Plan,
    options: &Options,
    crowd: &WorldSet,
    frames: usize,
    mut observe: impl FnMut(usize, &[f32]),
) -> anyhow::Result<()> {
    let mut sim = Simulation::new(plan.model.clone(), options)
        .with_context(|| format!("{} does not build", plan.scene.name()))?;
    let mut arena = vec![0; sim.layout().bytes / 8];
    plan.start(&mut sim, crowd);
    for (frame, values) in plan.commands(crowd, frames).iter().enumerate() {
        sim.command(plan.field, 0..plan.columns(), Values::F32(values))?;
        sim.step(&mut arena);
        if let Some(lost) = sim.lost() {
            anyhow::bail!("{}: {lost}", plan.scene.name());
        }
        let numbers: &[f32] = bytemuck::cast_slice(&arena);
        let mut shown = Vec::new();
        for slot in (sim.layout().slots.iter()).filter(|slot| SHOWN.contains(&slot.field)) {
            shown.extend_from_slice(&numbers[slot.offset / 4..(slot.offset + slot.bytes) / 4]);
        }
        observe(frame, &shown);
    }
    Ok(())
}

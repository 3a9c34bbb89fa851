//! Scenes of files on an adapter beside the same scenes on the CPU.

use crate::checks::{SHOWN, run};
use crate::scenes::{Plan, WorldSet};
use crate::{Place, options};
use anyhow::ensure;
use sim_engine::simulation::{Device, Options};

/// Worlds that are compared.
const WORLDS: usize = 16;
/// Frames after which they are.
const FRAMES: [usize; 2] = [1, 5];
/// Largest difference of positions after the first frame [m, rad]. Threads of a world add in another order, and quotients and roots of
/// a driver need not be the nearest numbers.
const FIRST_MAX: f32 = 1e-6;

/// Prints how far worlds are from those of the CPU, and how many numbers have the same bits.
pub fn follows_cpu(place: &Place, plan: &Plan) -> anyhow::Result<()> {
    let coords = plan.model.coords() * WORLDS;
    let mut first = 0.0_f32;
    for (frames, [gpu, cpu]) in FRAMES.iter().zip(both(place, plan)?) {
        let apart = |range: std::ops::Range<usize>| {
            let both = gpu[range.clone()].iter().zip(&cpu[range]);
            let largest = |most: f32, (a, b): (&f32, &f32)| match (a - b).abs() {
                // what is no number is infinitely far
                apart if apart.is_nan() => f32::INFINITY,
                apart => most.max(apart),
            };
            both.fold(0.0, largest)
        };
        let (positions, velocities) = (apart(0..coords), apart(coords..gpu.len()));
        if *frames == 1 {
            first = positions;
        }
        println!(
            "{}: after {frames} frames within {positions:.1e} of the CPU (velocities {velocities:.1e}); {:.1} % of the numbers have the same bits",
            plan.scene.name(),
            100.0 * (gpu.len() - differ(&gpu, &cpu)) as f64 / gpu.len() as f64
        );
    }
    ensure!(
        first <= FIRST_MAX,
        "{}: {first:e} from the CPU after a frame (at most {FIRST_MAX:e})",
        plan.scene.name()
    );
    Ok(())
}

/// Compares all numbers with those of the CPU.
pub fn has_cpu_bits(place: &Place, plan: &Plan) -> anyhow::Result<()> {
    let name = plan.scene.name();
    for (frames, [gpu, cpu]) in FRAMES.iter().zip(both(place, plan)?) {
        let (wrong, all) = (differ(&gpu, &cpu), gpu.len());
        ensure!(
            wrong == 0,
            "{name}: {wrong} of {all} numbers differ from the CPU's after {frames} frames"
        );
        println!("{name}: after {frames} frames all {all} numbers are the CPU's");
    }
    Ok(())
}

/// How many numbers have other bits.
fn differ(some: &[f32], others: &[f32]) -> usize {
    let both = some.iter().zip(others);
    both.filter(|(a, b)| a.to_bits() != b.to_bits()).count()
}

/// The states on the adapter and on the CPU, after each number of frames.
fn both(place: &Place, plan: &Plan) -> anyhow::Result<Vec<[Vec<f32>; 2]>> {
    let crowd = WorldSet::all(WORLDS);
    let gpu = states(plan, &crowd, &options(place, WORLDS, &SHOWN))?;
    let on_cpu = Options {
        device: Device::Cpu,
        ..options(place, WORLDS, &SHOWN)
    };
    let cpu = states(plan, &crowd, &on_cpu)?;
    Ok(gpu.into_iter().zip(cpu).map(|(a, b)| [a, b]).collect())
}

/// Positions, then velocities, of all worlds after some frames.
fn states(plan: &Plan, crowd: &WorldSet, options: &Options) -> anyhow::Result<Vec<Vec<f32>>> {
    let mut states = Vec::new();
    run(plan, options, crowd, FRAMES[1], |frame, shown| {
        if FRAMES.contains(&(frame + 1)) {
            states.push(shown.to_vec());
        }
    })?;
    Ok(states)
}

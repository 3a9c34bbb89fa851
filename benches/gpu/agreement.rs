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

/// Prints how far worlds are from those of the CPU, and how many have the same bits.
pub fn follows_cpu(place: &Place, plan: &Plan) -> anyhow::Result<()> {
    let crowd = WorldSet::all(WORLDS);
    let gpu = states(plan, &crowd, &options(place, WORLDS, &SHOWN))?;
    let on_cpu = Options {
        device: Device::Cpu,
        ..options(place, WORLDS, &SHOWN)
    };
    let cpu = states(plan, &crowd, &on_cpu)?;
    let coords = plan.model.coords() * WORLDS;
    let mut first = 0.0_f32;
    for (frames, (gpu, cpu)) in FRAMES.iter().zip(gpu.iter().zip(&cpu)) {
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
        let equal = gpu
            .iter()
            .zip(cpu)
            .filter(|(a, b)| a.to_bits() == b.to_bits());
        println!(
            "{}: after {frames} frames within {positions:.1e} of the CPU (velocities {velocities:.1e}); {:.1} % of the numbers have the same bits",
            plan.scene.name(),
            100.0 * equal.count() as f64 / gpu.len() as f64
        );
    }
    ensure!(
        first <= FIRST_MAX,
        "{}: {first:e} from the CPU after a frame (at most {FIRST_MAX:e})",
        plan.scene.name()
    );
    Ok(())
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

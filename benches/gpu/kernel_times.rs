//! What each program of a frame takes on the device, by its time stamps.

use crate::scenes::{Plan, WorldSet};
use sim_engine::backend::Values;
use sim_engine::simulation::Simulation;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;

/// Frames that do not count.
const WARM_UP: usize = 5;

/// Name of a program, how often it runs in a frame, and its time in each frame [s].
type Times = (String, usize, Vec<f64>);

/// Runs a plan once and prints the programs in the order of their first dispatch; rows go to the file too.
pub fn print(
    sim: &mut Simulation,
    plan: &Plan,
    worlds: usize,
    csv: Option<&Path>,
) -> anyhow::Result<()> {
    let mut words = vec![0; sim.layout().bytes / 8];
    let crowd = WorldSet::all(worlds);
    let mut values = Vec::new();
    let mut programs: Vec<Times> = Vec::new();
    plan.start(sim, &crowd);
    for frame in 0..plan.frames() {
        plan.fill(frame, &crowd, &mut values);
        sim.command(plan.field, 0..plan.model.dofs(), Values::F32(&values))?;
        sim.step(&mut words);
        if frame >= WARM_UP {
            add(&mut programs, &sim.seconds());
        }
    }
    let mut file = csv
        .map(|path| OpenOptions::new().append(true).create(true).open(path))
        .transpose()?;
    let name = plan.scene.name();
    println!("\n{name}, {worlds} worlds: what the device's time stamps say, of a frame");
    println!(
        "{:<24} {:>10} {:>10} {:>10} {:>10}",
        "program", "dispatches", "mean us", "p50 us", "max us"
    );
    let mut whole = 0.0;
    for (label, dispatches, mut times) in programs {
        times.sort_by(f64::total_cmp);
        let mean = 1e6 * times.iter().sum::<f64>() / times.len() as f64;
        let [p50, max] = [times[times.len() / 2], times[times.len() - 1]].map(|x| 1e6 * x);
        whole += mean;
        println!("{label:<24} {dispatches:>10} {mean:>10.1} {p50:>10.1} {max:>10.1}");
        if let Some(file) = &mut file {
            writeln!(
                file,
                "{name},{worlds},{label},{dispatches},{mean:.1},{p50:.1},{max:.1}"
            )?;
        }
    }
    println!("{:<24} {:>10} {whole:>10.1}", "all", "");
    Ok(())
}

/// Adds a frame.
fn add(programs: &mut Vec<Times>, frame: &[(&str, f64)]) {
    let mut seen: Vec<(&str, usize, f64)> = Vec::new();
    for &(label, seconds) in frame {
        match seen.iter_mut().find(|(known, ..)| *known == label) {
            Some((_, count, sum)) => (*count, *sum) = (*count + 1, *sum + seconds),
            None => seen.push((label, 1, seconds)),
        }
    }
    for (label, count, seconds) in seen {
        match programs.iter_mut().find(|(known, ..)| known == label) {
            Some((.., times)) => times.push(seconds),
            None => programs.push((label.to_owned(), count, vec![seconds])),
        }
    }
}

//! What each program of a frame takes on the device, by its time stamps.

use crate::measure::wake;
use crate::scenes::{Plan, WorldSet};
use anyhow::Context;
use sim_engine::backend::Values;
use sim_engine::simulation::Simulation;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// Frames that do not count.
const WARM_UP: usize = 5;

/// Name of a program, how often it runs in a frame, and its time in each frame [s].
type Times = (String, usize, Vec<f64>);

/// Runs a plan once and prints the programs in the order of their first dispatch; rows go to the file too.
pub fn print(sim: &mut Simulation, plan: &Plan, worlds: usize, csv: &Path) -> anyhow::Result<()> {
    let mut words = vec![0; sim.layout().bytes / 8];
    let crowd = WorldSet::all(worlds);
    let commands = plan.commands(&crowd, usize::MAX);
    let mut programs: Vec<Times> = Vec::new();
    let mut host = [0.0; 2];
    plan.start(sim, &crowd);
    wake(sim, &mut words);
    for (frame, values) in commands.iter().enumerate() {
        let begin = Instant::now();
        sim.command(plan.field, 0..plan.columns(), Values::F32(values))?;
        let commanded = Instant::now();
        sim.step(&mut words);
        let done = Instant::now();
        if frame >= WARM_UP {
            add(&mut programs, &sim.seconds());
            host[0] += (commanded - begin).as_secs_f64();
            host[1] += (done - commanded).as_secs_f64();
        }
    }
    anyhow::ensure!(
        !programs.is_empty(),
        "this adapter has no time stamps: --kernel-times needs Vulkan and a queue with a clock"
    );
    let file = OpenOptions::new().append(true).create(true).open(csv);
    let mut file = file.with_context(|| csv.display().to_string())?;
    if file.metadata()?.len() == 0 {
        writeln!(
            file,
            "scene,worlds,program,dispatches,mean_us,p50_us,max_us"
        )?;
    }
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
        writeln!(
            file,
            "{name},{worlds},{label},{dispatches},{mean:.1},{p50:.1},{max:.1}"
        )?;
    }
    println!("{:<24} {:>10} {whole:>10.1}", "all", "");
    let [command, step] = host.map(|sum| 1e6 * sum / (commands.len() - WARM_UP) as f64);
    println!("{:<24} {:>10} {command:>10.1}", "of the host: command", "");
    println!("{:<24} {:>10} {step:>10.1}", "of the host: step", "");
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

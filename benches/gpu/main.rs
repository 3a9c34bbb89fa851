//! Worlds on a GPU: checks their results, then measures their speed beside the CPU of the same computer.
//!
//! One binary that needs a Vulkan driver and nothing else; benches/gpu/run.sh builds it, or takes the one that lies beside it.
//! If a run deviates from MuJoCo's, if bits depend on the number of worlds, or if a device is lost, it prints no results and exits with 1.

mod build_time;
mod checks;
#[path = "../../tests/common/mod.rs"]
mod common;
mod dump;
mod measure;
mod pages;
mod report;
#[path = "../robots/mod.rs"]
mod robots;
mod scenes;

use anyhow::Context;
use clap::Parser;
use measure::Frames;
use pages::Pages;
use report::{Report, Row};
use scenes::{Plan, Scene, WorldSet};
use sim_engine::options::{Adapter, AdapterInfo, Replay, adapters};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_physics::arrays::Field;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What a frame shows while it is measured.
const FIELDS: [Field; 3] = [Field::JointQ, Field::JointQd, Field::BodyQ];

/// Worlds with which replay is compared: so few that commands and counters cost next to nothing beside the batches.
const REPLAY_WORLDS: usize = 64;

/// Checks worlds on a GPU, then measures them.
#[derive(Parser)]
struct Arguments {
    /// Adapter, by index or by part of its name.
    #[arg(long)]
    adapter: Option<String>,
    /// Numbers of worlds.
    #[arg(long, value_delimiter = ',', default_value = "1024,4096,16384,65536")]
    worlds: Vec<usize>,
    /// Scenes.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "torque_free,target,grasp,quadruped"
    )]
    scenes: Vec<Scene>,
    /// How long each is measured at least [s]; whole runs are.
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    /// File for the results.
    #[arg(long)]
    csv: Option<PathBuf>,
    /// Frames are copied by the host, even where the device could write them to their readers.
    #[arg(long)]
    no_import: bool,
    /// The processor is left out.
    #[arg(long)]
    no_cpu: bool,
    /// What else the head of the file says, as `name: value`.
    #[arg(long)]
    fact: Vec<String>,
    /// Writes the kernels of the scenes and states of their runs to this folder, without a GPU: benches/gpu/offline reads them.
    #[arg(long)]
    dump: Option<PathBuf>,
    /// Frames before and after which the states are written.
    #[arg(long, value_delimiter = ',', default_value = "40")]
    frames: Vec<usize>,
    /// Writes the kernels of the software driver, not those of hardware.
    #[arg(long)]
    software: bool,
    /// Threads that share a world, where contacts can be.
    #[arg(long, default_value_t = 8)]
    lanes: usize,
    /// The adapter steps the worlds of the dump, not the CPU.
    #[arg(long)]
    on_adapter: bool,
    /// Only builds the first scene, with its programs in this folder, and tells how long it took [s]: run by `build_time`.
    #[arg(long, hide = true)]
    build_in: Option<PathBuf>,
}

/// Where worlds are kept: an adapter, with a folder for its programs.
pub struct Place {
    adapter: Adapter,
    cache: PathBuf,
    replay: Replay,
}

/// Worlds of that place with these fields.
pub fn options(place: &Place, worlds: usize, fields: &[Field]) -> Options {
    Options {
        worlds,
        device: Device::Gpu {
            adapter: place.adapter.clone(),
            cache: Some(place.cache.clone()),
        },
        replay: place.replay,
        fields: fields.to_vec(),
        ..Options::default()
    }
}

fn main() -> anyhow::Result<()> {
    sim_daemon::environment::complete();
    let arguments = Arguments::parse();
    if let Some(folder) = &arguments.dump {
        return dump::dump(&arguments, folder);
    }
    let info = chosen(arguments.adapter.as_deref())?;
    if let Some(folder) = &arguments.build_in {
        return build_time::build_and_print(&arguments, &info, folder);
    }
    let cache = std::env::temp_dir().join(format!("gpu-bench-{}", std::process::id()));
    let place = Place {
        adapter: Adapter::Index(info.index),
        cache: cache.clone(),
        replay: Replay::Recorded,
    };
    let done = run(&arguments, &info, place);
    let _ = std::fs::remove_dir_all(cache);
    done
}

fn run(arguments: &Arguments, info: &AdapterInfo, place: Place) -> anyhow::Result<()> {
    let mut report = Report::new(info, &arguments.fact);
    checks::check(&place, &arguments.scenes)?;
    report.head();
    for &scene in &arguments.scenes {
        let plan = Plan::new(scene);
        let mut replay = Some(replay(&place, &plan, arguments)?);
        for &worlds in &arguments.worlds {
            let row = measure(arguments, info, &place, &plan, worlds)?;
            // it is the scene's, and stands in its first row
            report.add(Row {
                replay: replay.take(),
                ..row
            });
        }
    }
    report.notes();
    match &arguments.csv {
        Some(path) => report.write(path),
        None => Ok(()),
    }
}

/// The adapter that is meant.
fn chosen(wanted: Option<&str>) -> anyhow::Result<AdapterInfo> {
    let is_meant = |info: &AdapterInfo| match wanted.map(|text| (text, text.parse::<usize>())) {
        None => true,
        Some((_, Ok(index))) => info.index == index,
        Some((name, Err(_))) => info.name.to_lowercase().contains(&name.to_lowercase()),
    };
    let mut found = adapters();
    let names: Vec<&str> = found.iter().map(|info| info.name.as_str()).collect();
    let place = found.iter().position(is_meant);
    let place = place.with_context(|| format!("no such adapter; there are: {names:?}"))?;
    Ok(found.swap_remove(place))
}

/// Builds worlds; also how long it took until they had made a frame [s]: some drivers compile when they run.
fn build(plan: &Plan, options: &Options) -> anyhow::Result<(Simulation, f64)> {
    let since = Instant::now();
    let what = || format!("{} with {} worlds", plan.scene.name(), options.worlds);
    let mut sim = Simulation::new(plan.model.clone(), options).with_context(what)?;
    let mut words = vec![0; sim.layout().bytes / 8];
    sim.step(&mut words);
    Ok((sim, since.elapsed().as_secs_f64()))
}

/// Processor time of the thread that asks for frames [µs], batches recorded and encoded.
fn replay(place: &Place, plan: &Plan, arguments: &Arguments) -> anyhow::Result<[f64; 2]> {
    let wanted = Duration::from_secs_f64(arguments.seconds);
    let crowd = WorldSet::all(REPLAY_WORLDS);
    let mut found = [0.0; 2];
    for (found, replay) in found.iter_mut().zip([Replay::Recorded, Replay::Encoded]) {
        let options = Options {
            replay,
            ..options(place, REPLAY_WORLDS, &FIELDS)
        };
        let (mut sim, _) = build(plan, &options)?;
        let mut words = vec![0; sim.layout().bytes / 8];
        *found = Frames::measure(&mut sim, plan, &crowd, &mut words, wanted)?.thread_us(0.5);
    }
    Ok(found)
}

/// All about a scene with so many worlds, but for its replay.
fn measure(
    arguments: &Arguments,
    info: &AdapterInfo,
    place: &Place,
    plan: &Plan,
    worlds: usize,
) -> anyhow::Result<Row> {
    let [cold_s, cached_s] = build_time::build_twice(info, plan.scene, worlds)?;
    let wanted = Duration::from_secs_f64(arguments.seconds);
    let crowd = WorldSet::all(worlds);
    let options = options(place, worlds, &FIELDS);
    let words = Simulation::layout_of(&plan.model, &options).bytes / 8;
    // before the worlds, so that the pages are there until those are gone
    let mut pages = Pages::new(words)?;
    let mut heap = vec![0; words];
    let (mut sim, _) = build(plan, &options)?;
    let staged = Frames::measure(&mut sim, plan, &crowd, &mut heap, wanted)?;
    // SAFETY: the pages go after the worlds, and no one else has them.
    let imports = !arguments.no_import && unsafe { sim.import(pages.words()) };
    let imported = imports
        .then(|| Frames::measure(&mut sim, plan, &crowd, pages.words(), wanted))
        .transpose()?;
    let programs = sim.programs().to_vec();
    drop(sim);
    let cpu = match arguments.no_cpu {
        true => None,
        false => {
            let options = Options {
                device: Device::Cpu,
                ..options
            };
            let (mut sim, _) = build(plan, &options)?;
            Some(Frames::measure(&mut sim, plan, &crowd, &mut heap, wanted)?)
        }
    };
    Ok(Row {
        scene: plan.scene,
        worlds,
        dofs: plan.model.dofs(),
        substeps: plan.model.substeps(),
        programs,
        cold_s,
        cached_s,
        staged,
        imported,
        replay: None,
        cpu,
    })
}

//! Worlds on a GPU: checks their results, then measures their speed beside the CPU of the same computer.
//!
//! One binary that needs a Vulkan driver and nothing else; benches/gpu/run.sh builds it, or takes the one that lies beside it.
//! If a run deviates from MuJoCo's, if bits depend on the number of worlds, or if a device is lost, it prints no results and exits with 1.

mod agreement;
mod arguments;
mod build_time;
mod checks;
#[path = "../../tests/common/mod.rs"]
mod common;
mod kernel_times;
mod measure;
mod pages;
mod power;
mod report;
#[path = "../robots/mod.rs"]
mod robots;
mod scenes;

use anyhow::Context;
use arguments::{Arguments, Checks, Side};
use clap::Parser;
use measure::Frames;
use pages::Pages;
use power::Meter;
use report::{GpuSide, Report, Row};
use scenes::{Plan, WorldSet};
use sim_engine::options::{Adapter, AdapterInfo, Cuts, Replay, adapters};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_physics::arrays::Field;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What a frame shows while it is measured.
const FIELDS: [Field; 3] = [Field::JointQ, Field::JointQd, Field::BodyQ];

/// Worlds with which replay is compared: so few that commands and counters cost little beside the batches.
const REPLAY_WORLDS: usize = 64;

/// Where worlds are kept: an adapter, with a folder for its programs, and how those are made.
pub struct Place {
    adapter: Adapter,
    cache: PathBuf,
    replay: Replay,
    world_threads: Option<usize>,
    cpu_bits: bool,
    cuts: Cuts,
}

impl Place {
    /// An adapter, with all else as the command line has it.
    fn new(arguments: &Arguments, info: &AdapterInfo, cache: &Path) -> Place {
        Place {
            adapter: Adapter::Index(info.index),
            cache: cache.to_owned(),
            replay: Replay::Recorded,
            world_threads: arguments.world_threads,
            cpu_bits: arguments.cpu_bits,
            cuts: arguments.cuts(),
        }
    }
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
        world_threads: place.world_threads,
        cpu_bits: place.cpu_bits,
        cuts: place.cuts,
        fields: fields.to_vec(),
        ..Options::default()
    }
}

fn main() -> anyhow::Result<()> {
    sim_daemon::environment::complete();
    let arguments = Arguments::parse();
    let info = chosen(arguments.adapter.as_deref())?;
    if let Some(folder) = &arguments.build_in {
        return build_time::build_and_print(&arguments, &info, folder);
    }
    let temporary_cache = std::env::temp_dir().join(format!("gpu-bench-{}", std::process::id()));
    let cache = arguments.cache.as_ref().unwrap_or(&temporary_cache);
    let done = run(&arguments, &info, &Place::new(&arguments, &info, cache));
    let _ = std::fs::remove_dir_all(temporary_cache);
    done
}

fn run(arguments: &Arguments, info: &AdapterInfo, place: &Place) -> anyhow::Result<()> {
    let csv = arguments.csv.as_deref();
    let mut report = Report::new(info, &arguments.fact, csv, arguments.append)?;
    if arguments.checks != Checks::Skip {
        checks::check(place, arguments)?;
    }
    if arguments.checks == Checks::Only {
        return Ok(());
    }
    if let Some(csv) = &arguments.kernel_times {
        return time_kernels(arguments, place, csv);
    }
    report.head();
    for scene in &arguments.scenes {
        let plan = arguments.plan(scene)?;
        // it is the scene's, and stands in its first row
        let mut replay = match arguments.brief || arguments.side == Side::Cpu {
            true => None,
            false => Some(replay(place, &plan, arguments)?),
        };
        for &worlds in &arguments.worlds {
            let gpu = match arguments.side {
                Side::Cpu => None,
                _ => Some(GpuSide {
                    replay: replay.take(),
                    ..on_gpu(arguments, info, place, &plan, worlds)?
                }),
            };
            let cpu = match arguments.side {
                Side::Gpu => None,
                _ => Some(on_cpu(arguments, place, &plan, worlds)?),
            };
            report.add(Row {
                scene: plan.scene.clone(),
                worlds,
                dofs: plan.model.dofs(),
                substeps: plan.model.substeps(),
                world_threads: arguments.world_threads,
                cpu_bits: place.cpu_bits,
                cuts: place.cuts,
                gpu,
                cpu,
            })?;
        }
    }
    if !arguments.brief {
        report.notes();
    }
    Ok(())
}

/// The programs of all scenes, timed on the device.
fn time_kernels(arguments: &Arguments, place: &Place, csv: &Path) -> anyhow::Result<()> {
    for scene in &arguments.scenes {
        let plan = arguments.plan(scene)?;
        for &worlds in &arguments.worlds {
            let options = Options {
                replay: Replay::Timed,
                ..options(place, worlds, &FIELDS)
            };
            let (mut sim, _) = build(&plan, &options)?;
            kernel_times::print(&mut sim, &plan, worlds, csv)?;
        }
    }
    Ok(())
}

/// The adapter that is meant.
fn chosen(wanted: Option<&str>) -> anyhow::Result<AdapterInfo> {
    let is_meant = |info: &AdapterInfo| match wanted.map(|text| (text, text.parse::<usize>())) {
        None => true,
        Some((_, Ok(index))) => info.index == index,
        Some((name, Err(_))) => info.name.to_lowercase().contains(&name.to_lowercase()),
    };
    let mut adapters = adapters();
    let names: Vec<&str> = adapters.iter().map(|info| info.name.as_str()).collect();
    let place = adapters.iter().position(is_meant);
    let place = place.with_context(|| format!("no such adapter; there are: {names:?}"))?;
    Ok(adapters.swap_remove(place))
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
    let mut medians = [0.0; 2];
    for (median, replay) in medians.iter_mut().zip([Replay::Recorded, Replay::Encoded]) {
        let options = Options {
            replay,
            ..options(place, REPLAY_WORLDS, &FIELDS)
        };
        let (mut sim, _) = build(plan, &options)?;
        let mut words = vec![0; sim.layout().bytes / 8];
        *median = Frames::measure(&mut sim, plan, &crowd, &mut words, wanted)?.thread_us(0.5);
    }
    Ok(medians)
}

/// The adapter's side of a scene with so many worlds, but for its replay.
fn on_gpu(
    arguments: &Arguments,
    info: &AdapterInfo,
    place: &Place,
    plan: &Plan,
    worlds: usize,
) -> anyhow::Result<GpuSide> {
    let cold_and_cached_s = match arguments.brief {
        true => None,
        false => Some(build_time::build_twice(info, &plan.scene, worlds)?),
    };
    let wanted = Duration::from_secs_f64(arguments.seconds);
    let crowd = WorldSet::all(worlds);
    let options = options(place, worlds, &FIELDS);
    let words = Simulation::layout_of(&plan.model, &options).bytes / 8;
    let mut pages = Pages::new(words)?;
    let mut heap = vec![0; words];
    let (mut sim, build_s) = build(plan, &options)?;
    let staged = Frames::measure(&mut sim, plan, &crowd, &mut heap, wanted)?;
    let owner = pages.owner();
    let imports = !arguments.no_import && sim.import(pages.words(), &|| Some(owner.clone()));
    let imported = imports
        .then(|| Frames::measure(&mut sim, plan, &crowd, pages.words(), wanted))
        .transpose()?;
    let words = if imports {
        pages.words()
    } else {
        &mut heap[..]
    };
    let meter = arguments.power.and_then(|_| Meter::new(&info.name));
    let power = match meter.zip(arguments.power) {
        Some((meter, seconds)) => {
            let wanted = Duration::from_secs_f64(seconds);
            meter.measure(&mut sim, plan, &crowd, words, wanted)?
        }
        None => None,
    };
    Ok(GpuSide {
        power,
        programs: sim.programs().to_vec(),
        build_s,
        cold_and_cached_s,
        staged,
        imported,
        replay: None,
    })
}

/// The processor's side, on all cores.
fn on_cpu(
    arguments: &Arguments,
    place: &Place,
    plan: &Plan,
    worlds: usize,
) -> anyhow::Result<Frames> {
    let options = Options {
        device: Device::Cpu,
        ..options(place, worlds, &FIELDS)
    };
    let (mut sim, _) = build(plan, &options)?;
    let mut words = vec![0; sim.layout().bytes / 8];
    let wanted = Duration::from_secs_f64(arguments.seconds);
    Frames::measure(&mut sim, plan, &WorldSet::all(worlds), &mut words, wanted)
}

//! A daemon from start to end: check the arguments, read the scene, build the simulation, open the wire, serve, clean up.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::json;
use sim_core::batch::Field;
use sim_engine::options::{self, Adapter};
use sim_engine::simulation::{Device, Draws, Faults, Lanes, Options, Precision, Simulation};
use sim_protocol::host::{Host, check_memory};
use sim_protocol::place::Place;
use sim_protocol::tenancy::Tenancy;

use crate::cli::Serve;
use crate::config::{self, SceneFile};
use crate::error::DaemonError;
use crate::export::{self, Facts};
use crate::news::News;
use crate::server;
use crate::watchdog::Watchdog;

/// Counts above this are mistakes; below it, sizes in bytes do not overflow.
const COUNT_MAX: u64 = u32::MAX as u64;

/// Runs `tightloop serve`: from the arguments to the last cleaning. Prints one line to stdout when ready or failed.
pub(crate) fn run(serve: &Serve) -> Result<(), DaemonError> {
    let mut news =
        News::open(serve.log.as_deref(), serve.parent.is_some()).inspect_err(announce_error)?;
    // from here on, a request to stop is carried out as soon as that is clean
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [
        signal_hook::consts::SIGTERM,
        signal_hook::consts::SIGINT,
        signal_hook::consts::SIGHUP,
    ] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| DaemonError::System {
                action: "handle signals",
                problem: error.to_string(),
            })
            .inspect_err(announce_error)?;
    }
    let (simulation, mut host) = open(serve, &stop).inspect_err(announce_error)?;
    let description = host.description();
    news.tell(&format!(
        "{}: {} worlds on {}, {} threads, {:.0} MB of shared memory; pid {}",
        description.name,
        description.worlds,
        description.device,
        description.threads,
        host.shared_bytes() as f64 / 1e6,
        description.pid,
    ));
    description.notes.iter().for_each(|note| news.tell(note));
    let ready = json!({ "ready": {
        "name": description.name,
        "pid": description.pid,
        "session": format!("{:016x}", description.session),
        "protocol": description.protocol,
        "worlds": description.worlds,
        "device": description.device,
        "precision": description.precision,
        "threads": description.threads,
        "root": host.tenancy().place().root(),
    }});
    let watchdog = Watchdog::start(Arc::clone(&stop), serve.parent, host.janitor())?;
    announce(&ready);
    let result = server::run(simulation, &mut host, &mut news);
    // its janitor must not look at the shared folder while the host takes that away
    drop(watchdog);
    drop(host);
    match &result {
        Ok(()) => news.tell("ended"),
        Err(error) => news.tell(&format!("failed: {error}")),
    }
    if let (Err(error), Some(_)) = (&result, serve.parent) {
        // the one line is said; this is for the terminal of whoever launched us
        let _ = writeln!(std::io::stderr(), "tightloop: {error}");
    }
    result
}

/// Everything before the first client may come.
fn open(serve: &Serve, stop: &Arc<AtomicBool>) -> Result<(Simulation, Host), DaemonError> {
    let options = check(serve)?;
    let place = Place::new(None, &serve.name)?;
    sim_protocol::sweep(None)?;
    let tenancy = Tenancy::take(&place)?;

    let (mut scene, folder) = read_scene(&serve.scene)?;
    let named = serve.params.iter().map(|name| name.trim().to_owned());
    scene.params.extend(named.filter(|name| !name.is_empty()));
    let description = scene.describe(&folder)?;
    let model = description.compile()?;
    let layout = Simulation::layout_of(&model, &options);
    let table = export::frame_table(&layout);
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let facts = Facts {
        scene: &description,
        scene_text: scene.to_toml(),
        scene_folder: folder.to_string_lossy().into_owned(),
        device: "cpu".to_owned(),
        threads: options.threads.unwrap_or_else(cores),
        frames_held: serve.frames_held,
        watch_worlds: serve.watch_worlds,
    };
    let mut told = export::description(&model, &options, &layout, facts);
    // before anything large is taken: memory that is missing kills instead of failing
    check_memory(&told, &table, Simulation::memory_of(&model, &options))?;
    let simulation = Simulation::new(model, &options)?;
    (told.device, told.threads) = (simulation.device().to_owned(), simulation.threads());
    told.adapter = simulation.adapter().to_owned();
    told.delivery = simulation.delivery().to_owned();
    told.state_bytes = simulation.snapshot_bytes(told.worlds) as u64;
    told.watch_state_bytes = simulation.snapshot_bytes(told.watch_worlds) as u64;
    if let (Some(why), true) = (simulation.device_note(), serve.device == "auto") {
        told.notes.push(format!("device auto is {why}"));
    }
    let host = Host::open(tenancy, told, table, Arc::clone(stop))?;
    Ok((simulation, host))
}

/// The arguments, checked.
fn check(serve: &Serve) -> Result<Options, DaemonError> {
    let wrong = |argument, value: &dyn ToString, problem: String| {
        let value = value.to_string();
        Err(DaemonError::Argument {
            argument,
            value,
            problem,
        })
    };
    if !(1..=COUNT_MAX).contains(&serve.worlds) {
        return wrong("worlds", &serve.worlds, format!("ask for 1 to {COUNT_MAX}"));
    }
    let Some(device) = device(serve) else {
        let problem = "unknown; use auto, cpu or gpu".to_owned();
        return wrong("device", &serve.device, problem);
    };
    if let (Some(adapter), false) = (&serve.adapter, serve.device == "gpu") {
        let problem = "goes with device gpu only".to_owned();
        return wrong("adapter", adapter, problem);
    }
    let precision = match serve.precision.as_str() {
        "f32" => Precision::F32,
        "f64" => Precision::F64,
        _ => {
            return wrong(
                "precision",
                &serve.precision,
                "unknown; use f32 or f64".to_owned(),
            );
        }
    };
    if serve
        .threads
        .is_some_and(|threads| !(1..=1024).contains(&threads))
    {
        return wrong(
            "threads",
            &serve.threads.unwrap_or(0),
            "ask for 1 to 1024, or leave it out".to_owned(),
        );
    }
    if !(1..=1024).contains(&serve.frames_held) {
        return wrong(
            "frames-held",
            &serve.frames_held,
            "ask for 1 to 1024".to_owned(),
        );
    }
    if serve.watch_worlds == 0 {
        return wrong(
            "watch-worlds",
            &serve.watch_worlds,
            "ask for at least 1".to_owned(),
        );
    }
    let mut fields = Vec::new();
    for name in serve
        .fields
        .iter()
        .map(|name| name.trim())
        .filter(|name| !name.is_empty())
    {
        let Some(field) = Field::named(name) else {
            let known: Vec<_> = Field::ALL.iter().map(|field| field.row().name).collect();
            return wrong(
                "fields",
                &name,
                format!("unknown field; known are {}", known.join(", ")),
            );
        };
        fields.push(field);
    }
    if !matches!(serve.on_fault.as_str(), "freeze" | "reset") {
        let problem = "unknown; use freeze or reset".to_owned();
        return wrong("on-fault", &serve.on_fault, problem);
    }
    if !matches!(serve.on_nan.as_str(), "refuse" | "freeze") {
        let problem = "unknown; use refuse or freeze".to_owned();
        return wrong("on-nan", &serve.on_nan, problem);
    }
    let Some(draws) = Draws::named(&serve.draws) else {
        let problem = "unknown; use world or seed".to_owned();
        return wrong("draws", &serve.draws, problem);
    };
    for (argument, value) in [
        ("joint-q-max", serve.joint_q_max),
        ("joint-qd-max", serve.joint_qd_max),
    ] {
        if value <= 0.0 || value.is_nan() {
            let problem = "give a number above 0, or leave it out for none".to_owned();
            return wrong(argument, &value, problem);
        }
    }
    let (worlds, threads) = (serve.worlds as usize, serve.threads);
    Ok(Options {
        device,
        compile_limit: options::compile_limit()?,
        worlds,
        precision,
        threads,
        lanes: Lanes::Auto,
        fields,
        faults: Faults {
            joint_q_max: serve.joint_q_max,
            joint_qd_max: serve.joint_qd_max,
            resets: serve.on_fault == "reset",
            freezes_nan: serve.on_nan == "freeze",
        },
        draws,
        ..Options::default()
    })
}

/// What is to keep the worlds; none if the word is unknown.
fn device(serve: &Serve) -> Option<Device> {
    let adapter = match &serve.adapter {
        None => Adapter::First,
        Some(text) => match text.parse() {
            Ok(index) => Adapter::Index(index),
            Err(_) => Adapter::Name(text.clone()),
        },
    };
    let cache = options::cache_folder();
    match serve.device.as_str() {
        "cpu" => Some(Device::Cpu),
        "gpu" => Some(Device::Gpu { adapter, cache }),
        "auto" => Some(Device::Auto {
            cache,
            software: options::auto_takes_software(),
        }),
        _ => None,
    }
}

/// The scene, and the folder that its paths are relative to.
fn read_scene(path: &Path) -> Result<(SceneFile, PathBuf), DaemonError> {
    let folder = |path: &Path| {
        let here = if path.as_os_str().is_empty() {
            Path::new(".")
        } else {
            path
        };
        std::fs::canonicalize(here).unwrap_or_else(|_| here.to_owned())
    };
    if path == Path::new("-") {
        let mut text = String::new();
        std::io::stdin()
            .read_to_string(&mut text)
            .map_err(|error| DaemonError::Read {
                name: "on standard input".to_owned(),
                problem: error.to_string(),
            })?;
        return Ok((
            config::parse(&text, "standard input")?,
            folder(Path::new("")),
        ));
    }
    Ok((
        config::load(path)?,
        folder(path.parent().unwrap_or(Path::new(""))),
    ))
}

fn announce_error(error: &DaemonError) {
    announce(&json!({ "error": { "kind": error.kind(), "message": error.to_string() } }));
}

/// The one line on stdout. Whoever launched us may be gone already: the watchdog sees that.
fn announce(line: &serde_json::Value) {
    let mut stdout = std::io::stdout().lock();
    let _ = writeln!(stdout, "{line}").and_then(|()| stdout.flush());
}

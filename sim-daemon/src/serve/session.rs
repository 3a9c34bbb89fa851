//! A daemon from start to end: check the arguments, read the scene, build the simulation, open its services, serve, clean up.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::json;
use sim_engine::options::{self, Adapter};
use sim_engine::simulation::{
    Device, Draws, Faults, Lanes, Options, OutputsAt, Precision, Simulation,
};
use sim_protocol::daemon_lock::DaemonLock;
use sim_protocol::descriptors::make_room_for;
use sim_protocol::host::{Host, check_memory};
use sim_protocol::paths::DaemonPaths;
use sim_protocol::{Description, ProtocolError, Table};

use crate::advice::advice;
use crate::cli::Serve;
use crate::config::{self, SceneFile};
use crate::error::DaemonError;
use crate::export::{self, RunInfo};
use crate::eyes::{Eyes, FrameFields, Images, Sight};
use crate::perf_map;
use crate::serve::groups;
use crate::serve::janitor::Janitor;
use crate::serve::least_memory::check_least_memory;
use crate::serve::log::{Log, Streams};
use crate::serve::pace;
use crate::serve::server;
use crate::serve::watchdog::Watchdog;

/// Counts above this are mistakes; below it, sizes in bytes do not overflow.
const COUNT_MAX: u64 = u32::MAX as u64;
/// Each has a thread and services of its own.
const GROUPS_MAX: u64 = 64;

/// Runs `tightloop serve`: from the arguments to the last cleaning. Prints one line to stdout when ready or failed, and
/// errors to stderr, where our parent does not get them from that line.
pub(crate) fn run(serve: &Serve) -> Result<(), DaemonError> {
    let streams = Streams::open().inspect_err(|error| {
        // nothing is served yet that could wait
        let _ = writeln!(std::io::stderr(), "tightloop: {error}");
    })?;
    let mut was_ready = false;
    let result = Watchdog::start(serve, &streams.stderr)
        .and_then(|watchdog| run_with(serve, &streams, &watchdog, &mut was_ready));
    if let Err(error) = &result {
        if !was_ready {
            announce_error(error, &streams);
        }
        if was_ready || serve.parent.is_none() {
            streams.complain(error);
        }
    }
    result
}

fn run_with(
    serve: &Serve,
    streams: &Streams,
    watchdog: &Watchdog,
    was_ready: &mut bool,
) -> Result<(), DaemonError> {
    let log = Log::open(
        serve.log.as_deref(),
        serve.parent.is_some(),
        &streams.stderr,
    )?;
    let stop = watchdog.stop();
    let Opened { daemon, groups } = open(serve, watchdog)?;
    let door = Mutex::new(Door {
        daemon,
        closed: groups.len(),
        is_ready: false,
        bytes: 0,
        session: 0,
        log: log.clone(),
        streams,
    });
    let result = groups::serve_all(groups, stop, |number, group: Group| {
        let is_alone = group.announced.groups == 1;
        let log = match is_alone {
            true => log.clone(),
            false => log.for_group(number),
        };
        let mut host = Host::open(
            group.daemon_lock,
            group.announced,
            group.table,
            &export::stops(),
            Arc::clone(stop),
        )?;
        // again with the memory of the services; what is refused was said above
        let _ = pace::lock_memory(serve);
        let janitor = Janitor::start(host.client_cleanup())?;
        door.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .open(&host)?;
        let result = server::run(group.simulation, group.eyes, &mut host, &log);
        // now: we may be ended while another group is at long work
        if let (Err(error), false) = (&result, is_alone) {
            log.write(&format!("failed: {error}"));
        }
        // its cleanup must not read the shared folder while the host removes it
        drop(janitor);
        result
    });
    let door = door.into_inner().unwrap_or_else(PoisonError::into_inner);
    *was_ready = door.is_ready;
    // the daemon's name goes after those of its groups
    drop(door);
    match &result {
        Ok(()) => log.write("ended"),
        Err(error) => log.write(&format!("failed: {error}")),
    }
    log.flush();
    result
}

/// A daemon before its first client may come.
struct Opened {
    /// Of the daemon's name, where its groups have names of their own.
    daemon: Option<DaemonLock>,
    groups: Vec<Group>,
}

/// A group of worlds before it is served.
struct Group {
    daemon_lock: DaemonLock,
    simulation: Simulation,
    eyes: Eyes,
    announced: Description,
    table: Table,
}

/// What is said when the last group is open.
struct Door<'a> {
    daemon: Option<DaemonLock>,
    /// Groups that are not open yet.
    closed: usize,
    /// The line for clients was printed.
    is_ready: bool,
    /// Shared memory of those that are.
    bytes: u64,
    /// Of the first group's run.
    session: u64,
    log: Log,
    streams: &'a Streams,
}

impl Door<'_> {
    /// A group is open. After the last one, the daemon announces that it is ready.
    fn open(&mut self, host: &Host) -> Result<(), DaemonError> {
        let description = host.description();
        self.closed -= 1;
        self.bytes += host.shared_bytes();
        if description.group == 0 {
            self.session = description.session;
        }
        if self.closed > 0 {
            return Ok(());
        }
        let groups = description.groups;
        let name = match &mut self.daemon {
            None => &description.name,
            Some(daemon) => {
                daemon.announce(self.session, groups)?;
                daemon.paths().name()
            }
        };
        let worlds = description.worlds * groups;
        let among = match groups {
            1 => String::new(),
            _ => format!(" in {groups} groups"),
        };
        self.log.write(&format!(
            "{name}: {worlds} worlds{among} on {}, {} threads, {:.0} MB of shared memory; pid {}",
            description.device,
            description.threads,
            self.bytes as f64 / 1e6,
            description.pid,
        ));
        for warning in &description.warnings {
            self.log.write(&format!("warning: {warning}"));
        }
        description
            .notes
            .iter()
            .for_each(|note| self.log.write(note));
        let ready = json!({ "ready": {
            "name": name,
            "pid": description.pid,
            "session": format!("{:016x}", self.session),
            "protocol": description.protocol,
            "worlds": worlds,
            "groups": groups,
            "device": description.device,
            "precision": description.precision,
            "threads": description.threads,
            "root": host.daemon_lock().paths().root(),
        }});
        announce(&ready, self.streams);
        self.is_ready = true;
        Ok(())
    }
}

/// Everything before the first client may come, except the services.
fn open(serve: &Serve, watchdog: &Watchdog) -> Result<Opened, DaemonError> {
    // of each group
    let (mut options, images) = check(serve)?;
    let refusals = pace::ask_system(serve)?;
    let count = serve.groups as usize;
    let paths = DaemonPaths::new(None, &serve.name)?;
    if paths.is_group() {
        let name = serve.name.clone();
        let problem = "a name with a number after a dot is that of a group";
        return Err(ProtocolError::BadName { name, problem }.into());
    }
    // clients get it as text
    if paths.root().to_str().is_none() {
        let path = paths.root().to_owned();
        let problem = "its path is not UTF-8".to_owned();
        // it was made a moment ago, if it is empty
        let _ = std::fs::remove_dir(&path);
        return Err(ProtocolError::Root { path, problem }.into());
    }
    make_room_for(count)?;
    sim_protocol::sweep(None)?;
    let daemon_lock = DaemonLock::take(&paths)?;
    watchdog.keep(&daemon_lock);
    let (daemon, locks) = match count {
        1 => (None, vec![daemon_lock]),
        _ => {
            let taken = (0..count).map(|group| {
                let paths = paths.group(group)?;
                let daemon_lock = DaemonLock::take(&paths)?;
                watchdog.keep(&daemon_lock);
                Ok::<_, ProtocolError>(daemon_lock)
            });
            (Some(daemon_lock), taken.collect::<Result<Vec<_>, _>>()?)
        }
    };

    let (mut scene, folder) = read_scene(&serve.scene)?;
    let named = serve.params.iter().map(|name| name.trim().to_owned());
    scene.params.extend(named.filter(|name| !name.is_empty()));
    let description = scene.describe(&folder)?;
    check_least_memory(&description, &options, count)?;
    let model = description.compile()?;
    options.checked_with = options::machine_code_check(&model);
    let sight = Sight::open(&scene, &folder, &description, &model, &images)?;
    let layout = Simulation::layout_of(&model, &options);
    let images = Images::new(sight, &layout)?;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = options.threads.unwrap_or_else(cores);
    let table = export::frame_table(&layout, &images);
    let info = RunInfo {
        scene: &description,
        scene_text: scene.to_toml(),
        scene_folder: folder.to_string_lossy().into_owned(),
        device: "cpu".to_owned(),
        threads,
        frames_held: serve.frames_held,
        watch_worlds: serve.watch_worlds,
        images: &images,
    };
    let mut announced = export::description(&model, &options, &layout, info);
    announced.groups = count;
    // before anything large is taken: memory that is missing kills instead of failing
    let physics = Simulation::memory_of(&model, &options);
    let beside = images.memory_bytes(threads);
    check_memory(&announced, &table, physics.saturating_add(beside))?;
    announced.warnings = advice(&description, &model);
    announced.pace = pace::pace(serve, model.dt() * model.substeps() as f64)?;
    announced.notes.extend(refusals);
    let simulations = Simulation::groups(model, &options, count)?;
    let eyes = Eyes::of_groups(&images, threads, count, options.faults.resets)?;
    announced.notes.extend(pace::lock_memory(serve));
    announced.notes.extend(perf_map::write(&simulations[0]));
    announced.state_bytes = simulations[0].snapshot_bytes(announced.worlds) as u64;
    announced.watch_state_bytes = simulations[0].snapshot_bytes(announced.watch_worlds) as u64;
    // again with what observers see, of all groups before the first one opens; the worlds have their memory
    check_memory(&announced, &table, 0)?;
    let group = |(number, ((daemon_lock, simulation), eyes))| {
        let (daemon_lock, simulation): (DaemonLock, Simulation) = (daemon_lock, simulation);
        let mut announced = announced.clone();
        (announced.group, announced.first_world) = (number, number * options.worlds);
        (announced.device, announced.threads) =
            (simulation.device().to_owned(), simulation.threads());
        announced.adapter = simulation.adapter().to_owned();
        announced.delivery = simulation.delivery().to_owned();
        if let (Some(why), true) = (simulation.device_note(), serve.device == "auto") {
            announced.notes.push(format!("device auto is {why}"));
        }
        Group {
            daemon_lock,
            simulation,
            eyes,
            announced,
            table: table.clone(),
        }
    };
    let groups = locks.into_iter().zip(simulations).zip(eyes);
    Ok(Opened {
        daemon,
        groups: groups.enumerate().map(group).collect(),
    })
}

/// The arguments, checked, with the fields of cameras; the worlds are those of each group.
fn check(serve: &Serve) -> Result<(Options, Vec<String>), DaemonError> {
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
    if !(1..=GROUPS_MAX).contains(&serve.groups) {
        let problem = format!("ask for 1 to {GROUPS_MAX}");
        return wrong("groups", &serve.groups, problem);
    }
    if !serve.worlds.is_multiple_of(serve.groups) {
        let problem = match serve.groups > serve.worlds {
            true => format!(
                "each has at least one world, and there are {}",
                serve.worlds
            ),
            false => format!(
                "{} worlds cannot be shared out evenly; ask for a number that divides it",
                serve.worlds
            ),
        };
        return wrong("groups", &serve.groups, problem);
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
    let asked = FrameFields::of_argument(&serve.fields)?;
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
    let Some(outputs_at) = OutputsAt::named(&serve.outputs_at) else {
        let problem = "unknown; use frame or last_substep".to_owned();
        return wrong("outputs-at", &serve.outputs_at, problem);
    };
    for (argument, value) in [
        ("joint-q-max", serve.joint_q_max),
        ("joint-qd-max", serve.joint_qd_max),
    ] {
        if value <= 0.0 || value.is_nan() {
            let problem = "give a number above 0; inf is no bound".to_owned();
            return wrong(argument, &value, problem);
        }
    }
    let (worlds, threads) = ((serve.worlds / serve.groups) as usize, serve.threads);
    let options = Options {
        device,
        compile_limit: options::compile_limit()?,
        worlds,
        precision,
        cpu_bits: serve.cpu_bits,
        threads,
        lanes: Lanes::Auto,
        fields: asked.fields,
        faults: Faults {
            joint_q_max: serve.joint_q_max,
            joint_qd_max: serve.joint_qd_max,
            resets: serve.on_fault == "reset",
            freezes_nan: serve.on_nan == "freeze",
        },
        draws,
        outputs_at,
        ..Options::default()
    };
    Ok((options, asked.images))
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
pub(crate) fn read_scene(path: &Path) -> Result<(SceneFile, PathBuf), DaemonError> {
    let folder = |path: &Path| {
        let here = if path.as_os_str().is_empty() {
            Path::new(".")
        } else {
            path
        };
        std::fs::canonicalize(here).unwrap_or_else(|_| here.to_owned())
    };
    if path == Path::new("-") {
        let failed = |problem: String| DaemonError::Read {
            name: "on standard input".to_owned(),
            problem,
        };
        let mut text = String::new();
        std::io::stdin()
            .take(config::SCENE_MAX + 1)
            .read_to_string(&mut text)
            .map_err(|error| failed(error.to_string()))?;
        if text.len() as u64 > config::SCENE_MAX {
            let most = config::SCENE_MAX >> 20;
            return Err(failed(format!("it is larger than the limit of {most} MiB")));
        }
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

fn announce_error(error: &DaemonError, streams: &Streams) {
    let line = json!({ "error": { "kind": error.kind(), "message": error.to_string() } });
    announce(&line, streams);
}

/// The one line on stdout. Our parent may be gone already: the watchdog sees that.
fn announce(line: &serde_json::Value, streams: &Streams) {
    streams.stdout.print(format!("{line}\n"));
}

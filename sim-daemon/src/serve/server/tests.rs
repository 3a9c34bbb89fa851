//! A daemon whose device is lost: it reports why, refuses commands, and ends when it is asked to.

#[path = "../../../../sim-core/device/tests/device/layer.rs"]
mod layer;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sim_engine::options::{Adapter, lose_after};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_physics::arrays::{Field, status};
use sim_protocol::daemon_lock::DaemonLock;
use sim_protocol::host::Host;
use sim_protocol::paths::DaemonPaths;
use sim_protocol::{AttachOptions, Client, Frame, JournalEntry, ProtocolError, keep_waiting};

use crate::cli::{Record, Replay};
use crate::config;
use crate::export::{self, RunInfo};
use crate::eyes::Eyes;
use crate::printer::Printer;
use crate::recording::{follow, replay};
use crate::serve::log::Log;

/// Serves worlds of an arm on the first GPU, which is lost after so many runs.
fn serve(paths: &DaemonPaths, log: &Path, runs: u64, ready: impl FnOnce()) {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/assets");
    let text = "dt = 0.002\nsubsteps = 2\n[[robot]]\nname = \"arm\"\nurdf = \"fr3/fr3_franka_hand.urdf\"\n";
    let scene = config::parse(text, "of the test").unwrap();
    let description = scene.describe(&assets).unwrap();
    let options = Options {
        worlds: 3,
        device: Device::Gpu {
            adapter: Adapter::First,
            cache: None,
        },
        fields: vec![Field::JointQ],
        ..Options::default()
    };
    let simulation = Simulation::new(description.compile().unwrap(), &options).unwrap();
    layer::assert_watched();
    let eyes = Eyes::none(&simulation);
    let info = RunInfo {
        scene: &description,
        scene_text: scene.to_toml(),
        scene_folder: assets.to_str().unwrap().to_owned(),
        device: simulation.device().to_owned(),
        threads: 1,
        frames_held: 2,
        watch_worlds: 1,
        images: eyes.images(),
    };
    let mut announced =
        export::description(simulation.model(), &options, simulation.layout(), info);
    announced.adapter = simulation.adapter().to_owned();
    announced.state_bytes = simulation.snapshot_bytes(3) as u64;
    announced.watch_state_bytes = simulation.snapshot_bytes(1) as u64;
    let table = export::frame_table(simulation.layout(), eyes.images());
    let daemon_lock = DaemonLock::take(paths).unwrap();
    let mut host = Host::open(
        daemon_lock,
        announced,
        table,
        &export::stops(),
        Arc::new(AtomicBool::new(false)),
    )
    .unwrap();
    let stderr = Printer::start(std::io::sink()).unwrap();
    let log = Log::open(Some(log), true, &stderr).unwrap();
    lose_after(runs);
    ready();
    super::run(simulation, eyes, &mut host, &log).unwrap();
    log.flush();
    host.client_cleanup().clean();
}

/// A daemon in a thread, and a client of it.
struct Served {
    root: PathBuf,
    log: PathBuf,
    client: Client,
    thread: JoinHandle<()>,
}

fn start(test: &str, runs: u64) -> Served {
    let root = std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
    let paths = DaemonPaths::new(Some(&root), "lost").unwrap();
    let log = root.join("daemon.log");
    let (ready, wait) = channel();
    let thread = {
        let log = log.clone();
        std::thread::spawn(move || serve(&paths, &log, runs, || ready.send(()).unwrap()))
    };
    wait.recv().unwrap();
    Served {
        client: attach(&root),
        root,
        log,
        thread,
    }
}

fn attach(root: &Path) -> Client {
    let options = AttachOptions {
        root: Some(root.to_owned()),
        ..AttachOptions::default()
    };
    Client::attach("lost", &options, &mut keep_waiting()).unwrap()
}

impl Served {
    /// Ends the daemon; returns its log.
    fn end(self) -> String {
        self.client.shutdown(&mut keep_waiting()).unwrap();
        drop(self.client);
        self.thread.join().unwrap();
        let log = std::fs::read_to_string(&self.log).unwrap();
        std::fs::remove_dir_all(&self.root).unwrap();
        log
    }
}

fn is_lost(frame: &Frame) -> bool {
    let statuses: &[u32] = frame.field("status").unwrap().as_slice().unwrap();
    statuses == [status::NOT_FINITE; 3]
}

/// How `tightloop record` is asked to write a file.
fn recorded(out: &Path) -> Record {
    Record {
        name: "lost".to_owned(),
        out: out.to_owned(),
        fields: Vec::new(),
        frames: None,
        seconds: None,
        force: false,
        parent: None,
    }
}

#[test]
fn a_daemon_whose_device_is_lost_refuses_commands_with_the_reason_and_goes_on() {
    let served = start("lost", 0);
    let (client, hook) = (&served.client, &mut keep_waiting());
    // the frame that finds it reports every world
    assert!(is_lost(&client.step(&[], hook).unwrap()));
    let kept = served.root.join("kept");
    let refusals = [
        client.step(&[], hook),
        client.forward(hook),
        client.reset(None, None, hook),
        client.snapshot(kept.to_str().unwrap(), hook),
    ];
    for refusal in refusals {
        let Err(error) = refusal else {
            panic!("nothing can be computed");
        };
        assert!(
            matches!(error, ProtocolError::CommandRefused { .. })
                && error.to_string().contains("device lost"),
            "{error}"
        );
    }
    assert!(!kept.exists());
    let out = served.root.join("late.tlrec");
    let refused = follow(
        &attach(&served.root),
        &recorded(&out),
        &AtomicBool::new(false),
    );
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("nothing can be recorded any more") && refused.contains("device lost"),
        "{refused}"
    );
    assert!(!out.exists());
    let log = served.end();
    assert_eq!(log.matches("all worlds are lost").count(), 1, "{log}");
}

#[test]
fn a_recorder_that_finds_the_device_lost_gets_an_error_instead_of_a_state() {
    let served = start("lost-state", 0);
    let recorder = attach(&served.root);
    let mut journal = recorder.journal(&[], &mut keep_waiting()).unwrap();
    let entry = journal.next(Duration::from_secs(60), &mut keep_waiting());
    let entry = entry.unwrap().expect("an entry within a minute");
    assert!(entry.header().is_end());
    assert!(entry.reason().contains("device lost"), "{}", entry.reason());
    drop((entry, journal, recorder));
    assert_eq!(served.end().matches("all worlds are lost").count(), 1);
}

#[test]
fn a_recording_ends_before_the_frame_that_found_the_device_lost_and_replays() {
    let served = start("lost-midway", 20);
    let out = served.root.join("run.tlrec");
    let recorder = {
        let (client, args) = (attach(&served.root), recorded(&out));
        std::thread::spawn(move || follow(&client, &args, &AtomicBool::new(false)))
    };
    // it makes its file once it has joined, and a recorder that joins after it has the state after it
    let deadline = Instant::now() + Duration::from_secs(60);
    while !out.exists() {
        assert!(Instant::now() < deadline, "no recording begins");
        std::thread::sleep(Duration::from_millis(5));
    }
    let watcher = attach(&served.root);
    let mut journal = watcher.journal(&[], &mut keep_waiting()).unwrap();
    let mut next = || -> JournalEntry {
        let entry = journal.next(Duration::from_secs(60), &mut keep_waiting());
        entry.unwrap().expect("an entry within a minute")
    };
    while {
        let piece = next();
        assert!(piece.header().is_state());
        piece.header().first + (piece.piece().len() as u64) < piece.header().bytes
    } {}
    let mut frames = 0;
    while !is_lost(&served.client.step(&[], &mut keep_waiting()).unwrap()) {
        frames += 1;
    }
    assert!((1..20).contains(&frames), "{frames}");
    for _ in 0..frames {
        assert!(next().header().digests > 0);
    }
    assert!(next().header().is_end());
    recorder.join().unwrap().unwrap();
    let again = Replay {
        file: out,
        threads: None,
        frames: None,
    };
    replay(&again).unwrap();
    drop((journal, watcher));
    served.end();
}

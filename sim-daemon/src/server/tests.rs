//! A daemon whose device is lost: it tells why, refuses commands, and ends when it is asked to.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;

use sim_core::batch::{Field, status};
use sim_engine::options::Adapter;
use sim_engine::simulation::{Device, Options, Simulation};
use sim_protocol::host::Host;
use sim_protocol::place::Place;
use sim_protocol::tenancy::Tenancy;
use sim_protocol::{AttachOptions, Client, ProtocolError, keep_waiting};

use crate::config;
use crate::export::{self, Facts};
use crate::news::News;

/// Serves worlds of an arm on the first GPU, which is lost before the first command.
fn serve(place: &Place, log: &Path, ready: impl FnOnce()) {
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
    let mut simulation = Simulation::new(description.compile().unwrap(), &options).unwrap();
    let facts = Facts {
        scene: &description,
        scene_text: scene.to_toml(),
        scene_folder: assets.to_str().unwrap().to_owned(),
        device: simulation.device().to_owned(),
        threads: 1,
        frames_held: 2,
        watch_worlds: 1,
    };
    let told = export::description(simulation.model(), &options, simulation.layout(), facts);
    let table = export::frame_table(simulation.layout());
    let tenancy = Tenancy::take(place).unwrap();
    let mut host = Host::open(tenancy, told, table, Arc::new(AtomicBool::new(false))).unwrap();
    let mut news = News::open(Some(log), true).unwrap();
    simulation.lose();
    ready();
    super::run(simulation, &mut host, &mut news).unwrap();
    host.janitor().clean();
}

#[test]
fn a_daemon_whose_device_is_lost_refuses_commands_with_the_reason_and_goes_on() {
    let root = std::env::temp_dir().join(format!("tightloop-lost-{}", std::process::id()));
    let place = Place::new(Some(&root), "lost").unwrap();
    let log = root.join("news.log");
    let (ready, wait) = channel();
    let thread = {
        let log = log.clone();
        std::thread::spawn(move || serve(&place, &log, || ready.send(()).unwrap()))
    };
    wait.recv().unwrap();
    let options = AttachOptions {
        root: Some(root.clone()),
        ..AttachOptions::default()
    };
    let hook = &mut keep_waiting();
    let client = Client::attach("lost", &options, hook).unwrap();
    // the frame that finds it says so of every world
    let frame = client.step(&[], hook).unwrap();
    let statuses: &[u32] = frame.field("status").unwrap().as_slice().unwrap();
    assert_eq!(statuses, [status::NOT_FINITE; 3]);
    drop(frame);
    let kept = root.join("kept");
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
    client.shutdown(hook).unwrap();
    drop(client);
    thread.join().unwrap();
    let told = std::fs::read_to_string(&log).unwrap();
    assert_eq!(told.matches("all worlds are lost").count(), 1, "{told}");
    std::fs::remove_dir_all(&root).unwrap();
}

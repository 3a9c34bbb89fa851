//! Recordings and snapshots of an earlier release, made once by `tests/data/recorded/make.py`: they stay readable, and are
//! carried on bit for bit. So a model's hash is still the one that they store.

use std::path::{Path, PathBuf};

use sim_engine::simulation::{Options, Precision, Simulation};

use super::super::records::{self, Record};
use super::{End, read, replay};
use crate::config;

/// Steps of each recording; the first snapshot is taken before the step `START`, the last after all.
const STEPS: u64 = 24;
const START: u64 = 16;
/// Frames of each recording: one per step, and one of the first snapshot.
const FRAMES: u64 = STEPS + 1;
const WORLDS: usize = 2;
/// The scenes: what varies in them, and their precision.
const SCENES: [(&str, &[&str], Precision); 3] = [
    ("lesson", &["joint_target_ke", "gravity"], Precision::F32),
    ("quadruped", &[], Precision::F64),
    ("machine", &[], Precision::F32),
];

fn folder() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    root.join("tests/data/recorded")
}

/// A recording whose robots are in [`folder`], as if the repository had been there then.
fn recorded(scene: &str) -> Vec<u8> {
    let bytes = std::fs::read(folder().join(format!("{scene}.tlrec"))).unwrap();
    let (blocks, _) = read(&bytes).unwrap();
    let (mut moved, mut packed) = (super::blocks::head().to_vec(), Vec::new());
    for block in blocks {
        let (mut rest, mut words) = (&block[..], Vec::new());
        while !rest.is_empty() {
            let record = records::read(&mut rest).unwrap();
            let Record::Head(json) = record else {
                record.write(&mut words);
                continue;
            };
            let mut head: serde_json::Value = serde_json::from_slice(json).unwrap();
            head["daemon"]["scene_folder"] = folder().to_str().unwrap().into();
            Record::Head(head.to_string().as_bytes()).write(&mut words);
        }
        super::blocks::pack(&words, &mut packed);
        moved.extend(&packed);
    }
    moved
}

fn simulation(scene: &str, varying: &[&str], precision: Precision) -> Simulation {
    let mut file = config::load(&folder().join(format!("{scene}.toml"))).unwrap();
    file.params.extend(varying.iter().map(ToString::to_string));
    let model = file.describe(&folder()).unwrap().compile().unwrap();
    let options = Options {
        worlds: WORLDS,
        precision,
        threads: Some(1),
        ..Options::default()
    };
    Simulation::new(model, &options).unwrap()
}

#[test]
fn recordings_of_an_earlier_release_are_replayed_bit_for_bit() {
    for (scene, ..) in SCENES {
        let (frames, end) = replay(scene, &recorded(scene)).unwrap();
        assert_eq!(frames, FRAMES, "{scene}");
        assert!(matches!(end, End::Recording(_)), "{scene}: {end:?}");
    }
}

#[test]
fn snapshots_of_an_earlier_release_are_restored_and_carried_on_bit_for_bit() {
    for (scene, varying, precision) in SCENES {
        let taken = |when| std::fs::read(folder().join(format!("{scene}_{when}.tlsnap"))).unwrap();
        let mut simulation = simulation(scene, varying, precision);
        let restored = simulation.restore(&taken("start"), None, None);
        restored.unwrap_or_else(|error| panic!("{scene}: {error}"));
        let mut arena = vec![0; simulation.layout().bytes / 8];
        for _ in START..STEPS {
            simulation.step(&mut arena);
        }
        assert!(simulation.snapshot() == taken("end"), "{scene}");
    }
}

//! The choice of `auto`: by measured rates, which are kept.

use crate::common::{Run, drawn};
use crate::lost::compiled;
use crate::{assert_alive, gpu, options};
use sim_engine::backend::cpu::available;
use sim_engine::options::{AUTO_WORLDS, AdapterKind, adapters, lose_after};
use sim_engine::simulation::{Device, Faults, Lanes, Options, Simulation};
use sim_model::{Body, Description, Model, Pose};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A folder of a test, empty at its start and gone after it.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let name = format!("tightloop-auto-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }

    /// The one file of rates.
    fn rates(&self) -> PathBuf {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let paths = entries.map(|entry| entry.unwrap().path());
        let is_rates = |path: &PathBuf| {
            let name = path.file_name().unwrap().to_string_lossy();
            name.starts_with("auto-")
        };
        let files: Vec<PathBuf> = paths.filter(is_rates).collect();
        assert_eq!(files.len(), 1, "{files:?}");
        files[0].clone()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A body that falls: its frames take no time.
fn falling(mass: f64) -> Arc<Model> {
    let mut scene = Description::new(0.01, 1);
    let mut body = Body::new("ball", Pose::at([0.0, 0.0, 1.0]));
    body.mass = Some(mass);
    scene.add_body(body).unwrap();
    scene.compile().unwrap()
}

/// Worlds that a software driver may keep too.
fn auto(folder: Option<&Path>) -> Options {
    let device = Device::Auto {
        cache: folder.map(Path::to_owned),
        software: true,
    };
    Options {
        // the fastest worlds are frozen
        faults: Faults {
            joint_qd_max: 0.3,
            ..Faults::default()
        },
        ..options(device, AUTO_WORLDS, &drawn::STATE)
    }
}

fn launched(model: &Arc<Model>, options: &Options) -> Run {
    Run::new(model, options.clone())
}

fn note(run: &Run) -> &str {
    run.sim.device_note().expect("auto tells")
}

/// Both rates of a note in M steps/s, that of the chosen side first.
fn rates(note: &str) -> [f64; 2] {
    let words: Vec<&str> = note.split_whitespace().collect();
    let before = |unit: &str| words.iter().position(|word| *word == unit).unwrap() - 1;
    let most = before("M");
    let least = most + 4;
    assert_eq!(words[most + 2..=most + 3], ["steps/s", "beside"], "{note}");
    assert_eq!(words[least + 1], "M", "{note}");
    [most, least].map(|k| words[k].parse().unwrap())
}

/// Frames from the start of a run, its snapshots, and what it reports of frozen worlds and copies.
fn played(mut run: Run) -> (Vec<Vec<u64>>, [Vec<u8>; 2], String) {
    let start = run.sim.snapshot();
    let frames = (0..6)
        .map(|_| {
            run.step();
            run.arena.clone()
        })
        .collect();
    assert_alive(&run);
    let frozen = run.sim.take_frozen();
    assert!(frozen.first.is_some(), "their frames are compared as well");
    let frozen = format!("{frozen:?}, {} bytes", run.sim.copied());
    (frames, [start, run.sim.snapshot()], frozen)
}

/// The options where a software driver is most likely faster than the processor: one thread, without SIMD.
fn slow(options: Options) -> Options {
    Options {
        lanes: Lanes::Scalar,
        threads: Some(1),
        worlds: 1024,
        ..options
    }
}

#[test]
fn the_faster_side_keeps_the_worlds_and_the_note_has_both_rates() {
    let model = drawn::model();
    for wanted in [auto(None), slow(auto(None))] {
        let run = launched(&model, &wanted);
        let note = note(&run);
        let [most, least] = rates(note);
        assert!(most >= least && least > 0.0, "{note}");
        assert!(note.contains(", measured in "), "{note}");
        let info = &adapters()[0];
        assert!(note.contains(&format!("the GPU `{}`", info.name)), "{note}");
        let is_software = info.kind == AdapterKind::Software;
        assert_eq!(note.contains("a software driver"), is_software, "{note}");
        let device = match note.starts_with("the processor: ") {
            true => "cpu (",
            false => "gpu (",
        };
        assert!(run.sim.device().starts_with(device), "{note}");
    }
}

#[test]
fn worlds_that_were_measured_are_at_their_start_bit_for_bit() {
    let model = drawn::model();
    for wanted in [auto(None), slow(auto(None))] {
        let measured = launched(&model, &wanted);
        let note = note(&measured).to_owned();
        assert!(note.contains("measured in"), "{note}");
        let device = match measured.sim.device().starts_with("gpu") {
            true => gpu(),
            false => Device::Cpu,
        };
        let fresh = Options { device, ..wanted };
        let expected = played(launched(&model, &fresh));
        let replayed = played(measured);
        assert_eq!(replayed.2, expected.2, "{note}");
        assert!(replayed.1 == expected.1, "{note}: snapshots");
        assert!(replayed.0 == expected.0, "{note}: frames");
    }
}

#[test]
fn rates_are_kept_and_decide_at_the_next_launch() {
    let model = falling(1.0);
    let folder = Folder::new("kept");
    let wanted = auto(Some(&folder.0));
    launched(&model, &wanted);
    let path = folder.rates();
    let kept = std::fs::read_to_string(&path).unwrap();
    let (key, _) = kept.trim_end().split_once('\n').unwrap();
    assert!(key.contains(", build of "), "{key}");
    let with = |rates: &str| {
        std::fs::write(&path, format!("{key}\n{rates}\n")).unwrap();
        launched(&model, &wanted)
    };
    for (rates, device, said) in [
        ("2600000 2000000", "gpu (", "2.600 M steps/s beside 2.000 M"),
        ("2000000 2600000", "cpu (", "2.600 M steps/s beside 2.000 M"),
    ] {
        let run = with(rates);
        assert!(run.sim.device().starts_with(device), "{}", note(&run));
        assert!(note(&run).contains(said), "{}", note(&run));
        assert!(note(&run).ends_with("measured by an earlier launch"));
    }
    // rates that are close are measured again
    for rates in ["2590000 2000000", "2000000 2590000"] {
        let run = with(rates);
        assert!(note(&run).contains("measured in"), "{}", note(&run));
    }
    // other worlds, and another model, are measured
    let more = Options {
        worlds: AUTO_WORLDS + 1,
        ..wanted.clone()
    };
    let heavier = falling(2.0);
    for run in [launched(&model, &more), launched(&heavier, &wanted)] {
        assert!(note(&run).contains("measured in"), "{}", note(&run));
    }
}

#[test]
fn a_damaged_file_of_rates_costs_a_measurement() {
    let model = falling(1.0);
    let folder = Folder::new("damaged");
    let wanted = auto(Some(&folder.0));
    launched(&model, &wanted);
    let path = folder.rates();
    let kept = std::fs::read_to_string(&path).unwrap();
    let (key, _) = kept.split_once('\n').unwrap();
    let damaged: [Vec<u8>; 7] = [
        Vec::new(),
        kept.as_bytes()[..kept.len() - 2].to_vec(),
        format!("{key}\nNaN 1\n").into_bytes(),
        format!("{key}\n1e999 1\n").into_bytes(),
        format!("{key}\n-1 1\n").into_bytes(),
        format!("another {kept}").into_bytes(),
        vec![0xff; 100],
    ];
    for bytes in damaged {
        std::fs::write(&path, &bytes).unwrap();
        let run = launched(&model, &wanted);
        let shown = String::from_utf8_lossy(&bytes);
        assert!(
            note(&run).contains("measured in"),
            "{shown}: {}",
            note(&run)
        );
        let again = std::fs::read_to_string(&path).unwrap();
        assert!(again.starts_with(&format!("{key}\n")), "{shown}: {again}");
    }
    // a place that cannot be written, nor its folder
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    let nowhere = auto(Some(Path::new("/dev/null/tightloop")));
    for options in [wanted, nowhere] {
        let run = launched(&model, &options);
        assert!(note(&run).contains("measured in"), "{}", note(&run));
    }
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 0);
    folder.rates();
}

#[test]
fn a_gpu_that_is_lost_while_it_is_measured_leaves_the_worlds_to_the_processor() {
    let model = falling(1.0);
    let folder = Folder::new("lost");
    let wanted = auto(Some(&folder.0));
    let mut runs = 0;
    let start = Options {
        device: gpu(),
        ..wanted.clone()
    };
    loop {
        lose_after(runs);
        if Simulation::new(model.clone(), &start).is_ok() {
            break;
        }
        runs += 1;
    }
    let on_cpu = Options {
        device: Device::Cpu,
        ..wanted.clone()
    };
    let mut expected = launched(&model, &on_cpu);
    expected.step();
    // in its first frame and in its third
    for later in [0, 2] {
        lose_after(runs + later);
        let mut run = launched(&model, &wanted);
        lose_after(u64::MAX);
        let begin = format!("the processor: `{}` failed: ", adapters()[0].name);
        assert!(note(&run).starts_with(&begin), "{}", note(&run));
        assert!(note(&run).contains("device lost"), "{}", note(&run));
        run.step();
        assert!(run.arena == expected.arena);
    }
    let files = std::fs::read_dir(&folder.0).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    assert_eq!(names.filter(|name| name.starts_with("auto-")).count(), 0);
}

#[test]
fn a_processor_that_fails_leaves_the_worlds_to_the_gpu() {
    // a computer with all of these instructions proves nothing
    let missing = [Lanes::Eight, Lanes::Sixteen];
    let Some(lanes) = missing.into_iter().find(|lanes| !available(*lanes)) else {
        return;
    };
    let wanted = Options {
        lanes,
        ..auto(None)
    };
    let run = launched(&falling(1.0), &wanted);
    assert!(run.sim.device().starts_with("gpu ("), "{}", note(&run));
    assert!(note(&run).contains(": the processor failed: this processor has no "));
    let none = Options {
        compile_limit: Duration::from_micros(1),
        ..wanted
    };
    let failure = Simulation::new(falling(1.0), &none).err().unwrap();
    assert!(failure.to_string().contains("this processor has no"));
    compiled();
}

#[test]
fn a_software_driver_takes_no_part_unless_it_may() {
    let is_software = |info: &sim_engine::options::AdapterInfo| info.kind == AdapterKind::Software;
    if !adapters().iter().all(is_software) {
        return;
    }
    let device = Device::Auto {
        cache: None,
        software: false,
    };
    let run = launched(
        &drawn::model(),
        &options(device, AUTO_WORLDS, &drawn::STATE),
    );
    assert!(run.sim.device().starts_with("cpu"));
    assert_eq!(note(&run), "the processor: no GPU was found");
}

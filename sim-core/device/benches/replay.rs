//! What a batch costs the thread that runs it: recorded once against encoded at each run.
//!
//!     cargo bench --package sim-device --bench replay
//!
//! The clock is the thread's own (CLOCK_THREAD_CPUTIME_ID): waiting costs it nothing, and on lavapipe the work is done by others.

use rustix::time::{ClockId, clock_gettime};
use sim_device::{Batch, Choice, Device, Program, Replay, Source};
use std::time::{Duration, Instant};

/// Runs whose median counts, after as many that do not.
const RUNS: usize = 200;

/// A program that does next to nothing: what is measured is the way there.
const TINY: &str = "
    @group(0) @binding(0) var<storage, read_write> a: array<f32>;
    @compute @workgroup_size(32) fn tiny(@builtin(global_invocation_id) id: vec3<u32>) {
        a[id.x] = a[id.x] * 0.5 + 1.0;
    }";

fn main() {
    let device = Device::open(&Choice::First, None).expect("an adapter");
    let info = device.info();
    println!("{} · {} {}", info.name, info.backend, info.driver);
    let gigabytes = info.memory.unwrap_or(0) as f64 / 1e9;
    println!(
        "{gigabytes:.1} GB, bindings up to {} MiB, imports: {}",
        info.binding_max >> 20,
        info.imports
    );
    println!(
        "medians of {RUNS} runs; CPU time of the submitting thread, then time until done [µs]\n"
    );
    println!("dispatches   recorded    encoded   ratio    recorded    encoded");
    let source = |label: &str, wgsl: String| Source {
        label: label.to_owned(),
        wgsl,
        entry: "tiny".to_owned(),
        constants: Vec::new(),
    };
    // two programs in turn, as the stages of a step are different programs
    let sources = [
        source("tiny", TINY.to_owned()),
        source("tiny too", TINY.replace("0.5", "0.25")),
    ];
    let programs = device
        .programs(&sources, Duration::from_secs(60))
        .expect("it compiles");
    for dispatches in [1, 10, 40, 100, 1000] {
        let [recorded, encoded] = [Replay::Recorded, Replay::Encoded]
            .map(|replay| measure(&device, &batch(&device, &programs, replay, dispatches)));
        println!(
            "{dispatches:>10} {:>10.1} {:>10.1} {:>7.1} {:>11.1} {:>10.1}",
            recorded.0,
            encoded.0,
            encoded.0 / recorded.0,
            recorded.1,
            encoded.1
        );
    }
}

fn batch(device: &Device, programs: &[Program], replay: Replay, dispatches: usize) -> Batch {
    let mut batch = device.batch(replay);
    let buffer = device.buffer("numbers", 4096).expect("4 kB");
    for i in 0..dispatches {
        batch.dispatch(&programs[i % programs.len()], &[(0, &buffer, 0..4096)], 1);
    }
    batch.finish().expect("a batch")
}

/// Medians of CPU time and of time until done [µs].
fn measure(device: &Device, batch: &Batch) -> (f64, f64) {
    let mut both = (Vec::new(), Vec::new());
    for run in 0..2 * RUNS {
        let (spent, since) = (thread_seconds(), Instant::now());
        device.run(&[batch]).expect("a run");
        if run >= RUNS {
            both.0.push((thread_seconds() - spent) * 1e6);
            both.1.push(since.elapsed().as_secs_f64() * 1e6);
        }
    }
    (median(both.0), median(both.1))
}

fn thread_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

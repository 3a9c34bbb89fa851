//! What a batch costs the thread that runs it: recorded once against encoded at each run.
//!
//!     cargo bench --package sim-device --bench replay
//!
//! The clock is the thread's own (CLOCK_THREAD_CPUTIME_ID): waiting costs it nothing, and on lavapipe the work is done by others.

use rustix::time::{ClockId, clock_gettime};
use sim_device::{Batch, Choice, Device, Program, Replay, Source};
use std::time::Duration;

/// Runs that count, after as many that do not.
const RUNS: usize = 400;

/// A program that does almost nothing: the bench measures the way there.
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
    println!("{RUNS} runs; CPU time of the submitting thread [µs]: fastest tenth, median\n");
    println!("dispatches   recorded    encoded   ratio    recorded    encoded   ratio");
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
        print!("{dispatches:>10}");
        for (recorded, encoded) in recorded.into_iter().zip(encoded) {
            let ratio = encoded / recorded;
            print!(" {recorded:>10.1} {encoded:>10.1} {ratio:>7.1} ");
        }
        println!();
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

/// CPU time of a run [µs]: the 10th percentile, where other load shows least, and the median.
fn measure(device: &Device, batch: &Batch) -> [f64; 2] {
    let mut times = Vec::new();
    for run in 0..2 * RUNS {
        let since = thread_seconds();
        device.run(&[batch]).expect("a run");
        if run >= RUNS {
            times.push((thread_seconds() - since) * 1e6);
        }
    }
    times.sort_by(f64::total_cmp);
    [times[RUNS / 10], times[RUNS / 2]]
}

fn thread_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

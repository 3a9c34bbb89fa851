//! One world: what a step costs in process, and what the protocol adds to it.
//!
//! Measures both in turns, so that a machine that changes its speed meanwhile changes both. Prints one line of JSON with
//! the percentiles in process, under `wire` those through a daemon, under `daemon_busy` the daemon's part of them; `benches/daemon/round_trip.py` adds Python to it.

#[path = "../../tests/common/mod.rs"]
mod common;
#[path = "../../tests/daemon/mod.rs"]
mod daemon;

use std::time::Instant;

use common::{Demo, FRAMES, Run, command, lesson};
use sim_engine::backend::Values;
use sim_engine::simulation::Options;
use sim_protocol::{Client, Command, Frame, keep_waiting};

const ROUNDS: usize = 10;
/// Frames of a round before the clock starts: caches, branch predictors and clock speed settle.
const WARM_UP: usize = 1_000;
const MEASURED: usize = 5_000;

fn main() {
    daemon::serve_if_asked();
    let daemon = daemon::Daemon::start("round-trip", &["--threads", "1"]);
    let client = daemon.attach();
    let model = lesson(Demo::Target).compile().expect("the lesson compiles");
    let mut run = Run::new(
        &model,
        Options {
            threads: Some(1),
            ..Options::default()
        },
    );
    let rows: Vec<[f32; 9]> = (0..FRAMES)
        .map(|frame| command(Demo::Target, frame).1.map(|x| x as f32))
        .collect();
    let field = command(Demo::Target, 0).0;

    let (mut here, mut there, mut busy) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        run.sim.reset(None, None).expect("no mask, no error");
        measure(&mut here, &rows, |row| {
            run.sim
                .command(field, 0..9, Values::F32(row))
                .expect("the command is valid");
            run.step();
        });
        client
            .reset(None, None, &mut keep_waiting())
            .expect("the daemon answers");
        measure(&mut there, &rows, |row| {
            let frame = step(&client, row);
            busy.push(frame.header().busy_ns as f64 / 1e3);
        });
    }
    let [here, there, busy] =
        [&mut here, &mut there, &mut busy].map(|trips_us| percentiles(trips_us));
    println!("{{{here}, \"wire\": {{{there}}}, \"daemon_busy\": {{{busy}}}}}");
}

fn step(client: &Client, row: &[f32; 9]) -> Frame {
    let target = Command {
        field: "joint_target_q",
        columns: 0..9,
        values: sim_protocol::Values::F32(row),
    };
    client
        .step(&[target], &mut keep_waiting())
        .expect("the daemon answers")
}

fn measure(trips_us: &mut Vec<f64>, rows: &[[f32; 9]], mut step: impl FnMut(&[f32; 9])) {
    for frame in 0..WARM_UP + MEASURED {
        let start = Instant::now();
        step(&rows[frame % FRAMES]);
        if frame >= WARM_UP {
            trips_us.push(start.elapsed().as_secs_f64() * 1e6);
        }
    }
}

fn percentiles(trips_us: &mut [f64]) -> String {
    trips_us.sort_by(f64::total_cmp);
    let [p50, p99, p999] =
        [0.5, 0.99, 0.999].map(|part| trips_us[(part * trips_us.len() as f64) as usize]);
    format!(r#""p50_us": {p50:.3}, "p99_us": {p99:.3}, "p999_us": {p999:.3}"#)
}

//! Steps per second of the lesson's demos without contacts, in process: one line a case.
//!
//! `cargo bench --bench step -- [worlds …]`; columns: demo, lanes, worlds, threads, steps/s.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Demo, Run, command, lesson};
use sim_core::backend::cpu;
use sim_core::batch::Field;
use sim_core::simulation::{Lanes, Options, Precision};
use std::time::{Duration, Instant};

/// Rounds of a case; the best counts, since the machine may be busy with others.
const ROUNDS: usize = 5;
const ROUND: Duration = Duration::from_millis(400);

fn main() {
    let asked: Vec<usize> = std::env::args().skip(1).filter_map(|arg| arg.parse().ok()).collect();
    let sizes = if asked.is_empty() { vec![1, 64, 1024, 4096, 16384] } else { asked };
    println!("demo,lanes,precision,worlds,threads,steps_per_s");
    for demo in [Demo::Torque, Demo::Target] {
        for (lanes, precision) in [
            (Lanes::Sixteen, Precision::F32),
            (Lanes::Eight, Precision::F32),
            (Lanes::Scalar, Precision::F32),
            (Lanes::Scalar, Precision::F64),
        ] {
            if !cpu::available(lanes) {
                continue;
            }
            for &worlds in &sizes {
                let rate = steps_per_s(demo, lanes, precision, worlds);
                println!("{demo:?},{lanes:?},{precision:?},{worlds},1,{rate:.0}");
            }
        }
    }
}

fn steps_per_s(demo: Demo, lanes: Lanes, precision: Precision, worlds: usize) -> f64 {
    let model = lesson(demo).compile().expect("the lesson compiles");
    let fields = vec![Field::JointQ, Field::JointQd, Field::BodyQ];
    let options = Options { worlds, precision, lanes, threads: Some(1), fields };
    let mut run = Run::new(&model, options);
    let mut best = 0.0_f64;
    let mut frame = 0;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let mut frames = 0;
        while frames == 0 || start.elapsed() < ROUND {
            // a whole demo from its start, again and again
            if frame % common::FRAMES == 0 {
                run.sim.reset(None).expect("a reset without a mask fits");
            }
            let (field, row) = command(demo, frame % common::FRAMES);
            run.command(field, &row);
            run.step();
            frame += 1;
            frames += 1;
        }
        let steps = (frames * worlds * model.substeps()) as f64;
        best = best.max(steps / start.elapsed().as_secs_f64());
    }
    best
}

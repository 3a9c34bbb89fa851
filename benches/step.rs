//! Steps per second of the lesson's demos without contacts, in process: one line a case.
//!
//! `cargo bench --bench step -- [worlds …] [torque|target] [sixteen|eight|scalar] [once]`; `once` runs each
//! case for one pass of the demo, for profilers. Columns: demo, lanes, precision, worlds, threads, steps/s.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Demo, Run, command, lesson};
use sim_core::backend::cpu;
use sim_core::batch::Field;
use sim_core::simulation::{Lanes, Options, Precision};
use std::time::{Duration, Instant};

/// More worlds than this are left out one at a time, which takes long and shows nothing new.
const SCALAR_WORLDS: usize = 64;
/// Rounds of a case; the best counts, since the machine may be busy with others.
const ROUNDS: usize = 3;
const ROUND: Duration = Duration::from_millis(400);

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .map(|word| word.to_lowercase())
        .collect();
    let asked = |word: &str| words.iter().any(|w| w == word);
    let named = |choices: [&str; 3]| choices.iter().any(|c| asked(c));
    let mut sizes: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let all_sizes = sizes.is_empty();
    if all_sizes {
        sizes = vec![1, 64, 1024, 4096, 16384];
    }
    println!("demo,lanes,precision,worlds,threads,steps_per_s");
    for (demo, name) in [(Demo::Torque, "torque"), (Demo::Target, "target")] {
        for (lanes, precision, lanes_name) in [
            (Lanes::Sixteen, Precision::F32, "sixteen"),
            (Lanes::Eight, Precision::F32, "eight"),
            (Lanes::Scalar, Precision::F32, "scalar"),
            (Lanes::Scalar, Precision::F64, "scalar"),
        ] {
            let left_out = (named(["torque", "target", ""]) && !asked(name))
                || (named(["sixteen", "eight", "scalar"]) && !asked(lanes_name));
            if left_out || !cpu::available(lanes) {
                continue;
            }
            for &worlds in &sizes {
                if all_sizes && lanes == Lanes::Scalar && worlds > SCALAR_WORLDS {
                    continue;
                }
                let rate = steps_per_s(demo, lanes, precision, worlds, asked("once"));
                println!("{demo:?},{lanes:?},{precision:?},{worlds},1,{rate:.0}");
            }
        }
    }
}

fn steps_per_s(demo: Demo, lanes: Lanes, precision: Precision, worlds: usize, once: bool) -> f64 {
    let model = lesson(demo).compile().expect("the lesson compiles");
    let fields = vec![Field::JointQ, Field::JointQd, Field::BodyQ];
    let options = Options {
        worlds,
        precision,
        lanes,
        threads: Some(1),
        fields,
    };
    let mut run = Run::new(&model, options);
    let (rounds, round) = if once {
        (1, Duration::ZERO)
    } else {
        (ROUNDS, ROUND)
    };
    let mut best = 0.0_f64;
    for _ in 0..rounds {
        let start = Instant::now();
        let mut frames = 0;
        // whole demos from their start, again and again
        while frames == 0 || start.elapsed() < round {
            run.sim.reset(None).expect("a reset without a mask fits");
            for frame in 0..common::FRAMES {
                let (field, row) = command(demo, frame);
                run.command(field, &row);
                run.step();
            }
            frames += common::FRAMES;
        }
        let steps = (frames * worlds * model.substeps()) as f64;
        best = best.max(steps / start.elapsed().as_secs_f64());
    }
    best
}

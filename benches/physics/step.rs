//! Steps per second without contacts, in process: one line a case.
//!
//! `cargo bench --bench step -- [worlds …] [torque|target|quadruped|humanoid_23|humanoid_29]
//! [sixteen|eight|scalar] [once]`; `once` runs each case for one pass of the demo, for profilers. Columns: demo,
//! lanes, precision, worlds, threads, steps/s.

#[path = "../../tests/common/mod.rs"]
mod common;
#[path = "../robots/mod.rs"]
mod robots;

use common::{Demo, Run, command, lesson};
use robots::Case;
use sim_engine::backend::cpu;
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::Description;
use sim_physics::arrays::Field;
use std::time::{Duration, Instant};

/// More worlds than this are left out one at a time, which takes long and shows nothing new.
const SCALAR_WORLDS: usize = 64;
/// Rounds of a case; the best counts, since the machine may be busy with others.
const ROUNDS: usize = 3;
const ROUND: Duration = Duration::from_millis(400);

/// What moves.
#[derive(Clone, Copy)]
enum Motion {
    Lesson(Demo),
    Robot(Case),
}

const MOTIONS: [Motion; 5] = [
    Motion::Lesson(Demo::Torque),
    Motion::Lesson(Demo::Target),
    Motion::Robot(Case::Quadruped),
    Motion::Robot(Case::Humanoid23),
    Motion::Robot(Case::Humanoid29),
];

impl Motion {
    fn name(self) -> &'static str {
        match self {
            Motion::Lesson(Demo::Torque) => "torque",
            Motion::Lesson(Demo::Target) => "target",
            Motion::Robot(case) => case.name(),
        }
    }

    fn scene(self) -> Description {
        match self {
            Motion::Lesson(demo) => lesson(demo),
            Motion::Robot(case) => case.scene(),
        }
    }

    /// The command of every frame.
    fn commands(self, scene: &Description) -> Vec<(Field, Vec<f64>)> {
        match self {
            Motion::Lesson(demo) => (0..common::FRAMES)
                .map(|frame| command(demo, frame))
                .map(|(field, row)| (field, row.to_vec()))
                .collect(),
            Motion::Robot(_) => (0..robots::FRAMES)
                .map(|frame| {
                    (
                        Field::JointTargetQ,
                        robots::targets(&scene.robots[0], frame),
                    )
                })
                .collect(),
        }
    }
}

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .map(|word| word.to_lowercase())
        .collect();
    let asked = |word: &str| words.iter().any(|w| w == word);
    let named = |choices: &[&str]| choices.iter().any(|c| asked(c));
    let mut sizes: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let all_sizes = sizes.is_empty();
    if all_sizes {
        sizes = vec![1, 64, 1024, 4096, 16384];
    }
    println!("demo,lanes,precision,worlds,threads,steps_per_s");
    let names = MOTIONS.map(Motion::name);
    for motion in MOTIONS {
        let name = motion.name();
        for (lanes, precision, lanes_name) in [
            (Lanes::Sixteen, Precision::F32, "sixteen"),
            (Lanes::Eight, Precision::F32, "eight"),
            (Lanes::Scalar, Precision::F32, "scalar"),
            (Lanes::Scalar, Precision::F64, "scalar"),
        ] {
            let left_out = (named(&names) && !asked(name))
                || (named(&["sixteen", "eight", "scalar"]) && !asked(lanes_name));
            if left_out || !cpu::available(lanes) {
                continue;
            }
            for &worlds in &sizes {
                if all_sizes && lanes == Lanes::Scalar && worlds > SCALAR_WORLDS {
                    continue;
                }
                let rate = steps_per_s(motion, lanes, precision, worlds, asked("once"));
                println!("{name},{lanes:?},{precision:?},{worlds},1,{rate:.0}");
            }
        }
    }
}

fn steps_per_s(
    motion: Motion,
    lanes: Lanes,
    precision: Precision,
    worlds: usize,
    once: bool,
) -> f64 {
    let scene = motion.scene();
    let commands = motion.commands(&scene);
    let model = scene.compile().expect("the scene compiles");
    let fields = vec![Field::JointQ, Field::JointQd, Field::BodyQ];
    let options = Options {
        worlds,
        precision,
        lanes,
        threads: Some(1),
        fields,
        ..Options::default()
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
            run.sim
                .reset(None, None)
                .expect("a reset without a mask fits");
            for (field, row) in &commands {
                run.command(*field, row);
                run.step();
            }
            frames += commands.len();
        }
        let steps = (frames * worlds * model.substeps()) as f64;
        best = best.max(steps / start.elapsed().as_secs_f64());
    }
    best
}

//! How fast: frames of whole runs, each timed from its commands to what it shows.

use crate::scenes::{Plan, WorldSet};
use rustix::time::{ClockId, clock_gettime};
use sim_engine::backend::Values;
use sim_engine::simulation::Simulation;
use std::time::{Duration, Instant};

/// Frames that do not count: caches and pages are cold.
const WARM_UP: usize = 5;
/// How long the GPU is kept busy before a run: one that idles, as during a reset, lowers its clocks within milliseconds.
const AWAKE: Duration = Duration::from_millis(200);
/// Times the wanted duration, after which a run is left before its end.
const PATIENCE: u32 = 10;

/// What frames took [s]: on the wall, and of the thread that asked for them.
#[derive(Default)]
pub struct Frames {
    wall: Vec<f64>,
    thread: Vec<f64>,
    /// The run was too slow to be measured to its end: rates are of its beginning.
    pub is_cut: bool,
}

impl Frames {
    /// Runs a plan from its start, whole runs until `wanted` is over; `words` are the frame.
    pub fn measure(
        sim: &mut Simulation,
        plan: &Plan,
        crowd: &WorldSet,
        words: &mut [u64],
        wanted: Duration,
    ) -> anyhow::Result<Frames> {
        let commands = plan.commands(crowd, usize::MAX);
        plan.start(sim, crowd);
        for values in commands.iter().take(WARM_UP) {
            sim.command(plan.field, 0..plan.columns(), Values::F32(values))?;
            sim.step(words);
        }
        let mut frames = Frames::default();
        let mut spent = 0.0;
        while spent < wanted.as_secs_f64() {
            plan.start(sim, crowd);
            wake(sim, words);
            for (frame, values) in commands.iter().enumerate() {
                let (wall, thread) = (Instant::now(), thread_seconds());
                sim.command(plan.field, 0..plan.columns(), Values::F32(values))?;
                sim.step(words);
                frames.thread.push(thread_seconds() - thread);
                frames.wall.push(wall.elapsed().as_secs_f64());
                spent += frames.wall[frames.wall.len() - 1];
                if spent > (wanted * PATIENCE).as_secs_f64() && frame + 1 < commands.len() {
                    frames.is_cut = true;
                    break;
                }
            }
        }
        if let Some(lost) = sim.lost() {
            anyhow::bail!("{}: {lost}", plan.scene.name());
        }
        frames.sort();
        Ok(frames)
    }

    fn sort(&mut self) {
        self.wall.sort_by(f64::total_cmp);
        self.thread.sort_by(f64::total_cmp);
    }

    /// How many were measured.
    pub fn len(&self) -> usize {
        self.wall.len()
    }

    /// Time of a frame that a share of them does not exceed [ms].
    pub fn wall_ms(&self, share: f64) -> f64 {
        1e3 * at(&self.wall, share)
    }

    /// Time of the thread that asks for a frame, likewise [µs].
    pub fn thread_us(&self, share: f64) -> f64 {
        1e6 * at(&self.thread, share)
    }

    /// So much done a frame makes so much a second: in the median frame.
    pub fn rate(&self, a_frame: usize) -> f64 {
        a_frame as f64 / at(&self.wall, 0.5)
    }

    /// The same, of all frames together.
    pub fn whole_rate(&self, a_frame: usize) -> f64 {
        (a_frame * self.wall.len()) as f64 / self.wall.iter().sum::<f64>()
    }
}

/// Evaluates the worlds where they are until the clocks are up.
pub fn wake(sim: &mut Simulation, words: &mut [u64]) {
    let since = Instant::now();
    while since.elapsed() < AWAKE {
        sim.forward(words);
    }
}

fn at(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64) as usize;
    sorted[place.min(sorted.len() - 1)]
}

fn thread_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

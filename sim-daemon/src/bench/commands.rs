//! Commands of a benchmark: every world follows its own smooth random motion, or holds what that is about.

use sim_engine::backend::{BackendError, Values};
use sim_engine::random::{Draw, Stream};
use sim_engine::simulation::Simulation;
use sim_model::{KeyState, Model};
use sim_physics::arrays::Field;
use sim_physics::constants::{Dof, Motion};

/// Seed of the motion.
const SEED: u64 = 0;
/// Commands repeat after so much simulated time [s], or after so many frames.
const PERIOD: f64 = 2.0;
const FRAMES_MAX: usize = 400;
/// Most numbers of all frames: a gibibyte.
const NUMBERS_MAX: usize = 1 << 28;
/// Fastest sine of a command [Hz], and how many are added.
const FREQUENCY_MAX: f64 = 2.5;
const SINES: usize = 3;
/// Half the range of a target or control that has no bounds [rad, m or –], and of a torque without one [N·m or N].
const HALF_RANGE: f64 = 1.0;

/// What a command swings about, and what it may be.
#[derive(Clone, Copy)]
struct Channel {
    middle: f64,
    low: f64,
    high: f64,
}

impl Channel {
    /// Of a command that swings about the middle of its range.
    fn about(middle: f64, half: f64) -> Channel {
        Channel {
            middle,
            low: middle - half,
            high: middle + half,
        }
    }
}

/// Commands of all frames: one field, `(frames, worlds, columns)`.
pub(super) struct Commands {
    field: Field,
    columns: usize,
    frames: Vec<Vec<f32>>,
    next: usize,
}

impl Commands {
    /// Commands about those of the start or of a keyframe. `swing` is the largest amplitude, as a share of half the range; 0
    /// holds. None where nothing can be commanded.
    pub fn new(
        model: &Model,
        start: Option<&KeyState>,
        worlds: usize,
        swing: f64,
    ) -> Option<Commands> {
        let (field, channels) = channels(model, start);
        if channels.is_empty() {
            return None;
        }
        let frame = model.dt() * model.substeps() as f64;
        let frames = match swing > 0.0 {
            true => {
                let most = (NUMBERS_MAX / (worlds * channels.len())).clamp(1, FRAMES_MAX);
                ((PERIOD / frame).round() as usize).clamp(1, most)
            }
            false => 1,
        };
        let waves = (FREQUENCY_MAX * frames as f64 * frame).floor().max(1.0);
        let mut all = vec![vec![0.0; worlds * channels.len()]; frames];
        for world in 0..worlds {
            let draw = Draw::new(SEED, world as u32, 0, Stream::Task(0));
            for (k, channel) in channels.iter().enumerate() {
                let sine = |i: usize| 3 * (k * SINES + i) as u32;
                let parts: [f64; SINES] = [0, 1, 2].map(|i| draw.uniform(sine(i), 0.0, 1.0));
                let half = (channel.high - channel.low) / 2.0;
                let share = swing * half / parts.iter().sum::<f64>().max(1.0);
                let cycles = [0, 1, 2].map(|i| draw.uniform(sine(i) + 1, 1.0, waves + 1.0).floor());
                let phases = [0, 1, 2].map(|i| draw.uniform(sine(i) + 2, 0.0, 1.0));
                for (number, row) in all.iter_mut().enumerate() {
                    let at = number as f64 / frames as f64;
                    let mut value = channel.middle;
                    for i in 0..SINES {
                        let angle = std::f64::consts::TAU * (cycles[i] * at + phases[i]);
                        value += share * parts[i] * angle.sin();
                    }
                    let value = value.max(channel.low).min(channel.high);
                    row[world * channels.len() + k] = value as f32;
                }
            }
        }
        Some(Commands {
            field,
            columns: channels.len(),
            frames: all,
            next: 0,
        })
    }

    /// What is commanded.
    pub fn field(&self) -> &'static str {
        self.field.row().name
    }

    /// Sends the next frame's.
    pub fn send(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        let row = &self.frames[self.next % self.frames.len()];
        // one frame is sent once, and held
        if self.next < self.frames.len() || self.frames.len() > 1 {
            simulation.command(self.field, 0..self.columns, Values::F32(row))?;
        }
        self.next += 1;
        Ok(())
    }
}

/// What a scene is commanded by: controls of its actuators, targets of its drives, or torques.
fn channels(model: &Model, start: Option<&KeyState>) -> (Field, Vec<Channel>) {
    let m = model.constants();
    if !m.actuators.all.is_empty() {
        let channel =
            |(k, actuator): (usize, &sim_physics::constants::actuators::Actuator<f64>)| {
                let [low, high] = actuator.ctrl_range.unwrap_or([-HALF_RANGE, HALF_RANGE]);
                Channel {
                    middle: start.map_or((low + high) / 2.0, |key| key.ctrl[k]),
                    low,
                    high,
                }
            };
        let actuators = m.actuators.all.iter().enumerate();
        return (Field::Ctrl, actuators.map(channel).collect());
    }
    let targets = &model.start().joint_target_q;
    // a free body has no drive
    let follows =
        |dof: &Dof<f64>| dof.follows_position && m.bodies[dof.body].motion != Motion::Free;
    if m.dofs.iter().any(follows) {
        let channel = |(k, dof): (usize, &Dof<f64>)| {
            let limit = m.limits.iter().find(|limit| limit.dof == k);
            match (follows(dof), limit) {
                (false, _) => Channel::about(targets[k], 0.0),
                (true, None) => Channel::about(targets[k], HALF_RANGE),
                (true, Some(limit)) => Channel {
                    middle: targets[k],
                    low: limit.lower,
                    high: limit.upper,
                },
            }
        };
        let dofs = m.dofs.iter().enumerate();
        return (Field::JointTargetQ, dofs.map(channel).collect());
    }
    let channel = |dof: &Dof<f64>| {
        // the six dofs of a free body have no motor
        let half = match m.bodies[dof.body].motion.dofs() {
            1 => dof.effort_limit.unwrap_or(HALF_RANGE),
            _ => 0.0,
        };
        Channel::about(0.0, half)
    };
    (Field::JointF, m.dofs.iter().map(channel).collect())
}

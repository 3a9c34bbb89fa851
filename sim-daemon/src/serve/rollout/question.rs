//! What a client asks for, checked as far as it needs no simulation.

use serde::Deserialize;
use sim_policy::{Layer, Network};

use crate::serve::exchange::{Exchange, arrays};

/// The JSON of a question.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Question {
    /// Control frames.
    pub(super) frames: usize,
    /// Frames that earlier questions of the same rollout asked for, for messages.
    pub(super) first: usize,
    /// Values that the first layer takes.
    size: usize,
    layers: Vec<Layer>,
    /// What the policy sees.
    pub(super) terms: Vec<Term>,
    /// Lower and upper bound of each value of the action; none where they are taken as they are.
    pub(super) clip: Option<[Vec<f32>; 2]>,
    /// What the action drives.
    pub(super) drives: Vec<Drive>,
    /// Values of the caller that the policy sees.
    pub(super) inputs: Vec<Sequence>,
    /// Sequences of commands: added where the policy drives the same columns.
    pub(super) commands: Vec<CommandSequence>,
    /// Fields to collect.
    pub(super) fields: Vec<String>,
    /// Whether actions are collected, and observations.
    pub(super) collects: [bool; 2],
    /// Lengths of the arrays: parameters of the layers, memory (0 to begin anew), inputs, commands.
    lengths: Vec<usize>,
}

/// A part of what the policy sees: `scale * (values - minus)`, within bounds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Term {
    pub(super) source: Source,
    /// One per value, or none.
    pub(super) minus: Vec<f64>,
    /// As `minus`.
    pub(super) scale: Vec<f64>,
    /// Lower and upper bound of each value, or none.
    pub(super) clip: Option<[Vec<f32>; 2]>,
    /// Frames that are seen of it, the oldest first.
    pub(super) history: usize,
}

/// Where values come from.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Source {
    /// Columns of a field, perhaps as vectors in the axes of a quaternion, or the sine or cosine of `scale * (values - minus)`.
    Field {
        columns: Columns,
        turned_by: Option<Columns>,
        function: Option<Function>,
    },
    /// The direction of gravity in the axes of a quaternion.
    Gravity(Columns),
    /// Values of the caller, by their place among the inputs.
    Input(usize),
    /// The action of the frame before.
    LastAction,
    /// Sine and cosine of a phase, which is 0 while all values of an input are.
    Clock {
        /// Of each frame [rad].
        step: f64,
        input: Option<usize>,
    },
}

/// Columns of a field, of all its axes but the worlds in a row.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Columns {
    pub(super) field: String,
    pub(super) places: Vec<usize>,
}

/// A function of each value.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Function {
    Sin,
    Cos,
}

/// Columns of a command: `offset + scale * action`, within bounds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Drive {
    pub(super) command: String,
    pub(super) columns: Vec<usize>,
    /// The value of the action of each column.
    pub(super) values: Vec<usize>,
    pub(super) scale: Vec<f32>,
    pub(super) offset: Vec<f32>,
    pub(super) low: Vec<Option<f32>>,
    pub(super) high: Vec<Option<f32>>,
    /// Columns that follow another one: its own, the place of its leader among `columns`, multiplier and offset.
    pub(super) followers: Vec<(usize, usize, f32, f32)>,
}

/// Values by frame and world; with one frame or world, for all of them.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sequence {
    pub(super) frames: usize,
    pub(super) worlds: usize,
    pub(super) columns: usize,
}

/// Columns of a command by frame and world.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CommandSequence {
    pub(super) command: String,
    pub(super) first: usize,
    pub(super) values: Sequence,
}

impl Sequence {
    /// The values of a frame and world.
    pub(super) fn row<'a>(&self, values: &'a [f64], frame: usize, world: usize) -> &'a [f64] {
        let frame = if self.frames == 1 { 0 } else { frame };
        let world = if self.worlds == 1 { 0 } else { world };
        &values[(frame * self.worlds + world) * self.columns..][..self.columns]
    }

    fn check(&self, values: &[f64], frames: usize, worlds: usize) -> Result<(), String> {
        let is_one_of = |count: usize, all: usize| count == 1 || count == all;
        let length = [self.frames, self.worlds, self.columns]
            .iter()
            .try_fold(1usize, |all, &n| all.checked_mul(n));
        let fits = is_one_of(self.frames, frames) && is_one_of(self.worlds, worlds);
        match fits && length == Some(values.len()) {
            true => Ok(()),
            false => Err(format!(
                "an array of {} values for ({}, {}, {}) of ({frames}, {worlds}) frames and worlds; use sim.rollout",
                values.len(),
                self.frames,
                self.worlds,
                self.columns
            )),
        }
    }
}

/// A question with its arrays.
pub(super) struct Asked {
    pub(super) question: Question,
    pub(super) network: Network,
    pub(super) memory: Vec<f64>,
    pub(super) inputs: Vec<Vec<f64>>,
    pub(super) commands: Vec<Vec<f64>>,
}

impl Asked {
    /// Reads a question.
    ///
    /// # Errors
    /// One sentence about what does not fit.
    pub(super) fn parse(exchange: &Exchange, worlds: usize) -> Result<Asked, String> {
        let no_question = || "the file is no question; use sim.rollout".to_owned();
        let (text, rest) = exchange.parts().ok_or_else(no_question)?;
        let mut question: Question = serde_json::from_str(text)
            .map_err(|problem| format!("the file is no question: {problem}; use sim.rollout"))?;
        let mut all = arrays(rest, &question.lengths).ok_or_else(no_question)?;
        let counted = 2 + question.inputs.len() + question.commands.len();
        if all.len() != counted {
            return Err(format!(
                "{} arrays for {counted}; use sim.rollout",
                all.len()
            ));
        }
        if question.frames == 0 {
            return Err("0 frames; give at least one".to_owned());
        }
        let commands = all.split_off(2 + question.inputs.len());
        let inputs = all.split_off(2);
        let memory = all.pop().ok_or_else(no_question)?;
        let parameters = all.pop().ok_or_else(no_question)?;
        let seen = question.inputs.iter().zip(&inputs);
        let added = question.commands.iter().map(|command| &command.values);
        for (sequence, values) in seen.chain(added.zip(&commands)) {
            sequence.check(values, question.frames, worlds)?;
        }
        let parameters = parameters.iter().map(|&value| value as f32).collect();
        let layers = std::mem::take(&mut question.layers);
        let network = Network::new(question.size, layers, parameters);
        Ok(Asked {
            network: network.map_err(|error| error.to_string())?,
            question,
            memory,
            inputs,
            commands,
        })
    }
}

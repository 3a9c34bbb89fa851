//! Rollouts with a policy inside: a file asks for control frames, and what was collected takes its place.
//!
//! ```text
//! question   length u64 · JSON of that length, a [`question::Question`] · f64 of its arrays, one after another
//! answer     each collected array, `(frames, worlds, …)`, from a multiple of 64 bytes on; then the policy's memory, f64
//! ```
//! Everything is little endian. Each frame reads what the policy sees from the fields of the frame before, runs the policy
//! per world, and sets the commands as a client would. So recorders get the commands, and need no policy.

mod answer;
mod commands;
mod memory;
mod observation;
mod question;
mod run;
mod steps;

pub(crate) use run::Rollouts;
pub(crate) use steps::Steps;

//! Worlds of a model: a [`simulation::Simulation`] keeps many and steps them on a [`backend`]; [`dynamics::Dynamics`] are
//! functions of given states.
//!
//! Imports run one way: `random ← start ← backend ← snapshot ← options ← simulation ← params ← command ← dynamics`. The physics is the text of
//! `sim-core`, which `sim-core/stages` compile for the machine.

pub mod backend;
mod command;
pub mod dynamics;
pub mod options;
mod params;
pub mod random;
pub mod simulation;
pub mod snapshot;
pub mod start;

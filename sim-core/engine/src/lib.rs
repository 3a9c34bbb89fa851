//! Keeps and steps many worlds of a model.
//!
//! [`simulation::Simulation`] keeps the worlds and steps them on a [`backend`]: the CPU or a GPU. [`dynamics::Dynamics`] evaluates
//! kinematics and dynamics at states that a caller gives. The physics code is `sim_physics`, which the crates under `sim-core/stages`
//! compile for each instruction set.
//!
//! Imports run one way: `workers ← random ← start ← backend ← auto ← snapshot ← options ← simulation ← checks ← params ← write ← command ←
//! dynamics`.

mod auto;
pub mod backend;
mod canonical;
mod checks;
mod command;
pub mod dynamics;
pub mod options;
mod params;
pub mod random;
pub mod simulation;
pub mod snapshot;
pub mod start;
pub mod workers;
mod write;

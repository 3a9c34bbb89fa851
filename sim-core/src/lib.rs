//! Batched rigid-body physics: URDF becomes a [`model::Description`], that a [`model::Model`], and
//! that a [`simulation::Simulation`] of many worlds or [`dynamics::Dynamics`] at given states.
//!
//! Imports run one way: `lane ← math ← model ← batch ← step ← backend ← simulation ← dynamics`. Start reading
//! at [`step`], which is one physics step on one screen.

pub mod backend;
pub mod batch;
pub mod dynamics;
pub mod lane;
pub mod math;
pub mod model;
pub mod simulation;
pub mod step;

//! Batched rigid-body physics: URDF becomes a [`model::Description`], that a [`model::Model`], and [`step`] is what happens
//! to its worlds. `sim-engine` keeps such worlds.
//!
//! Imports run one way: `lane ← math ← model ← batch ← step ← compiled`. Start reading at [`step`], which is one physics
//! step on one screen.

pub mod batch;
pub mod compiled;
pub mod lane;
pub mod math;
pub mod model;
pub mod step;

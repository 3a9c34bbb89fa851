//! Batched rigid-body physics: URDF becomes a [`model::Description`], that a [`model::Model`], and
//! that a [`simulation::Simulation`] of many worlds or [`dynamics::Dynamics`] at given states.
//!
//! Imports run one way: `lane ← math ← model ← batch ← step ← backend ← simulation ← dynamics`. Start reading
//! at [`step`], which is one physics step on one screen.

// The tests inside this crate are of pages below `step`: they do without what compiles the text for every instruction set,
// which takes minutes.
#[cfg(not(test))]
pub mod backend;
pub mod batch;
#[cfg(not(test))]
pub mod dynamics;
pub mod lane;
pub mod math;
pub mod model;
#[cfg(not(test))]
pub mod simulation;
pub mod step;

//! The physics of a step, written once for every execution backend.
//!
//! Imports run one way: `lane ← math ← constants ← arrays ← step ← {schedule, compiled}`. Start reading at [`step`].

pub mod arrays;
pub mod compiled;
pub mod constants;
pub mod lane;
pub mod math;
pub mod schedule;
pub mod step;

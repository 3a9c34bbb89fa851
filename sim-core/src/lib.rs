//! Batched rigid-body physics: a description becomes a model, a model becomes worlds that step.

pub mod model;

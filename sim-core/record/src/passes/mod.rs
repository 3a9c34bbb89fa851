//! Passes over a recording: what is dropped, fused, reordered, vectorized, and shared among threads.

pub(crate) mod dead_code;
pub(crate) mod lanes;
pub(crate) mod loop_fusion;
mod schedule;
pub(crate) mod vectorize;

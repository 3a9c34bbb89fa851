//! Policies: multilayer perceptrons from ONNX files, evaluated with the same bits on every processor.
//!
//! [`onnx::read`] makes a [`Network`] of a file: layers, in single precision. [`Runner`] evaluates it for rows of inputs.
//! Each row is computed alone and its sums run in index order, so that a result depends on no other row.

mod activation;
mod error;
mod kernel;
mod network;
pub mod onnx;
mod runner;

pub use error::PolicyError;
pub use network::{Layer, Network};
pub use runner::Runner;

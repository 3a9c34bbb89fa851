//! The intermediate representation: statements over values, and what each names.
//!
//! It is public for the crate `sim-compile`, which turns it into machine code.

pub(crate) mod recording;
pub mod tree;
pub(crate) mod uses;

//! The intermediate representation: statements over values, and what each names.

pub(crate) mod recording;
pub(crate) mod tree;
pub(crate) mod uses;

//! The GPU: the one text of physics, recorded for a model and printed as compute shaders.

pub mod program;

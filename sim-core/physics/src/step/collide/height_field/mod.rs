//! Height fields: the prisms under a shape, and samples of the surface.

pub mod field_samples;
pub mod fields;

//! Points of a contact: clipped features, and which of the points stay.

pub mod clip;
pub mod clipped;
pub mod points;
pub mod reduction;
pub mod select;

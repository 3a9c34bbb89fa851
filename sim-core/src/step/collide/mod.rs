//! Where shapes touch: a function for each pair of kinds.

pub mod box_faces;
pub mod boxes;
pub mod choose;
pub mod points;

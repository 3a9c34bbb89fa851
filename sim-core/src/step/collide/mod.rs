//! Where shapes touch: a function for each pair of kinds.

pub mod box_faces;
pub mod boxes;
pub mod capsules;
pub mod choose;
pub mod planes;
pub mod points;
pub mod spheres;

//! Pairs of planes, spheres, capsules, boxes, cylinders and ellipsoids, most of them in closed form.

pub mod box_faces;
pub mod boxes;
pub mod capsule_box;
pub mod capsules;
pub mod cylinders;
pub mod ellipsoids;
pub mod planes;
pub mod spheres;

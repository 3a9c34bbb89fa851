//! Small algebra, written once for every backend: vectors, rotations, spatial inertia, factors.

pub mod factor;
pub mod quat;
pub mod spatial;
pub mod vec3;

//! Descriptions and URDF files: what is read, what is mended, what is refused.

mod build;
mod conventions;
mod fr3;
mod hash;
mod likely_mistakes;
mod meshes;
mod mimic;
mod oddities;
mod pose;
mod ranges;
mod refused;
mod shapes;
mod urdf;
mod validate;
mod visuals;

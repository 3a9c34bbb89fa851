//! What shapes are made of, and look like: mesh files, mass properties, convex hulls, triangles for a picture.
//!
//! Everything is f64 and happens when a description is made, never in a step.

mod cache;
mod cluster;
mod height_field;
mod hull;
mod load;
mod mass;
mod mesh;
mod parry;
mod polytope;
mod ray_shape;
mod shape;
mod shown_field;
mod stretch;
mod tessellate;
mod triangle_tree;
mod trimesh;
pub mod vector;
mod visual;

pub use cache::keep_meshes;
pub use height_field::{HeightField, SAMPLES_MAX};
pub use hull::{Edge, Face, Hull, Polygon, WholeHull};
pub use load::{FILE_MAX, TRIANGLES_MAX};
pub use mass::{DENSITY, mass_properties};
pub use mesh::{HULL_NOTE, Mesh, MeshOptions};
pub use ray_shape::{RAY_SMALL, RayShape};
pub use shape::Shape;
pub use stretch::NoHull;
pub use tessellate::triangles;
pub use triangle_tree::TriangleTree;
pub use trimesh::TriMesh;
pub use visual::{Color, Image, TRIANGLES_SHOWN_MAX, Texture, VisualMesh};

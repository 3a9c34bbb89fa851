//! Shapes: what collisions, bodies and static objects are made of.

use std::path::Path;
use std::sync::Arc;

use super::height_field::HeightField;
use super::mesh::{Mesh, MeshOptions};
use crate::error::ModelError;

/// Geometry; axes of revolution are the local z axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All below z = 0, without end; its normal is +z. Of static shapes only.
    Plane,
    /// A cuboid.
    Box {
        /// Half of each edge [m].
        half_extents: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Radius [m].
        radius: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius [m].
        radius: f64,
        /// Half of its height [m].
        half_height: f64,
    },
    /// A cylinder along z with a half sphere at each end.
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half of the height of the cylinder between the half spheres [m].
        half_height: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Radii along the axes [m].
        radii: [f64; 3],
    },
    /// Triangles of a file.
    Mesh(Arc<Mesh>),
    /// What lies below a grid of elevations. Of static shapes only.
    HeightField(Arc<HeightField>),
}

impl Shape {
    /// Its kind in one word.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Plane => "plane",
            Shape::Box { .. } => "box",
            Shape::Sphere { .. } => "sphere",
            Shape::Cylinder { .. } => "cylinder",
            Shape::Capsule { .. } => "capsule",
            Shape::Ellipsoid { .. } => "ellipsoid",
            Shape::Mesh(_) => "mesh",
            Shape::HeightField(_) => "hfield",
        }
    }

    /// The triangles of a file, each axis of which is multiplied by `scale` [–].
    ///
    /// # Errors
    /// Why the file cannot be used, by its path, with the cure.
    pub fn mesh(path: &Path, scale: [f64; 3], options: &MeshOptions) -> Result<Shape, ModelError> {
        Mesh::load(path, scale, options).map(|mesh| Shape::Mesh(Arc::new(mesh)))
    }

    /// What was done to it that its author may not expect, a sentence each.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        let mesh = match self {
            Shape::Mesh(mesh) => Some(mesh),
            _ => None,
        };
        mesh.into_iter().flat_map(|mesh| {
            let notes = mesh.notes.iter();
            notes.map(|note| format!("mesh {} {note}", mesh.path.display()))
        })
    }
}

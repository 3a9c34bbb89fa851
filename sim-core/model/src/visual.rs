//! What links look like. Looks are in no robot and in no hash: those who draw read them beside the physics.

use std::path::PathBuf;
use std::sync::Arc;

use crate::geometry::{Shape, TriMesh};
use crate::pose::Pose;

/// What a part of a link looks like: a `<visual>` of a URDF file, or a geom or site of MuJoCo's.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Name of its link.
    pub link: String,
    /// Its name, if the file gives one.
    pub name: Option<String>,
    /// Its frame in the link frame.
    pub pose: Pose,
    /// Its geometry.
    pub look: Look,
    /// Red, green, blue and opacity of its material, from 0 to 1 [–].
    pub color: Option<[f64; 4]>,
    /// The image of its material.
    pub texture: Option<PathBuf>,
}

/// Geometry of a visual.
#[derive(Clone, Debug, PartialEq)]
pub enum Look {
    /// A box, sphere, cylinder, capsule or height field.
    Shape(Shape),
    /// A part of the plane z = 0 of its frame.
    Sheet {
        /// Half of each edge; infinite where it has no end [m].
        half_extents: [f64; 2],
    },
    /// Triangles, which several visuals may share.
    Triangles {
        /// Its kind in one word.
        kind: &'static str,
        /// The surface.
        surface: Arc<TriMesh>,
    },
    /// A file that is there, in whatever format.
    File {
        /// The file, as resolved.
        path: PathBuf,
        /// Factor on each axis of the file [–].
        scale: [f64; 3],
        /// Whether a COLLADA file is turned from its `<up_axis>` to z up.
        collada_up_axis: bool,
    },
    /// What cannot be shown.
    Nothing {
        /// Why, with the cure.
        problem: String,
    },
}

/// What a file says of looks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Visuals {
    /// All visuals, in file order.
    pub visuals: Vec<Visual>,
    /// Sites of a MuJoCo model, which are seen beside whatever a link looks like, in file order.
    pub sites: Vec<Visual>,
    /// What was left out, one sentence each.
    pub notes: Vec<String>,
}

//! How a URDF file joins a scene.

use std::path::PathBuf;

use crate::geometry::MeshOptions;
use crate::pose::Pose;

/// How a URDF file joins a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfOptions {
    /// Name of the robot in the scene; `None` takes the file's.
    pub name: Option<String>,
    /// Frame of the root link in the world.
    pub pose: Pose,
    /// Whether the root link moves freely.
    pub floating: bool,
    /// Whether its own links touch each other.
    pub self_collisions: bool,
    /// Whether an inertia that no body can have is refused; otherwise it is balanced, with a warning.
    pub strict: bool,
    /// How collision meshes become convex hulls. In a URDF file COLLADA's `<up_axis>` is not applied unless it is asked for:
    /// exporters write `Y_UP` into files that are z up, and RViz leaves these as they are.
    pub meshes: MeshOptions,
    /// Folders that hold the packages of `package://` paths.
    pub package_dirs: Vec<PathBuf>,
}

impl Default for UrdfOptions {
    fn default() -> UrdfOptions {
        UrdfOptions {
            name: None,
            pose: Pose::identity(),
            floating: false,
            self_collisions: false,
            strict: false,
            meshes: MeshOptions {
                collada_up_axis: false,
                ..MeshOptions::default()
            },
            package_dirs: Vec::new(),
        }
    }
}

impl UrdfOptions {
    /// The defaults, under this name.
    pub fn named(name: &str) -> UrdfOptions {
        UrdfOptions {
            name: Some(name.to_owned()),
            ..UrdfOptions::default()
        }
    }
}

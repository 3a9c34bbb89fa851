//! URDF files: text to `Robot`, with everything that is ignored or mended noted, and the rest refused by name.
//!
//! Decisions where files in the wild differ: an absent `effort` or `velocity` is no limit. A revolute or prismatic joint
//! with neither `lower` nor `upper`, or with both the same, is unlimited, as in MuJoCo; with only one of them the other is
//! 0, as URDF has it. A note says so each time.

mod joints;
mod mesh;
mod reader;
mod scan;
mod source;
mod table;
mod value;
mod visual;
mod xml;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::description::{Description, Robot};
use super::error::ModelError;
use super::geometry::MeshOptions;
use super::pose::Pose;
use super::validate::{Culprit, Fault};
use reader::Reader;
use scan::Scan;
pub use visual::{Look, Visual, Visuals};

/// How a URDF file joins a scene.
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// How collision meshes become convex hulls.
    pub meshes: MeshOptions,
    /// Folders that hold the packages of `package://` paths.
    pub package_dirs: Vec<PathBuf>,
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

impl Description {
    /// Reads a robot from a URDF file and adds it.
    ///
    /// # Errors
    /// What is wrong with the file or the options, by name; the scene is then unchanged.
    pub fn add_urdf(
        &mut self,
        path: impl AsRef<Path>,
        options: UrdfOptions,
    ) -> Result<&mut Robot, ModelError> {
        self.add_robot(Robot::from_urdf(path, options)?)
    }
}

impl Robot {
    /// Reads a robot from a URDF file.
    ///
    /// # Errors
    /// What is wrong with the file or the options, by name.
    pub fn from_urdf(path: impl AsRef<Path>, options: UrdfOptions) -> Result<Robot, ModelError> {
        let path = path.as_ref();
        let mut notes = Vec::new();
        let text = source::read(path, &mut notes)?;
        Robot::from_text(&text, path, options, notes)
    }

    /// Reads a robot from the text of a URDF file that lies, or would lie, at `path`.
    ///
    /// # Errors
    /// What is wrong with the text or the options, by name.
    pub fn from_urdf_text(
        text: &str,
        path: impl AsRef<Path>,
        options: UrdfOptions,
    ) -> Result<Robot, ModelError> {
        Robot::from_text(text, path.as_ref(), options, Vec::new())
    }

    fn from_text(
        text: &str,
        path: &Path,
        options: UrdfOptions,
        mut notes: Vec<String>,
    ) -> Result<Robot, ModelError> {
        options.meshes.validate()?;
        let text = source::prepare(text, path, &mut notes)?;
        let document = xml::parse(&text, path)?;
        let scan = Scan::new(&document, path)?;
        let mut reader = Reader {
            scan,
            path,
            options,
            robot: String::new(),
            notes,
            missing_visuals: Vec::new(),
            meshes: HashMap::new(),
        };
        let mut robot = reader.robot()?;
        if !reader.options.strict {
            robot.balance_inertias();
        }
        robot.find_fault().map_err(|fault| reader.place(fault))?;
        Ok(robot)
    }
}

impl Reader<'_, '_> {
    /// A fault with the file and the line of its culprit.
    fn place(&self, fault: Fault) -> ModelError {
        let scan = &self.scan;
        let node = match fault.culprit {
            Culprit::Robot => None,
            Culprit::Link(link) => scan.links.get(link),
            // a floating base is the first joint, and no element
            Culprit::Joint(joint) => joint
                .checked_sub(usize::from(self.options.floating))
                .and_then(|joint| scan.joints.get(joint)),
        };
        scan.place(node.copied().unwrap_or(scan.root()), *fault.error)
    }
}

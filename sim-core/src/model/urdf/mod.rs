//! URDF files: text to `Robot`, with everything that is ignored or mended noted, and the rest refused by name.
//!
//! Decisions where files in the wild differ: an absent `effort` or `velocity` is no limit. A revolute or prismatic joint
//! with neither `lower` nor `upper`, or with both the same, is unlimited, as in MuJoCo; with only one of them the other is
//! 0, as URDF has it. A note says so each time.

mod joints;
mod mesh;
mod reader;
mod scan;
mod table;

use std::collections::HashMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::description::{Description, Robot};
use super::error::ModelError;
use super::geometry::MeshOptions;
use super::pose::Pose;
use reader::Reader;
use scan::Scan;

/// Largest file [bytes]: published robots have some hundred kilobytes.
const FILE_MAX: u64 = 64 << 20;

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
        let robot = Robot::from_urdf(path, options)?;
        if self.robots.iter().any(|other| other.name == robot.name) {
            let owner = "scene".to_owned();
            return Err(ModelError::DuplicateName {
                owner,
                what: "robot",
                name: robot.name,
            });
        }
        self.robots.push(robot);
        Ok(self.robots.last_mut().expect("a robot was just added"))
    }
}

impl Robot {
    /// Reads a robot from a URDF file.
    ///
    /// # Errors
    /// What is wrong with the file or the options, by name.
    pub fn from_urdf(path: impl AsRef<Path>, options: UrdfOptions) -> Result<Robot, ModelError> {
        let path = path.as_ref();
        Robot::from_urdf_text(&read(path)?, path, options)
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
        options.meshes.validate()?;
        let path = path.as_ref();
        let document = scan::parse(text, path)?;
        let scan = Scan::new(&document, path)?;
        let mut reader = Reader {
            scan,
            path,
            options,
            robot: String::new(),
            notes: Vec::new(),
            missing_visuals: Vec::new(),
            meshes: HashMap::new(),
        };
        let mut robot = reader.robot()?;
        if !reader.options.strict {
            robot.balance_inertias();
        }
        robot.validate()?;
        Ok(robot)
    }
}

/// The text of a file, if it is a file, in UTF-8 and not too large.
fn read(path: &Path) -> Result<String, ModelError> {
    let fault = |reason: String| ModelError::File {
        path: path.to_owned(),
        reason,
    };
    let metadata = std::fs::metadata(path).map_err(|error| fault(error.to_string()))?;
    // a pipe or a device may never end
    if !metadata.is_file() {
        return Err(fault("it is not a file".to_owned()));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| fault(error.to_string()))?;
    file.take(FILE_MAX + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| fault(error.to_string()))?;
    if bytes.len() as u64 > FILE_MAX {
        let limit = format!("{} MiB", FILE_MAX >> 20);
        return Err(ModelError::TooLarge {
            path: path.to_owned(),
            what: "the size of the file",
            limit,
        });
    }
    let text = String::from_utf8(bytes).map_err(|_| fault("it is not UTF-8 text".to_owned()))?;
    Ok(text
        .strip_prefix('\u{feff}')
        .map(str::to_owned)
        .unwrap_or(text))
}

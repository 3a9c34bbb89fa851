//! From a URDF file to a checked robot.

use std::collections::HashMap;
use std::path::Path;

use super::options::UrdfOptions;
use super::reader::Reader;
use super::scan::Scan;
use super::{source, xml};
use crate::description::{Description, Robot};
use crate::error::ModelError;
use crate::validate::{Culprit, Fault};

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

    /// Reads a robot from the text of a URDF file. Its meshes are resolved from `path`, which need not exist.
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
            unturned: Vec::new(),
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

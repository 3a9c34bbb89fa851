//! The robot as a whole: what urdf-rs read of it, with what the scan knows of presence.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use roxmltree::Node;

use super::mesh::{self, Found};
use super::options::UrdfOptions;
use super::scan::{Scan, children};
use super::xml::short;
use crate::description::Robot;
use crate::error::ModelError;
use crate::geometry::Mesh;
use crate::pose::Pose;

/// Most files in a warning; each has a note of its own.
const LISTED_MAX: usize = 8;

/// Makes a robot of what urdf-rs read and of what the scan found.
pub(super) struct Reader<'a, 'input> {
    pub scan: Scan<'a, 'input>,
    pub path: &'a Path,
    pub options: UrdfOptions,
    /// Name of the robot, for messages.
    pub robot: String,
    pub notes: Vec<String>,
    /// `link`: file, of visual meshes that are not there.
    pub missing_visuals: Vec<String>,
    /// Names of COLLADA files whose up axis is not applied, with that axis.
    pub unturned: Vec<(String, &'static str)>,
    /// Meshes read so far, by file and the bits of their scale.
    pub meshes: HashMap<(PathBuf, [u64; 3]), Arc<Mesh>>,
}

impl<'a, 'input> Reader<'a, 'input> {
    pub fn robot(&mut self) -> Result<Robot, ModelError> {
        self.refuse_joint_kinds()?;
        let urdf = self.scan.robot.robot().map_err(|error| ModelError::Urdf {
            path: self.path.to_owned(),
            line: 1,
            element: "<robot>".to_owned(),
            reason: error.to_string(),
        })?;
        let file_name = if urdf.name.is_empty() {
            "robot"
        } else {
            &urdf.name
        };
        self.robot = self
            .options
            .name
            .clone()
            .unwrap_or_else(|| file_name.to_owned());

        let links = self.links(&urdf)?;
        let joints = self.joints(&urdf)?;
        let mut notes = self.scan.notes();
        notes.append(&mut self.notes);
        notes.extend(unturned_note(&self.unturned));
        let mut robot = Robot {
            name: self.robot.clone(),
            pose: self.options.pose.normalized(),
            floating: self.options.floating,
            self_collisions: self.options.self_collisions,
            links,
            joints,
            notes,
            warnings: [self.scan.warnings(), self.missing_visuals()].concat(),
            urdf: Some(self.path.to_owned()),
            precompiled: None,
        };
        robot.place_free_bodies();
        if self.options.floating {
            robot.float();
        }
        Ok(robot)
    }

    /// The frame of an element's origin: urdf-rs reads its angles, the scan its quaternion.
    pub(super) fn pose(&self, node: Node, origin: &urdf_rs::Pose) -> Pose {
        Pose::from_rpy(*origin.xyz, self.angles(node, origin))
    }

    /// Roll, pitch and yaw of an element's origin [rad].
    pub(super) fn angles(&self, node: Node, origin: &urdf_rs::Pose) -> [f64; 3] {
        self.scan.angles(node).unwrap_or(*origin.rpy)
    }

    /// Visuals have no part in the physics, so a missing one is only noted.
    pub(super) fn note_missing_visuals(&mut self, link: &str, node: Node) {
        let meshes = children(node, "visual")
            .flat_map(|visual| children(visual, "geometry"))
            .flat_map(|geometry| children(geometry, "mesh"))
            .filter_map(|mesh| mesh.attribute("filename"));
        for uri in meshes {
            if !matches!(
                mesh::resolve(uri, self.folder(), &self.options.package_dirs),
                Found::File(_) | Found::Renamed { .. }
            ) {
                let uri = short(uri);
                self.notes
                    .push(format!("link `{link}`: visual mesh `{uri}` is missing"));
                self.missing_visuals.push(format!("`{link}`: {uri}"));
            }
        }
    }

    /// One warning for all of them.
    fn missing_visuals(&self) -> Vec<String> {
        if self.missing_visuals.is_empty() {
            return Vec::new();
        }
        let files = listed(&self.missing_visuals);
        vec![format!(
            "visual meshes are missing, which only a picture would show: {files}; give package_dirs= or mend the paths"
        )]
    }

    pub(super) fn folder(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

/// The first few, separated by commas.
fn listed(files: &[String]) -> String {
    let shown = &files[..files.len().min(LISTED_MAX)];
    let more = if shown.len() < files.len() {
        ", …"
    } else {
        ""
    };
    shown.join(", ") + more
}

/// One note on all COLLADA files of a robot that say another axis than z is up, each with that axis.
fn unturned_note(files: &[(String, &str)]) -> Option<String> {
    if files.is_empty() {
        return None;
    }
    let named: Vec<String> = files
        .iter()
        .map(|(file, axis)| format!("{file} ({axis})"))
        .collect();
    Some(format!(
        "the <up_axis> of COLLADA files is not applied, as in RViz; if their parts lie wrong, set collada_up_axis: {}",
        listed(&named)
    ))
}

//! Links of a URDF file, and the robot as a whole.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use roxmltree::Node;
use urdf_rs::Geometry;

use super::UrdfOptions;
use super::mesh::{self, Found};
use super::scan::{Scan, children};
use super::xml::short;
use crate::description::{Collision, Inertial, Link, Robot, Shape};
use crate::error::ModelError;
use crate::geometry::{self, Mesh};
use crate::inertia::merge;
use crate::pose::Pose;
use crate::validate::{collision_name, shape_sizes};

/// Most files in a warning; each has a note of its own.
const LISTED_MAX: usize = 8;

/// Turns what urdf-rs read, and what the scan knows of presence, into a robot.
pub(super) struct Reader<'a, 'input> {
    pub scan: Scan<'a, 'input>,
    pub path: &'a Path,
    pub options: UrdfOptions,
    /// Name of the robot, for messages.
    pub robot: String,
    pub notes: Vec<String>,
    /// `link`: file, of visual meshes that are not there.
    pub missing_visuals: Vec<String>,
    /// Meshes read so far, by file and the bits of their scale.
    pub meshes: HashMap<(PathBuf, [u64; 3]), Arc<Mesh>>,
}

impl<'a, 'input> Reader<'a, 'input> {
    pub fn robot(&mut self) -> Result<Robot, ModelError> {
        self.refuse_joint_kinds()?;
        let urdf =
            urdf_rs::read_from_string(&self.scan.text).map_err(|error| ModelError::Urdf {
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
        };
        robot.place_free_bodies();
        if self.options.floating {
            robot.float();
        }
        Ok(robot)
    }

    /// urdf-rs names neither the joint nor the line of a kind it does not know.
    fn refuse_joint_kinds(&self) -> Result<(), ModelError> {
        for &node in &self.scan.joints {
            match node.attribute("type").unwrap_or_default() {
                "revolute" | "continuous" | "prismatic" | "fixed" | "planar" | "floating"
                | "spherical" => {}
                kind => {
                    let reason = format!(
                        "type `{kind}` is unknown; use revolute, continuous, prismatic, spherical, planar, floating or fixed"
                    );
                    return Err(self.scan.fault(node, reason));
                }
            }
        }
        Ok(())
    }

    fn links(&mut self, urdf: &urdf_rs::Robot) -> Result<Vec<Link>, ModelError> {
        let mut links = Vec::with_capacity(urdf.links.len());
        for (index, link) in urdf.links.iter().enumerate() {
            let node = self.scan.links[index];
            let has_inertial = children(node, "inertial").next().is_some();
            let collision_nodes: Vec<Node> = children(node, "collision").collect();
            let mut collisions = Vec::with_capacity(link.collision.len());
            for (collision, &node) in link.collision.iter().zip(&collision_nodes) {
                let shape = self
                    .shape(&link.name, &collision.geometry, node)
                    .map_err(|error| self.scan.place(node, error))?;
                let pose = pose(&collision.origin);
                collisions.push(Collision::new(collision.name.clone(), shape, pose));
            }
            self.note_missing_visuals(&link.name, node);
            let inertial = if has_inertial {
                Some(inertial(&link.inertial))
            } else {
                self.inertial_of(&link.name, &collisions)
                    .map_err(|error| self.scan.place(node, error))?
            };
            links.push(Link {
                name: link.name.clone(),
                inertial,
                collisions,
            });
        }
        Ok(links)
    }

    /// Mass of a link without `<inertial>`: its collisions at one density, overlaps counted as often as they are covered.
    fn inertial_of(
        &mut self,
        link: &str,
        collisions: &[Collision],
    ) -> Result<Option<Inertial>, ModelError> {
        let mut whole: Option<Inertial> = None;
        let owner = format!("robot `{}`: link `{link}`", self.robot);
        for (index, collision) in collisions.iter().enumerate() {
            let what = collision_name(&owner, index, collision);
            shape_sizes(&what, &collision.shape)?;
            let part = geometry::mass_properties(&collision.shape, geometry::DENSITY)
                .map_err(|error| self.of_link(link, error))?;
            let nothing = Inertial {
                mass: 0.0,
                pos: [0.0; 3],
                inertia: [[0.0; 3]; 3],
            };
            whole = Some(merge(&whole.unwrap_or(nothing), &collision.pose, &part));
        }
        if let Some(Inertial { mass, .. }) = whole {
            let density = geometry::DENSITY;
            self.notes.push(format!(
                "link `{link}` has no <inertial>; its collisions at {density} kg/m³ give it {mass:.4e} kg"
            ));
            for collision in collisions {
                if let Shape::Mesh(mesh) = &collision.shape
                    && !mesh.closed
                {
                    let file = mesh.path.display();
                    self.notes.push(format!(
                        "link `{link}`: mesh {file} is not closed, so its mass is that of its convex hull"
                    ));
                }
            }
        }
        Ok(whole)
    }

    /// Says whose mesh an error is about.
    fn of_link(&self, link: &str, error: ModelError) -> ModelError {
        match error {
            ModelError::Mesh { path, reason, .. } => ModelError::Mesh {
                owner: format!("robot `{}`: link `{link}`: ", self.robot),
                path,
                reason,
            },
            other => other,
        }
    }

    /// A collision mesh, which the same file and scale share.
    fn mesh(
        &mut self,
        link: &str,
        path: PathBuf,
        scale: [f64; 3],
    ) -> Result<Arc<Mesh>, ModelError> {
        let key = (path, scale.map(f64::to_bits));
        if let Some(mesh) = self.meshes.get(&key) {
            return Ok(mesh.clone());
        }
        let mesh = Mesh::load(&key.0, scale, &self.options.meshes)
            .map_err(|error| self.of_link(link, error))?;
        for note in &mesh.notes {
            self.notes
                .push(format!("link `{link}`: mesh {} {note}", key.0.display()));
        }
        Ok(self.meshes.entry(key).or_insert(Arc::new(mesh)).clone())
    }

    fn shape(&mut self, link: &str, geometry: &Geometry, node: Node) -> Result<Shape, ModelError> {
        Ok(match geometry {
            Geometry::Box { size } => Shape::Box {
                half_extents: size.map(|edge| 0.5 * edge),
            },
            Geometry::Sphere { radius } => Shape::Sphere { radius: *radius },
            Geometry::Cylinder { radius, length } => Shape::Cylinder {
                radius: *radius,
                half_height: 0.5 * length,
            },
            Geometry::Capsule { radius, length } => Shape::Capsule {
                radius: *radius,
                half_height: 0.5 * length,
            },
            Geometry::Mesh { filename, scale } => {
                let path = match mesh::resolve(filename, self.folder(), &self.options.package_dirs)
                {
                    Found::File(path) => path,
                    Found::Renamed {
                        path,
                        package,
                        home,
                    } => {
                        let note = format!(
                            "package `{package}` is not found by its name; its files are taken from {}",
                            home.display()
                        );
                        if !self.notes.contains(&note) {
                            self.notes.push(note);
                        }
                        path
                    }
                    Found::Missing(tried) => {
                        let (robot, link) = (self.robot.clone(), link.to_owned());
                        return Err(ModelError::MissingMesh {
                            robot,
                            link,
                            uri: filename.clone(),
                            tried,
                        });
                    }
                    Found::Refused(rule) => {
                        return Err(self
                            .scan
                            .fault(node, format!("collision mesh `{filename}`: {rule}")));
                    }
                };
                let scale = scale.map_or([1.0; 3], |scale| *scale);
                if scale.contains(&0.0) {
                    let reason = format!("attribute `scale` is {scale:?}; no factor must be 0");
                    return Err(self.scan.fault(node, reason));
                }
                Shape::Mesh(self.mesh(link, path, scale)?)
            }
        })
    }

    /// Visuals have no part in the physics, so a missing one is worth a note only.
    fn note_missing_visuals(&mut self, link: &str, node: Node) {
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
        let shown = &self.missing_visuals[..self.missing_visuals.len().min(LISTED_MAX)];
        let mut files = shown.join(", ");
        if shown.len() < self.missing_visuals.len() {
            files += ", …";
        }
        vec![format!(
            "visual meshes are missing, which only a picture would show: {files}; give package_dirs= or mend the paths"
        )]
    }

    fn folder(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

pub(super) fn pose(origin: &urdf_rs::Pose) -> Pose {
    Pose::from_rpy(*origin.xyz, *origin.rpy)
}

fn inertial(inertial: &urdf_rs::Inertial) -> Inertial {
    let urdf_rs::Inertia {
        ixx,
        ixy,
        ixz,
        iyy,
        iyz,
        izz,
    } = inertial.inertia;
    let inertia = [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]];
    let frame = pose(&inertial.origin);
    // without rpy the figures stay as they are written, to the bit
    let turned = if *inertial.origin.rpy == [0.0; 3] {
        inertia
    } else {
        frame.rotate_tensor(inertia)
    };
    Inertial {
        mass: inertial.mass.value,
        pos: frame.pos,
        inertia: turned,
    }
}

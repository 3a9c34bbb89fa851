//! Links of a URDF file: inertia, collision shapes and their meshes.

use std::path::PathBuf;
use std::sync::Arc;

use roxmltree::Node;
use urdf_rs::Geometry;

use super::mesh::{self, Found};
use super::reader::Reader;
use super::scan::children;
use super::xml::short;
use crate::description::{Collision, Inertial, Link, Shape};
use crate::error::ModelError;
use crate::geometry::{self, Mesh};
use crate::inertia::merge;
use crate::validate::{collision_name, shape_sizes};

impl Reader<'_, '_> {
    /// All links, in file order.
    pub(super) fn links(&mut self, urdf: &urdf_rs::Robot) -> Result<Vec<Link>, ModelError> {
        let mut links = Vec::with_capacity(urdf.links.len());
        for (index, link) in urdf.links.iter().enumerate() {
            let node = self.scan.links[index];
            let inertial_node = children(node, "inertial").next();
            let collision_nodes: Vec<Node> = children(node, "collision").collect();
            let mut collisions = Vec::with_capacity(link.collision.len());
            for (collision, &node) in link.collision.iter().zip(&collision_nodes) {
                let shape = self
                    .shape(&link.name, &collision.geometry, node)
                    .map_err(|error| self.scan.place(node, error))?;
                let pose = self.pose(node, &collision.origin);
                collisions.push(Collision::new(collision.name.clone(), shape, pose));
            }
            self.note_missing_visuals(&link.name, node);
            let inertial = match inertial_node {
                Some(node) => Some(self.inertial(node, &link.inertial)),
                None => self
                    .inertial_of(&link.name, &collisions)
                    .map_err(|error| self.scan.place(node, error))?,
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

    /// Names the link in an error about a mesh.
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

    /// A collision mesh; links that name the same file with the same scale share it.
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
        if let Some(axis) = mesh.ignored_up_axis {
            let file = key.0.file_name().unwrap_or_default().to_string_lossy();
            let named = (short(&file), axis);
            if !self.unturned.contains(&named) {
                self.unturned.push(named);
            }
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

    /// The `<inertial>` of an element, with its tensor in the link's axes.
    fn inertial(&self, node: Node, inertial: &urdf_rs::Inertial) -> Inertial {
        let urdf_rs::Inertia {
            ixx,
            ixy,
            ixz,
            iyy,
            iyz,
            izz,
        } = inertial.inertia;
        let inertia = [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]];
        let frame = self.pose(node, &inertial.origin);
        // without angles the values stay as they are written, to the bit
        let turned = if self.angles(node, &inertial.origin) == [0.0; 3] {
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
}

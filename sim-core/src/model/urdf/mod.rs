//! URDF files: text to `Robot`, with everything that is ignored or mended noted, and the rest refused by name.
//!
//! Decisions where files in the wild differ: an absent `effort` or `velocity` is no limit. A revolute or prismatic joint
//! needs a range; with only one of `lower` and `upper` the other is 0, as URDF has it, and a note says so.

mod mesh;
mod scan;

use std::collections::HashMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use roxmltree::Node;
use urdf_rs::{Geometry, JointType};

use super::description::{
    Collision, Description, Inertial, Joint, JointKind, Link, Mimic, Robot, Shape,
};
use super::error::ModelError;
use super::pose::Pose;
use mesh::Found;
use scan::{Scan, children, has};

/// Largest file [bytes]: published robots have some hundred kilobytes.
const FILE_MAX: u64 = 64 << 20;

/// How a URDF file joins a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UrdfOptions {
    /// Name of the robot in the scene; `None` takes the file's.
    pub name: Option<String>,
    /// Frame of the root link in the world.
    pub pose: Pose,
    /// Whether the root link moves freely; not supported yet.
    pub floating: bool,
    /// Whether its own links touch each other.
    pub self_collisions: bool,
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
        let path = path.as_ref();
        let document = scan::parse(text, path)?;
        let scan = Scan::new(&document, path)?;
        let mut reader = Reader {
            scan,
            path,
            options,
            robot: String::new(),
            notes: Vec::new(),
        };
        let mut robot = reader.robot()?;
        robot.balance_inertias();
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

struct Reader<'a, 'input> {
    scan: Scan<'a, 'input>,
    path: &'a Path,
    options: UrdfOptions,
    /// Name of the robot, for messages.
    robot: String,
    notes: Vec<String>,
}

impl<'a, 'input> Reader<'a, 'input> {
    fn robot(&mut self) -> Result<Robot, ModelError> {
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
        Ok(Robot {
            name: self.robot.clone(),
            pose: self.options.pose.normalized(),
            floating: self.options.floating,
            self_collisions: self.options.self_collisions,
            links,
            joints,
            notes,
            urdf: Some(self.path.to_owned()),
        })
    }

    /// urdf-rs names neither the joint nor the line of a kind it does not know.
    fn refuse_joint_kinds(&self) -> Result<(), ModelError> {
        for &node in &self.scan.joints {
            match node.attribute("type").unwrap_or_default() {
                "revolute" | "continuous" | "prismatic" | "fixed" => {}
                kind @ ("floating" | "planar" | "spherical" | "ball") => {
                    let root = node.document().root_element();
                    let name = root.attribute("name").unwrap_or("robot");
                    return Err(ModelError::JointKind {
                        robot: self.options.name.clone().unwrap_or_else(|| name.to_owned()),
                        joint: node.attribute("name").unwrap_or_default().to_owned(),
                        kind: kind.to_owned(),
                    });
                }
                kind => {
                    let reason = format!(
                        "type `{kind}` is unknown; use revolute, continuous, prismatic or fixed"
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
                collisions.push(Collision {
                    name: collision.name.clone(),
                    pose: pose(&collision.origin),
                    shape: self.shape(&link.name, &collision.geometry, node)?,
                });
            }
            if !has_inertial && !collisions.is_empty() {
                let name = &link.name;
                self.notes.push(format!(
                    "link `{name}` has collisions but no <inertial>; its mass is taken as 0"
                ));
            }
            self.note_missing_visuals(&link.name, node);
            links.push(Link {
                name: link.name.clone(),
                inertial: has_inertial.then(|| inertial(&link.inertial)),
                collisions,
            });
        }
        Ok(links)
    }

    fn shape(&self, link: &str, geometry: &Geometry, node: Node) -> Result<Shape, ModelError> {
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
                Shape::Mesh {
                    path,
                    scale: scale.map_or([1.0; 3], |scale| *scale),
                }
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
                Found::File(_)
            ) {
                self.notes
                    .push(format!("link `{link}`: visual mesh `{uri}` is missing"));
            }
        }
    }

    fn folder(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    fn joints(&mut self, urdf: &urdf_rs::Robot) -> Result<Vec<Joint>, ModelError> {
        let link_names: Vec<&str> = urdf.links.iter().map(|link| link.name.as_str()).collect();
        let link_index: HashMap<&str, usize> = link_names
            .iter()
            .enumerate()
            .map(|(i, &name)| (name, i))
            .collect();
        let mut joints = Vec::with_capacity(urdf.joints.len());
        for (index, joint) in urdf.joints.iter().enumerate() {
            let node = self.scan.joints[index];
            let find = |role, name: &str| {
                link_index
                    .get(name)
                    .copied()
                    .ok_or_else(|| ModelError::UnknownLink {
                        robot: self.robot.clone(),
                        joint: joint.name.clone(),
                        role,
                        link: name.to_owned(),
                        known: first_few(&link_names),
                    })
            };
            let mut made = Joint::fixed(
                &joint.name,
                find("parent", &joint.parent.link)?,
                find("child", &joint.child.link)?,
            );
            made.origin = pose(&joint.origin);
            made.kind = match joint.joint_type {
                JointType::Revolute | JointType::Continuous => JointKind::Revolute,
                JointType::Prismatic => JointKind::Prismatic,
                _ => JointKind::Fixed,
            };
            if made.moves() {
                made.axis = self.axis(joint)?;
                self.limits(joint, node, &mut made)?;
                if let Some(dynamics) = &joint.dynamics {
                    made.damping = dynamics.damping;
                    made.friction = dynamics.friction;
                }
            } else {
                for name in ["limit", "dynamics", "mimic"] {
                    if let Some(child) = children(node, name).next() {
                        self.scan
                            .ignore(child, format!("<{name}> of a fixed joint"));
                    }
                }
            }
            joints.push(made);
        }
        self.mimics(urdf, &mut joints)?;
        Ok(joints)
    }

    fn axis(&mut self, joint: &urdf_rs::Joint) -> Result<[f64; 3], ModelError> {
        let axis = *joint.axis.xyz;
        // scaled first, so that neither a tiny nor a huge axis is lost in the squares
        let largest = axis
            .iter()
            .fold(0.0_f64, |largest, part| largest.max(part.abs()));
        if largest == 0.0 {
            return Err(ModelError::ZeroAxis {
                robot: self.robot.clone(),
                joint: joint.name.clone(),
            });
        }
        let scaled = axis.map(|part| part / largest);
        let scaled_length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
        let length = scaled_length * largest;
        // one that is a unit to the last bits stays as it was written
        if (length - 1.0).abs() <= 4.0 * f64::EPSILON {
            return Ok(axis);
        }
        if (length - 1.0).abs() > 1e-6 {
            self.notes.push(format!(
                "joint `{}`: axis of length {length} is scaled to 1",
                joint.name
            ));
        }
        Ok(scaled.map(|part| part / scaled_length))
    }

    fn limits(
        &mut self,
        joint: &urdf_rs::Joint,
        node: Node<'a, 'input>,
        made: &mut Joint,
    ) -> Result<(), ModelError> {
        let (lower, upper) = (has(node, "limit", "lower"), has(node, "limit", "upper"));
        let limit = &joint.limit;
        let finite = |name: &str, value: f64| {
            (has(node, "limit", name) && value != f64::INFINITY).then_some(value)
        };
        made.effort_limit = finite("effort", limit.effort);
        made.velocity_limit = finite("velocity", limit.velocity);
        if made.effort_limit == Some(0.0) {
            self.notes.push(format!(
                "joint `{}`: effort limit 0 leaves its drive without effect",
                joint.name
            ));
        }
        if joint.joint_type == JointType::Continuous {
            if lower || upper {
                self.scan
                    .ignore(node, "range of a continuous joint".to_owned());
            }
            return Ok(());
        }
        if !lower && !upper {
            let (kind, alternative) = match made.kind {
                JointKind::Prismatic => ("prismatic", ""),
                _ => ("revolute", ", or make it continuous"),
            };
            let (robot, joint) = (self.robot.clone(), joint.name.clone());
            return Err(ModelError::NoRange {
                robot,
                joint,
                kind,
                alternative,
            });
        }
        let mut range = [limit.lower, limit.upper];
        if range == [f64::NEG_INFINITY, f64::INFINITY] {
            return Ok(());
        }
        for (given, name, side) in [(lower, "lower", 0), (upper, "upper", 1)] {
            if !given {
                // absent ones are 0, whatever the version of the file makes of them
                range[side] = 0.0;
                self.notes.push(format!("joint `{}`: no {name} limit is given, taken as 0", joint.name));
            }
        }
        made.range = Some(range);
        Ok(())
    }

    /// Followers of followers come to follow the first leader: q = o₁ + m₁ (o₂ + m₂ q_leader).
    fn mimics(&self, urdf: &urdf_rs::Robot, joints: &mut [Joint]) -> Result<(), ModelError> {
        let index: HashMap<&str, usize> = urdf
            .joints
            .iter()
            .enumerate()
            .map(|(i, joint)| (joint.name.as_str(), i))
            .collect();
        let mut direct: Vec<Option<Mimic>> = vec![None; joints.len()];
        for (i, joint) in joints.iter().enumerate().filter(|(_, joint)| joint.moves()) {
            let Some(mimic) = &urdf.joints[i].mimic else {
                continue;
            };
            let refuse = |reason| {
                let (robot, joint, leader) =
                    (self.robot.clone(), joint.name.clone(), mimic.joint.clone());
                Err(ModelError::MimicLeader {
                    robot,
                    joint,
                    leader,
                    reason,
                })
            };
            let Some(&leader) = index.get(mimic.joint.as_str()) else {
                return refuse("does not exist");
            };
            if leader == i {
                return refuse("is itself");
            }
            if !joints[leader].moves() {
                return refuse("is fixed");
            }
            let (multiplier, offset) =
                (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
            direct[i] = Some(Mimic {
                joint: leader,
                multiplier,
                offset,
            });
        }
        let mut on_chain = vec![false; joints.len()];
        for start in 0..joints.len() {
            // down to a joint that follows none, or whose leader is known already
            let mut chain: Vec<(usize, Mimic)> = Vec::new();
            let mut joint = start;
            while let Some(mimic) = direct[joint].filter(|_| joints[joint].mimic.is_none()) {
                if std::mem::replace(&mut on_chain[joint], true) {
                    let circle = chain.iter().skip_while(|(member, _)| *member != joint);
                    let joints = circle
                        .map(|&(member, _)| joints[member].name.clone())
                        .collect();
                    return Err(ModelError::MimicLoop {
                        robot: self.robot.clone(),
                        joints,
                    });
                }
                chain.push((joint, mimic));
                joint = mimic.joint;
            }
            for (follower, mimic) in chain.into_iter().rev() {
                joints[follower].mimic = Some(match joints[mimic.joint].mimic {
                    None => mimic,
                    Some(next) => Mimic {
                        joint: next.joint,
                        multiplier: mimic.multiplier * next.multiplier,
                        offset: mimic.offset + mimic.multiplier * next.offset,
                    },
                });
            }
        }
        Ok(())
    }
}

fn pose(origin: &urdf_rs::Pose) -> Pose {
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

/// Enough names to see the slip, not a page of them.
fn first_few(names: &[&str]) -> String {
    let shown: Vec<String> = names
        .iter()
        .take(8)
        .map(|name| format!("`{name}`"))
        .collect();
    let more = if names.len() > shown.len() {
        ", …"
    } else {
        ""
    };
    format!("{}{more}", shown.join(", "))
}

//! A robot as users name it: links with inertia and collision shapes, connected by joints.

use std::path::PathBuf;

use super::joint::Joint;
use super::precompiled::Precompiled;
use crate::geom_contact::GeomContact;
use crate::geometry::Shape;
use crate::inertia::Inertial;
use crate::pose::Pose;
use crate::surface::Surface;

/// A tree of links.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Its name, unique in the scene.
    pub name: String,
    /// Frame of the root link in the world.
    pub pose: Pose,
    /// Whether the root link moves freely.
    pub floating: bool,
    /// Whether its own links touch each other.
    pub self_collisions: bool,
    /// Links, in file order.
    pub links: Vec<Link>,
    /// Joints, in file order.
    pub joints: Vec<Joint>,
    /// What the reader ignored or mended, one sentence each.
    pub notes: Vec<String>,
    /// Notes that change what moves or what is seen, one sentence each. The user should see them at once.
    pub warnings: Vec<String>,
    /// The URDF file it was read from.
    pub urdf: Option<PathBuf>,
    /// What it has beyond links and joints, where MuJoCo compiled it.
    pub precompiled: Option<Box<Precompiled>>,
}

/// A rigid body of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Its name, unique in the robot.
    pub name: String,
    /// Its mass, if it has any.
    pub inertial: Option<Inertial>,
    /// Its shapes for contacts.
    pub collisions: Vec<Collision>,
}

/// A shape of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Collision {
    /// Its name, if the file gives one.
    pub name: Option<String>,
    /// Its frame in the link frame.
    pub pose: Pose,
    /// Its geometry.
    pub shape: Shape,
    /// What it is like where it touches.
    pub surface: Surface,
    /// What it is like instead where it is a geom of MuJoCo's.
    pub geom: Option<GeomContact>,
}

impl Collision {
    /// A shape with the default surface.
    pub fn new(name: Option<String>, shape: Shape, pose: Pose) -> Collision {
        Collision {
            name,
            pose,
            shape,
            surface: Surface::default(),
            geom: None,
        }
    }
}

/// Name of the only link of a rigid body.
pub(crate) const BODY_LINK: &str = "body";

impl Robot {
    /// Whether it stands for a rigid body of the scene ([`crate::Body`]).
    pub(crate) fn is_body(&self) -> bool {
        self.urdf.is_none() && self.links.len() == 1 && self.links[0].name == BODY_LINK
    }
}

//! A scene as users name it: robots, static shapes, time step and solver, in f64 and editable.
//!
//! SI units, radians, z up, quaternions (x, y, z, w).

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use super::distribution::Distribution;
use super::geometry::Mesh;
use super::pose::Pose;
use super::ranges::ParamRanges;
use super::surface::Surface;
use sim_physics::constants::contact::Cone;
use sim_physics::constants::params::Param;

/// Everything a simulation starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Length of one physics step [s].
    pub dt: f64,
    /// Physics steps in a control frame.
    pub substeps: usize,
    /// Gravity in world axes [m/s²].
    pub gravity: [f64; 3],
    /// Options of the constraint solver.
    pub solver: Solver,
    /// Robots, in the order of their dofs.
    pub robots: Vec<Robot>,
    /// Shapes that never move.
    pub shapes: Vec<StaticShape>,
    /// Pairs that never touch: names as [`Description::shape_names`] has them, or of a robot, body or link for all its shapes.
    pub filters: Vec<[String; 2]>,
    /// Most contacts that a world has room for; `None` is as many as its shapes suggest.
    pub contacts_max: Option<usize>,
    /// Most constraint rows of contacts that a world has room for; `None` is as many as its contacts need.
    pub rows_max: Option<usize>,
    /// Parameters that vary from world to world, and may be written while it runs.
    pub params: BTreeSet<Param>,
    /// What the numbers of parameters are drawn from at each reset; such a parameter varies, named above or not.
    pub param_ranges: ParamRanges,
    /// Largest delay of commands that a world may have, where that varies [substeps]; `None` is four control frames.
    pub command_delay_max: Option<usize>,
    /// Frames of interest.
    pub sites: Vec<Site>,
    /// Sums of contact forces.
    pub contact_sensors: Vec<ContactSensor>,
}

/// A frame of interest: in the world, or on a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Its name, unique among the sites.
    pub name: String,
    /// What carries it: a body, or `robot/link`; `None` is the world.
    pub body: Option<String>,
    /// Its frame in that of what carries it.
    pub pose: Pose,
    /// The site, body or `robot/link` that its pose and velocity are measured from; `None` is the world.
    pub relative_to: Option<String>,
    /// Damping λ of its inverse Jacobian [m and rad alike].
    pub damping: f64,
}

impl Site {
    /// Damping where nothing is said [m and rad alike]: of directions in which a unit of joint motion moves the site by 0.05, the inverse keeps half.
    pub const DAMPING: f64 = 0.05;
}

/// The sum of contact forces on some shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSensor {
    /// Its name, unique among the contact sensors.
    pub name: String,
    /// What the forces are on: a shape's name, or that of a robot, body or link for all its shapes.
    pub of: String,
    /// What they come from, named alike; `None` is everything.
    pub against: Option<String>,
}

/// Options of the constraint solver, with MuJoCo's meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Most Newton iterations of a step.
    pub iterations: usize,
    /// Most line-search iterations of a Newton iteration.
    pub ls_iterations: usize,
    /// Scaled improvement below which the solver stops [–].
    pub tolerance: f64,
    /// Shape of the friction cone.
    pub cone: Cone,
    /// Friction impedance over normal impedance [–].
    pub impratio: f64,
}

impl Default for Solver {
    fn default() -> Solver {
        Solver {
            iterations: 20,
            ls_iterations: 100,
            tolerance: 1e-8,
            cone: Cone::Elliptic,
            impratio: 1000.0,
        }
    }
}

/// A shape that never moves.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticShape {
    /// Its name, unique in the scene.
    pub name: String,
    /// Its frame in the world.
    pub pose: Pose,
    /// Its geometry.
    pub shape: Shape,
    /// What it is like where it touches.
    pub surface: Surface,
}

impl StaticShape {
    /// A shape with the default surface.
    pub fn new(name: &str, shape: Shape, pose: Pose) -> StaticShape {
        StaticShape {
            name: name.to_owned(),
            pose,
            shape,
            surface: Surface::default(),
        }
    }
}

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
    /// What was ignored or mended, one sentence each.
    pub notes: Vec<String>,
    /// What of the notes a user should hear at once, since it changes what moves or what is seen; one sentence each.
    pub warnings: Vec<String>,
    /// The file it was read from.
    pub urdf: Option<PathBuf>,
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

/// Mass properties of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass in the link frame [m].
    pub pos: [f64; 3],
    /// Inertia about the centre of mass, in link axes. `(3, 3)` [kg·m²]
    pub inertia: [[f64; 3]; 3],
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
}

impl Collision {
    /// A shape with the default surface.
    pub fn new(name: Option<String>, shape: Shape, pose: Pose) -> Collision {
        Collision {
            name,
            pose,
            shape,
            surface: Surface::default(),
        }
    }
}

/// Geometry; axes of revolution are the local z axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All below z = 0, without end; its normal is +z. Of static shapes only.
    Plane,
    /// A cuboid.
    Box {
        /// Half of each edge [m].
        half_extents: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Radius [m].
        radius: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius [m].
        radius: f64,
        /// Half of its height [m].
        half_height: f64,
    },
    /// A cylinder along z with a half sphere at each end.
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half of the height of the cylinder between the half spheres [m].
        half_height: f64,
    },
    /// Triangles of a file.
    Mesh(Arc<Mesh>),
}

/// What connects a link to its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name, unique in the robot.
    pub name: String,
    /// What motion it allows.
    pub kind: JointKind,
    /// Index of the parent link; `None` is the world, for a floating base.
    pub parent: Option<usize>,
    /// Index of the child link.
    pub child: usize,
    /// Joint frame, which is the child frame at position 0, in the parent frame.
    pub origin: Pose,
    /// Unit vector of the motion in the joint frame, or normal of the plane [–].
    pub axis: [f64; 3],
    /// Lowest and highest position [rad or m]; `None` is without limits. Of joints with one dof only.
    pub range: Option<[f64; 2]>,
    /// Largest speed [rad/s or m/s]; reported, not enforced.
    pub velocity_limit: Option<f64>,
    /// The joint it follows, if any.
    pub mimic: Option<Mimic>,
    /// Position at the start, one entry a coordinate of its kind [rad or m].
    pub q: Vec<f64>,
    /// What resists and drives each of its dofs.
    pub dofs: Vec<JointDof>,
}

/// What resists and drives a dof of a joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointDof {
    /// Viscous damping [N·m·s/rad or N·s/m].
    pub damping: f64,
    /// Dry friction [N·m or N].
    pub friction: f64,
    /// Inertia of the drive seen at the joint [kg·m² or kg].
    pub armature: f64,
    /// Largest drive effort [N·m or N]; `None` is without limit.
    pub effort_limit: Option<f64>,
    /// Position target at the start [rad or m]; `None` is the start position. A ball's is a rotation vector.
    pub target_q: Option<f64>,
    /// Velocity target at the start [rad/s or m/s].
    pub target_qd: f64,
    /// Which errors the drive acts on.
    pub target_mode: TargetMode,
    /// Proportional gain of the drive [N·m/rad or N/m].
    pub target_ke: f64,
    /// Derivative gain of the drive [N·m·s/rad or N·s/m].
    pub target_kd: f64,
    /// What a reset adds to the start position [rad or m]: of a ball a rotation vector in the child's axes, of a free joint
    /// x, y, z, then roll, pitch, yaw about the world's axes. Limits clamp the sum; a follower moves with its leader instead.
    pub offset_q: Option<Distribution>,
    /// What a reset adds to the start velocity, which is 0 [rad/s or m/s].
    pub offset_qd: Option<Distribution>,
}

/// The motion a joint allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// None: the child is part of its parent.
    #[default]
    Fixed,
    /// Rotation about the axis; URDF's `continuous` is one without a range.
    Revolute,
    /// Translation along the axis.
    Prismatic,
    /// Any rotation about the joint frame's origin. Its velocity is in the child's axes.
    Ball,
    /// Two translations across the axis, then a rotation about it. They are along the joint frame's x and y,
    /// turned as its z is turned to the axis the short way (where that points down, after half a turn about x).
    Planar,
    /// Any motion in the world. Position and quaternion of the child's frame; velocity of its centre of
    /// mass, then angular velocity, in world axes.
    Free,
}

impl JointKind {
    /// Names of its position coordinates; empty where there is just one.
    pub const fn coord_names(self) -> &'static [&'static str] {
        match self {
            JointKind::Fixed => &[],
            JointKind::Revolute | JointKind::Prismatic => &[""],
            JointKind::Ball => &["qx", "qy", "qz", "qw"],
            JointKind::Planar => &["x", "y", "angle"],
            JointKind::Free => &["x", "y", "z", "qx", "qy", "qz", "qw"],
        }
    }

    /// Names of its dofs; empty where there is just one.
    pub const fn dof_names(self) -> &'static [&'static str] {
        match self {
            JointKind::Fixed => &[],
            JointKind::Revolute | JointKind::Prismatic => &[""],
            JointKind::Ball => &["wx", "wy", "wz"],
            JointKind::Planar => &["x", "y", "angle"],
            JointKind::Free => &["vx", "vy", "vz", "wx", "wy", "wz"],
        }
    }

    /// Its position at rest: zeros, and the unit quaternion.
    pub fn rest(self) -> Vec<f64> {
        let mut q = vec![0.0; self.coord_names().len()];
        if let (JointKind::Ball | JointKind::Free, Some(w)) = (self, q.last_mut()) {
            *w = 1.0;
        }
        q
    }
}

/// Errors a drive acts on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TargetMode {
    /// ke (q* − q) − kd q̇.
    #[default]
    Position,
    /// kd (q̇* − q̇).
    Velocity,
    /// ke (q* − q) + kd (q̇* − q̇).
    Both,
}

/// q = offset + multiplier · q of the leader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the leader joint, which is itself no follower.
    pub joint: usize,
    /// Factor on the leader's position [–, or m/rad and the like].
    pub multiplier: f64,
    /// Position at the leader's 0 [rad or m].
    pub offset: f64,
}

impl Joint {
    /// A joint between two links, at rest in the parent's frame, about or along x.
    pub fn new(kind: JointKind, name: &str, parent: Option<usize>, child: usize) -> Joint {
        Joint {
            name: name.to_owned(),
            kind,
            parent,
            child,
            origin: Pose::identity(),
            axis: [1.0, 0.0, 0.0],
            range: None,
            velocity_limit: None,
            mimic: None,
            q: kind.rest(),
            dofs: vec![JointDof::default(); kind.dof_names().len()],
        }
    }

    /// A fixed joint between two links.
    pub fn fixed(name: &str, parent: usize, child: usize) -> Joint {
        Joint::new(JointKind::Fixed, name, Some(parent), child)
    }

    /// Whether it has dofs.
    pub fn moves(&self) -> bool {
        self.kind != JointKind::Fixed
    }
}

impl Description {
    /// An empty scene: steps of `dt` [s], `substeps` of them in a control frame, gravity 9.81 m/s² downwards.
    pub fn new(dt: f64, substeps: usize) -> Description {
        Description {
            dt,
            substeps,
            gravity: [0.0, 0.0, -9.81],
            solver: Solver::default(),
            robots: Vec::new(),
            shapes: Vec::new(),
            filters: Vec::new(),
            contacts_max: None,
            rows_max: None,
            params: BTreeSet::new(),
            param_ranges: ParamRanges::new(),
            command_delay_max: None,
            sites: Vec::new(),
            contact_sensors: Vec::new(),
        }
    }
}

impl Shape {
    /// Its kind in one word.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Plane => "plane",
            Shape::Box { .. } => "box",
            Shape::Sphere { .. } => "sphere",
            Shape::Cylinder { .. } => "cylinder",
            Shape::Capsule { .. } => "capsule",
            Shape::Mesh(_) => "mesh",
        }
    }
}

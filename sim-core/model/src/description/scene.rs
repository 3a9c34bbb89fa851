//! A scene as users name it: robots, static shapes, time step and solver, in f64 and editable.
//!
//! SI units, radians, z up, quaternions (x, y, z, w).

use std::collections::BTreeSet;

use super::camera::Camera;
use super::robot::Robot;
use crate::distribution::ParamRanges;
use crate::error::ModelError;
use crate::geometry::Shape;
use crate::pose::Pose;
use crate::surface::Surface;
use sim_physics::constants::contact::{Cone, FrictionCombine};
use sim_physics::constants::params::Param;

/// Default capacity for delays of commands [control frames].
const DELAY_FRAMES: usize = 4;

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
    /// How the friction of two shapes combines; contacts with geoms of MuJoCo models keep MuJoCo's rule.
    pub friction_combine: FrictionCombine,
    /// Robots, in the order of their dofs.
    pub robots: Vec<Robot>,
    /// Shapes that never move.
    pub shapes: Vec<StaticShape>,
    /// Pairs that never touch: names as [`Description::shape_names`] has them, or of a robot, body or link for all its shapes.
    pub filters: Vec<[String; 2]>,
    /// Capacity for contacts of a world; `None` derives it from the shapes.
    pub contacts_max: Option<usize>,
    /// Capacity for constraint rows of contacts of a world; `None` derives it from the capacity for contacts.
    pub rows_max: Option<usize>,
    /// Parameters that vary from world to world, and may be written while it runs.
    pub params: BTreeSet<Param>,
    /// Distributions that a reset draws parameters from. Such a parameter varies, whether `params` names it or not.
    pub param_ranges: ParamRanges,
    /// Largest delay of commands that a world may have, where that varies [substeps]; `None` is four control frames.
    pub command_delay_max: Option<usize>,
    /// Frames of interest.
    pub sites: Vec<Site>,
    /// Sums of contact forces.
    pub contact_sensors: Vec<ContactSensor>,
    /// Grids of vertical rays.
    pub height_scans: Vec<HeightScan>,
    /// Cameras, for those who draw.
    pub cameras: Vec<Camera>,
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
    /// Default damping [m and rad alike]: the inverse keeps half of a direction in which a unit of joint motion moves the
    /// site by 0.05.
    pub const DAMPING: f64 = 0.05;
}

/// The sum of contact forces on some shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSensor {
    /// Its name, unique among the contact sensors.
    pub name: String,
    /// What the forces are on: a shape's name, or that of a robot, body or link for all its shapes.
    pub of: String,
    /// What they come from, named in the same way; `None` is everything.
    pub against: Option<String>,
}

/// A grid of vertical rays under a frame, turned with the frame about the vertical alone.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightScan {
    /// Its name, unique among the height scans.
    pub name: String,
    /// What carries it: a body, or `robot/link`; `None` is the world.
    pub body: Option<String>,
    /// Middle of the grid in the frame of what carries it [m].
    pub pos: [f64; 3],
    /// Rays along x and y.
    pub counts: [usize; 2],
    /// Distances between neighbouring rays along x and y [m].
    pub spacing: [f64; 2],
    /// The distance where the ground is farther away, or where there is none [m].
    pub reach: f64,
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

impl Description {
    /// An empty scene: steps of `dt` [s], `substeps` of them in a control frame, gravity 9.81 m/s² downwards.
    pub fn new(dt: f64, substeps: usize) -> Description {
        Description {
            dt,
            substeps,
            gravity: [0.0, 0.0, -9.81],
            solver: Solver::default(),
            friction_combine: FrictionCombine::Max,
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
            height_scans: Vec::new(),
            cameras: Vec::new(),
        }
    }

    /// Adds a robot under its name.
    ///
    /// # Errors
    /// A name that another robot or body has.
    pub fn add_robot(&mut self, robot: Robot) -> Result<&mut Robot, ModelError> {
        if self.robots.iter().any(|other| other.name == robot.name) {
            return Err(ModelError::DuplicateName {
                owner: "scene".to_owned(),
                what: "robot",
                name: robot.name,
            });
        }
        self.robots.push(robot);
        Ok(self.robots.last_mut().expect("a robot was just added"))
    }

    /// Largest delay of commands that a world may have [substeps].
    pub(crate) fn delay_max(&self) -> usize {
        self.command_delay_max
            .unwrap_or(DELAY_FRAMES * self.substeps)
    }
}

//! Constants of a model as physics code reads them, in the precision of the run.

pub mod actuators;
pub mod clip;
pub mod contact;
pub mod height_field;
pub mod hull;
pub mod lengths;
pub mod options;
pub mod outputs;
pub mod pair_groups;
pub mod params;
pub mod passive;
mod recast;
pub mod rolled;
pub mod scan;
pub mod sensors;
pub mod site;
mod sizes;
pub mod springs;
pub mod tendons;
pub mod ties;

pub use self::recast::Recast;
pub use self::sizes::Sizes;

use self::actuators::Actuators;
use self::contact::Contacts;
use self::options::{Integrator, Newton, Search};
use self::outputs::OutputFrames;
use self::params::{COMMAND_NOISES, Varying};
use self::passive::{Drag, FluidGeom, GravityCompensation};
use self::recast::{recast, same};
use self::scan::HeightScan;
use self::sensors::Sensors;
use self::site::Site;
use self::springs::Springs;
use self::tendons::SpatialTendon;
use self::ties::Tie;
use crate::lane::Real;
use crate::math::factor::Pattern;

recast! {
    /// A model's constants. Bodies are sorted so that parents precede children, dofs by their bodies.
    #[derive(Clone, Debug)]
    pub struct Constants<R> {
        /// Duration of one substep [s].
        pub dt: R,
        /// Gravity in world axes [m/s²].
        pub gravity: [R; 3],
        /// Bodies that move, each with the joint that carries it.
        pub bodies: Vec<Body<R>>,
        /// Degrees of freedom.
        pub dofs: Vec<Dof<R>>,
        /// Robots: where their reference points are.
        pub trees: Vec<Tree<R>>,
        /// Frames of all links, those that move with another included.
        pub frames: Vec<Frame<R>>,
        /// Does any joint or drive have damping?
        pub damped: bool,
        /// Entries of the mass matrix, dof by dof, each with the place where it is kept: the dof itself last.
        pub mass_entries: Vec<MassEntry>,
        /// Places of the pattern that are 0 in the mass matrix.
        pub mass_zeros: Vec<usize>,
        /// Position coordinates of all joints.
        pub coords: usize,
        /// Soft equality of two joints.
        pub equalities: Vec<Equality<R>>,
        /// Dry friction of a joint.
        pub frictions: Vec<Friction<R>>,
        /// Range of a joint.
        pub limits: Vec<Limit<R>>,
        /// Entries of the mass matrix and of the solver's Hessian that may differ from zero.
        pub pattern: Pattern,
        /// The same where contacts couple what the mass matrix does not; empty where none can.
        pub coupled: Coupled,
        /// Shapes, and which may touch.
        pub contacts: Contacts<R>,
        /// Impedance of contacts.
        pub contact_impedance: Impedance<R>,
        /// Solver options.
        pub solver: Newton<R>,
        /// Which of these scalars vary from world to world.
        pub varying: Varying,
        /// How late commands may be.
        pub delay: Delay,
        /// Frames of interest.
        pub sites: Vec<Site<R>>,
        /// Height scans.
        pub scans: Vec<HeightScan<R>>,
        /// How a step integrates velocities.
        pub integrator: Integrator,
        /// Spatial tendons.
        pub tendons: Vec<SpatialTendon<R>>,
        /// Springs and dampers.
        pub springs: Springs<R>,
        /// Bodies of free joints whose armature and damping belong to the velocity of their frame.
        pub free_joints: Vec<usize>,
        /// Dofs of all other joints: theirs belong to the dof, that is, to the diagonal of the mass matrix.
        pub diagonal_dofs: Vec<usize>,
        /// Free bodies that carry nothing and have more in the implicit mass matrix than their inertia: a step solves for their
        /// accelerations with the change of their bias force.
        pub solved_bodies: Vec<usize>,
        /// Other free bodies that carry nothing: a step is implicit in their gyroscopic force alone.
        pub gyroscopic_bodies: Vec<usize>,
        /// What the medium does to links.
        pub drags: Vec<Drag<R>>,
        /// What the medium does to geoms.
        pub fluid_geoms: Vec<FluidGeom<R>>,
        /// Links that are held against gravity.
        pub compensation: GravityCompensation<R>,
        /// Constraints whose Jacobians are found at run time.
        pub ties: Vec<Tie<R>>,
        /// Of each of their rows, its tie.
        pub tie_of_row: Vec<usize>,
        /// Equalities that clients switch on and off.
        pub switches: usize,
        /// Actuators.
        pub actuators: Actuators<R>,
        /// Bodies that clients place.
        pub mocaps: usize,
        /// Frames that outputs are of.
        pub outputs: OutputFrames<R>,
        /// Sensors.
        pub sensors: Sensors<R>,
    }
}

/// How late commands may be.
#[derive(Clone, Copy, Debug, Default)]
pub struct Delay {
    /// Control frames back of which the commands are kept; 0 where nothing is late.
    pub frames: usize,
    /// Substeps of a control frame.
    pub substeps: usize,
}

/// The pattern of a larger system that holds a smaller one.
#[derive(Clone, Debug, Default)]
pub struct Coupled {
    /// The larger pattern.
    pub pattern: Pattern,
    /// Where each entry of the smaller one is kept in it.
    pub places: Vec<usize>,
}

/// How a body moves in the frame that carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Rotates about its z axis: 1 coordinate, 1 dof.
    Revolute,
    /// Slides along its z axis: 1 coordinate, 1 dof.
    Prismatic,
    /// Rotates about its origin: a quaternion, and the angular velocity in the body's axes.
    Ball,
    /// Moves freely in the world: position and quaternion of its frame; velocity of its centre of mass,
    /// then angular velocity, in world axes.
    Free,
    /// Where clients put it: no coordinate and no dof. [`Body::coord`] is its place among these.
    Mocap,
}

impl Motion {
    /// Number of position coordinates.
    pub const fn coords(self) -> usize {
        match self {
            Motion::Revolute | Motion::Prismatic => 1,
            Motion::Ball => 4,
            Motion::Free => 7,
            Motion::Mocap => 0,
        }
    }

    /// Number of degrees of freedom.
    pub const fn dofs(self) -> usize {
        match self {
            Motion::Revolute | Motion::Prismatic => 1,
            Motion::Ball => 3,
            Motion::Free => 6,
            Motion::Mocap => 0,
        }
    }
}

recast! {
    /// A body and its joint. The axis of a joint with one is the z axis of the body's frame.
    #[derive(Clone, Debug)]
    pub struct Body<R> {
        /// How it moves.
        pub motion: Motion,
        /// The body that carries this one; none for the base or the world.
        pub parent: Option<usize>,
        /// Its robot.
        pub tree: usize,
        /// Its first dof.
        pub dof: usize,
        /// Its first position coordinate.
        pub coord: usize,
        /// Frame at rest in the carrier's frame: columns of the rotation [–].
        pub rotation: [[R; 3]; 3],
        /// The same rotation, where it only permutes axes: which axis of the carrier each one is, and whether it is reversed.
        pub exchange: Option<[(usize, bool); 3]>,
        /// The same rotation as a quaternion (x, y, z, w) [–].
        pub quat: [R; 4],
        /// Origin of the frame at rest in the carrier's frame [m].
        pub position: [R; 3],
        /// Mass, links fixed to it included [kg].
        pub mass: R,
        /// Centre of mass in the body's frame [m].
        pub center: [R; 3],
        /// xx yy zz xy xz yz about the centre of mass, in the body's axes [kg·m²].
        pub inertia: [R; 6],
        /// The links that make it up, where their masses vary.
        pub parts: Vec<Part<R>>,
    }
}

recast! {
    /// A link that is fixed to others, or the only one of a body.
    #[derive(Clone, Debug)]
    pub struct Part<R> {
        /// Its index among the links.
        pub link: usize,
        /// [kg]
        pub mass: R,
        /// Its centre of mass in the body's frame [m].
        pub center: [R; 3],
        /// xx yy zz xy xz yz about its centre of mass, in the body's axes [kg·m²].
        pub inertia: [R; 6],
        /// Columns of the rotation from the link's axes to the body's, where its inertia or centre of mass varies [–].
        pub link_axes: Option<[[R; 3]; 3]>,
        /// Origin of the link in the body's frame, where its centre of mass varies [m].
        pub link_origin: Option<[R; 3]>,
    }
}

impl<R> Body<R> {
    /// Its dofs.
    #[inline(always)]
    pub fn dofs(&self) -> std::ops::Range<usize> {
        self.dof..self.dof + self.motion.dofs()
    }
}

recast! {
    /// A degree of freedom.
    #[derive(Clone, Debug)]
    pub struct Dof<R> {
        /// The body that it moves.
        pub body: usize,
        /// The position coordinate that it changes, where there is just one.
        pub coord: usize,
        /// Its part of `mass_entries`.
        pub entries: (usize, usize),
        /// Inertia of the drive, added to the diagonal of the mass matrix [kg·m² or kg].
        pub armature: R,
        /// Passive damping [N·m·s/rad or N·s/m].
        pub damping: R,
        /// By which its damping grows with the speed and its square [N·m·s²/rad², N·m·s³/rad³ or N·s²/m², N·s³/m³].
        pub damping_curve: [R; 2],
        /// Proportional gain, 0 in velocity mode [N·m/rad or N/m].
        pub ke: R,
        /// Derivative gain [N·m·s/rad or N·s/m].
        pub kd: R,
        /// Does the drive follow the position target?
        pub follows_position: bool,
        /// Does the drive follow the velocity target?
        pub follows_velocity: bool,
        /// Bound of the drive's force; none = no limit [N·m or N].
        pub effort_limit: Option<R>,
    }
}

/// An entry of the mass matrix: a dof, and one on its path to the root or itself.
#[derive(Clone, Copy, Debug)]
pub struct MassEntry {
    /// The dof that is before it on the path to the root, or itself.
    pub other: usize,
    /// Where the entry is kept.
    pub place: usize,
}

recast! {
    /// A robot. Its kinematics are about a reference point, so that f32 does not lose what is far from the origin.
    #[derive(Clone, Debug)]
    pub struct Tree<R> {
        /// World position of the base, the reference point of a robot that is fixed to the world [m].
        pub base: [R; 3],
        /// The free body whose centre of mass is the reference point instead.
        pub free: Option<usize>,
    }
}

recast! {
    /// A link's frame: a constant pose in the frame of the body that carries it.
    #[derive(Clone, Debug)]
    pub struct Frame<R> {
        /// The carrying body; none for what is fixed to the world.
        pub body: Option<usize>,
        /// Its robot.
        pub tree: usize,
        /// Origin in the carrier's frame, or relative to the base [m].
        pub position: [R; 3],
        /// Orientation in the carrier's frame, (x, y, z, w) [–].
        pub quat: [R; 4],
        /// The link's own centre of mass in the carrier's frame, or relative to the base; its origin if the link has no inertial [m].
        pub center: [R; 3],
    }
}

recast! {
    /// Softness of a constraint row whose impedance depends on its position.
    #[derive(Clone, Copy, Debug)]
    pub struct Soft<R> {
        /// Reference stiffness k of `aref = -b v - k imp pos` [1/s²].
        pub stiffness: R,
        /// Reference damping b [1/s].
        pub damping: R,
        /// Approximate inverse inertia seen by the row [1/(kg·m²) or 1/kg].
        pub inverse_weight: R,
        /// Impedance.
        pub impedance: Impedance<R>,
    }
}

recast! {
    /// MuJoCo's `solimp`: impedance rises from `d_min` at 0 to `d_max` at `width`, along two curves that meet at `midpoint`.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Impedance<R> {
        /// At the constraint's surface [–].
        pub d_min: R,
        /// At `width` and beyond [–].
        pub d_max: R,
        /// 1 / width, the position at which `d_max` is reached [1/m or 1/rad].
        pub inverse_width: R,
        /// Where the curves meet, as a share of the width [–].
        pub midpoint: R,
        /// Their exponent: 1 for a line, 2 for parabolas [–].
        pub power: R,
    }
}

recast! {
    /// `q[follower] = offset + multiplier q[leader]`.
    #[derive(Clone, Debug)]
    pub struct Equality<R> {
        /// Dof that follows.
        pub follower: usize,
        /// Dof that leads.
        pub leader: usize,
        /// [–]
        pub multiplier: R,
        /// [rad or m]
        pub offset: R,
        /// Softness.
        pub soft: Soft<R>,
    }
}

recast! {
    /// Dry friction: a force of at most `loss` against motion.
    #[derive(Clone, Debug)]
    pub struct Friction<R> {
        /// Dof with friction.
        pub dof: usize,
        /// Bound of the force [N·m or N].
        pub loss: R,
        /// Reference damping b of `aref = -b v` [1/s].
        pub damping: R,
        /// Regularised stiffness D = 1/R.
        pub weight: R,
        /// R = 1/D: beyond R × loss the force is at its bound.
        pub regularizer: R,
        /// R × loss.
        pub zone: R,
    }
}

/// Bounds of an impedance (MuJoCo: `mjMINIMP`, `mjMAXIMP`) [–].
pub const IMPEDANCE_BOUNDS: [f64; 2] = [1e-4, 0.9999];
/// Least width of an impedance that has one (MuJoCo: `mjMINVAL`) [m or rad].
pub const WIDTH_MIN: f64 = 1e-15;
/// MuJoCo's default `solref`: time constant [s], damping ratio [–].
pub const SOLREF_DEFAULT: [f64; 2] = [0.02, 1.0];
/// An end of a range that no joint reaches [rad or m].
pub const FAR: f64 = 1e18;

recast! {
    /// Range of a joint, soft on both sides.
    #[derive(Clone, Debug)]
    pub struct Limit<R> {
        /// Dof that is limited.
        pub dof: usize,
        /// [rad or m]
        pub lower: R,
        /// [rad or m]
        pub upper: R,
        /// Distance from an end at which the limit acts, which both ends count already [rad or m].
        pub margin: R,
        /// Softness.
        pub soft: Soft<R>,
    }
}

impl<R: Real> Constants<R> {
    /// The path of the solver from start to end where the model prescribes it: in `f64`, in which it can be followed.
    #[inline(always)]
    pub fn prescribed_search(&self) -> Option<&Search<R>> {
        self.solver.search.as_ref().filter(|_| R::DOUBLE)
    }

    /// Dofs for which the solver keeps islands.
    pub fn island_dofs(&self) -> usize {
        self.prescribed_search().map_or(0, |_| self.dofs.len())
    }

    /// The same constants, rounded to another precision.
    pub fn cast<S: Real>(&self) -> Constants<S>
    where
        R: Recast<S, Out = S>,
    {
        self.recast()
    }

    /// Do commands come late, or with noise?
    #[inline(always)]
    pub fn alters_commands(&self) -> bool {
        self.delay.frames > 0 || self.noisy_commands()
    }

    /// Is noise added to commands?
    #[inline(always)]
    pub fn noisy_commands(&self) -> bool {
        COMMAND_NOISES
            .iter()
            .any(|&noise| self.varying.first(noise).is_some())
    }

    /// First coordinate of each quaternion.
    pub fn quaternions(&self) -> impl Iterator<Item = usize> + '_ {
        self.bodies.iter().filter_map(|body| match body.motion {
            Motion::Ball => Some(body.coord),
            Motion::Free => Some(body.coord + 3),
            Motion::Revolute | Motion::Prismatic | Motion::Mocap => None,
        })
    }

    /// Constraint rows: equalities, then frictions, then limits (MuJoCo's order), then those of ties.
    #[inline(always)]
    pub fn rows(&self) -> usize {
        self.joint_rows() + self.tie_of_row.len()
    }

    /// The rows before those of ties.
    #[inline(always)]
    pub fn joint_rows(&self) -> usize {
        self.equalities.len() + self.frictions.len() + self.limits.len()
    }
}

same! { Motion, MassEntry, Pattern, Coupled, Varying, Delay }

//! What only models from MuJoCo have: springs, actuators, softness of each contact, and the choice of an integrator.

use super::Impedance;
use super::actuator::{Activation, TurningLength};
use super::mujoco_frames::MujocoFrames;
use super::recast::{Recast, recast, same};
use super::sensors::Sensors;
use super::ties::Tie;
use crate::lane::Fixed;
use std::ops::Range;

/// How a step integrates velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Implicit in damping of joints, drives and actuators, and in the gyroscopic force of free bodies.
    #[default]
    ImplicitFast,
    /// Implicit in the damping of joints and drives alone.
    Euler,
    /// Runge-Kutta of fourth order.
    RungeKutta,
}

recast! {
    /// What only models from MuJoCo have; all empty for other models.
    #[derive(Clone, Debug)]
    pub struct Mujoco<R> {
        /// How a step integrates velocities.
        pub integrator: Integrator,
        /// How the solver ends its iterations and line searches in `f64`.
        pub search: Option<Search<R>>,
        /// Springs of joints.
        pub springs: Vec<Spring<R>>,
        /// Springs of balls and free joints.
        pub pose_springs: Vec<PoseSpring<R>>,
        /// Bodies of free joints whose armature and damping belong to MuJoCo's velocities.
        pub free_joints: Vec<usize>,
        /// What the medium does to links.
        pub drags: Vec<Drag<R>>,
        /// Links that are held against gravity.
        pub compensations: Vec<Compensation<R>>,
        /// Dofs that this moves, except those of the next list.
        pub compensated: Vec<usize>,
        /// Dofs of which it counts as a force of actuators.
        pub compensated_by_actuators: Vec<usize>,
        /// Springs and dampers of tendons.
        pub tendons: Vec<Tendon<R>>,
        /// Constraints whose Jacobians are found at run time.
        pub ties: Vec<Tie<R>>,
        /// Of each of their rows, its tie.
        pub tie_of_row: Vec<usize>,
        /// How many equalities there are.
        pub equalities: usize,
        /// Actuators.
        pub actuators: Vec<Actuator<R>>,
        /// How many of them have an activation.
        pub activations: usize,
        /// Bodies that clients place.
        pub mocaps: usize,
        /// Bounds of the sum of actuator forces on a dof.
        pub actuator_bounds: Vec<ActuatorBound<R>>,
        /// Bounds of the sum of actuator forces along a tendon.
        pub tendon_bounds: Vec<TendonBound<R>>,
        /// Impedances of contacts, each once; empty where all have `Constants::contact_impedance`.
        pub impedances: Vec<Impedance<R>>,
        /// Of each pair of shapes, its place among the impedances: a table with one column.
        pub pair_impedance: Fixed,
        /// Of each class of contacts, the impedances that its pairs have.
        pub class_impedances: Vec<Vec<usize>>,
        /// Frames of bodies, sites and geoms.
        pub frames: MujocoFrames<R>,
        /// Sensors.
        pub sensors: Sensors<R>,
        /// Of each pair of shapes, the bodies of its two sides as places in the list of its class, from 1; 0 for none.
        pub pair_bodies: Fixed,
        /// Of each class of contacts, the bodies of MuJoCo models that its contacts act on.
        pub class_bodies: Vec<Vec<usize>>,
    }
}

impl<R> Default for Mujoco<R> {
    fn default() -> Mujoco<R> {
        Mujoco {
            integrator: Integrator::default(),
            search: None,
            springs: Vec::new(),
            pose_springs: Vec::new(),
            free_joints: Vec::new(),
            drags: Vec::new(),
            compensations: Vec::new(),
            compensated: Vec::new(),
            compensated_by_actuators: Vec::new(),
            tendons: Vec::new(),
            ties: Vec::new(),
            tie_of_row: Vec::new(),
            equalities: 0,
            actuators: Vec::new(),
            activations: 0,
            mocaps: 0,
            actuator_bounds: Vec::new(),
            tendon_bounds: Vec::new(),
            impedances: Vec::new(),
            pair_impedance: Fixed::default(),
            class_impedances: Vec::new(),
            frames: MujocoFrames::default(),
            sensors: Sensors::default(),
            pair_bodies: Fixed::default(),
            class_bodies: Vec::new(),
        }
    }
}

recast! {
    /// Options of MuJoCo's solver, and the parts that it may solve one by one.
    #[derive(Clone, Debug)]
    pub struct Search<R> {
        /// Improvement, gradient and expected gain below which an island ends, over the trace of its mass matrix.
        pub tolerance: R,
        /// Share of the tolerance to which a line is searched.
        pub ls_tolerance: R,
        /// Whether trees that no constraint couples are solved one by one.
        pub islands: bool,
        /// Whether the last step's accelerations may be the start.
        pub warm_start: bool,
        /// Of each dof, the first one of its kinematic tree.
        pub roots: Vec<usize>,
        /// Of each such first dof, the classes of contacts that its tree is the first of; empty for other dofs.
        pub classes: Vec<Vec<usize>>,
    }
}

impl<R> Search<R> {
    /// The first dofs of trees, after which islands are named.
    pub fn islands_of(&self, dofs: usize) -> impl Iterator<Item = usize> + '_ {
        (0..dofs).filter(|&dof| self.roots[dof] == dof)
    }

    /// Runs of dofs that are of one tree.
    pub fn segments(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut end = 0;
        self.roots.chunk_by(|a, b| a == b).map(move |run| {
            let start = end;
            end += run.len();
            start..end
        })
    }
}

recast! {
    /// A spring of a dof with one coordinate: the force is -stiffness (q - rest).
    #[derive(Clone, Debug)]
    pub struct Spring<R> {
        /// The dof.
        pub dof: usize,
        /// [N·m/rad or N/m]
        pub stiffness: R,
        /// Position without force [rad or m].
        pub rest: R,
    }
}

recast! {
    /// A spring of a ball or a free joint: forces along the axes of its position, and a torque along its rotation vector.
    #[derive(Clone, Debug)]
    pub struct PoseSpring<R> {
        /// The body of the joint.
        pub body: usize,
        /// Of its position [N/m] and of its rotation [N·m/rad].
        pub stiffness: R,
        /// Position without force of a free joint, in the world [m].
        pub position: [R; 3],
        /// Rotation without torque, (x, y, z, w) [–].
        pub quat: [R; 4],
    }
}

recast! {
    /// Resistance of the medium to a link's motion, along and about its axes of inertia.
    #[derive(Clone, Debug)]
    pub struct Drag<R> {
        /// The body that carries the link.
        pub body: usize,
        /// Its centre of mass in the body's frame [m].
        pub center: [R; 3],
        /// Its axes of inertia in the body's frame: columns [–].
        pub axes: [[R; 3]; 3],
        /// Force over velocity [N·s/m], then torque over angular velocity [N·m·s/rad].
        pub viscous: [R; 2],
        /// Of each axis, force over the square of velocity [N·s²/m²], then torque over that of angular velocity [N·m·s²/rad²].
        pub quadratic: [[R; 3]; 2],
        /// Velocity of the medium in the world [m/s].
        pub wind: [R; 3],
    }
}

recast! {
    /// A link that is held against gravity.
    #[derive(Clone, Debug)]
    pub struct Compensation<R> {
        /// The body that carries it.
        pub body: usize,
        /// Its index among the links.
        pub link: usize,
        /// Its mass [kg].
        pub mass: R,
        /// The share of its weight that is compensated [–].
        pub share: R,
        /// Its centre of mass in the body's frame [m].
        pub center: [R; 3],
    }
}

recast! {
    /// A fixed tendon that acts as a spring and a damper: its length is the sum of coordinates times coefficients.
    #[derive(Clone, Debug)]
    pub struct Tendon<R> {
        /// The terms of its length.
        pub terms: Vec<Term<R>>,
        /// [N/m or N·m/rad]
        pub stiffness: R,
        /// Lengths between which its spring has no force [m or rad].
        pub rest: [R; 2],
        /// [N·s/m or N·m·s/rad]
        pub damping: R,
    }
}

recast! {
    /// An actuator: a force along a length (MuJoCo: `actuator/general`).
    #[derive(Clone, Debug)]
    pub struct Actuator<R> {
        /// Its length is the sum of these coordinates times their coefficients, gear included.
        pub terms: Vec<Term<R>>,
        /// In place of that, a length whose moments are found at run time.
        pub turning: Option<TurningLength<R>>,
        /// What its control drives, if that is not its force.
        pub activation: Option<Activation<R>>,
        /// Bounds of its control, if it has any.
        pub ctrl_range: Option<[R; 2]>,
        /// Bounds of its force, if it has any [N or N·m].
        pub force_range: Option<[R; 2]>,
        /// What the control or the activation is multiplied with: a constant, and factors of length and velocity.
        pub gain: [R; 3],
        /// What is added to it: a constant, and factors of length and velocity.
        pub bias: [R; 3],
    }
}

recast! {
    /// A dof with one coordinate, and a factor.
    #[derive(Clone, Debug)]
    pub struct Term<R> {
        /// The dof.
        pub dof: usize,
        /// [–]
        pub coefficient: R,
    }
}

recast! {
    /// Bounds of the sum of actuator forces on a dof (MuJoCo: `actuatorfrcrange`).
    #[derive(Clone, Debug)]
    pub struct ActuatorBound<R> {
        /// The dof.
        pub dof: usize,
        /// [N·m or N]
        pub range: [R; 2],
    }
}

recast! {
    /// Bounds of the sum of actuator forces along a tendon (MuJoCo: `tendon/fixed/actuatorfrcrange`).
    #[derive(Clone, Debug)]
    pub struct TendonBound<R> {
        /// Places of its actuators.
        pub actuators: Vec<usize>,
        /// [N or N·m]
        pub range: [R; 2],
    }
}

same! { Integrator }

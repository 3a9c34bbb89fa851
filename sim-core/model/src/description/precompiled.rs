//! What a robot that MuJoCo compiled has beyond links and joints.

use super::constraints::{Constraint, Tendon};
use super::output_frames::FrameParts;
use super::sensors::SensorParts;
use super::tendons::SpatialTendon;
use crate::geom_contact::{ContactOverride, GeomContact};
use crate::pose::Pose;
use crate::softness::Softness;
use sim_physics::constants::actuators::{ActivationRate, Motor, Muscle};
use sim_physics::constants::hull::reference::Limits;
use sim_physics::constants::options::Integrator;

/// What a robot that MuJoCo compiled has beyond links and joints. Link 0 is the world, and links are in MuJoCo's order.
#[derive(Clone, Debug, PartialEq)]
pub struct Precompiled {
    /// Translational inverse weight of each link, `body_invweight0` [1/kg].
    pub link_inverse_weight: Vec<f64>,
    /// Inverse weight of each dof, `dof_invweight0` [1/(kg·m²) or 1/kg].
    pub dof_inverse_weight: Vec<f64>,
    /// Mean of the diagonal of the mass matrix, `stat.meaninertia`.
    pub mean_inertia: f64,
    /// What each joint has, in their order.
    pub joints: Vec<JointExtras>,
    /// Equalities, by name and whether they act at the start.
    pub equalities: Vec<(String, bool)>,
    /// Constraints.
    pub constraints: Vec<Constraint>,
    /// What the medium does to links.
    pub drags: Vec<Drag>,
    /// What the medium does to geoms.
    pub ellipsoids_in_fluid: Vec<EllipsoidInFluid>,
    /// Links that are held against gravity, each with its share of compensation; none where the model has no passive forces.
    pub compensations: Option<Vec<(usize, f64)>>,
    /// Spatial tendons that are measured or that act.
    pub spatial_tendons: Vec<SpatialTendon>,
    /// Springs and dampers of tendons.
    pub tendons: Vec<Tendon>,
    /// Actuators.
    pub actuators: Vec<Actuator>,
    /// Named states.
    pub keyframes: Vec<Keyframe>,
    /// Links that clients place, in the order of `mocap_pos`.
    pub mocaps: Vec<usize>,
    /// Bounds of the sum of actuator forces along a tendon: the places of its actuators, and the range [N or N·m].
    pub tendon_bounds: Vec<(Vec<usize>, [f64; 2])>,
    /// The link that each link is welded to, or itself.
    pub welds: Vec<usize>,
    /// The parent of each link; that of the world is itself.
    pub parents: Vec<usize>,
    /// Pairs of links whose shapes do not touch.
    pub excludes: Vec<[usize; 2]>,
    /// Pairs of geoms that touch by rules of their own.
    pub pairs: Vec<ContactPair>,
    /// What contacts between its geoms have in place of their own parameters, if anything.
    pub contact_override: Option<ContactOverride>,
    /// Whether a link touches its parent.
    pub touches_parent: bool,
    /// How a step integrates velocities.
    pub integrator: Integrator,
    /// Share of the solver's tolerance to which it searches a line in `f64` [–].
    pub ls_tolerance: f64,
    /// Most sweeps over the rows of friction after the solver, and the gain of one that ends them, `noslip_iterations` and
    /// `noslip_tolerance` [–].
    pub noslip: (usize, f64),
    /// When its search for contacts without a closed form ends in `f64`; none where it has tightloop's own points there, too.
    pub contact_search: Option<Limits>,
    /// Whether the solver handles trees that no constraint couples one by one in `f64`.
    pub islands: bool,
    /// Whether the solver may start from the last step's accelerations in `f64`.
    pub warm_start: bool,
    /// Whether Euler's step is implicit in the damping of joints.
    pub implicit_damping: bool,
    /// Whether time constants are at least two steps.
    pub safe_references: bool,
    /// Frames that only outputs have.
    pub frames: FrameParts,
    /// Sensors.
    pub sensors: SensorParts,
}

/// What a joint from MuJoCo has beyond one from URDF.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointExtras {
    /// Its anchor in the frame of its link [m].
    pub anchor: [f64; 3],
    /// Its position in the pose that the model was built in [rad or m].
    pub reference: f64,
    /// Stiffness of its spring [N·m/rad or N/m].
    pub stiffness: f64,
    /// Position without force of the spring [rad or m].
    pub spring_ref: f64,
    /// By which its stiffness grows with the stretch and its square [N·m/rad², N·m/rad³ or N/m², N/m³].
    pub stiffness_curve: [f64; 2],
    /// By which the damping of each of its dofs grows with the speed and its square [N·m·s²/rad², N·m·s³/rad³ or N·s²/m²,
    /// N·s³/m³].
    pub damping_curves: [[f64; 2]; 6],
    /// Pose without force of the spring of a ball or a free joint.
    pub spring_pose: Pose,
    /// Stretch beyond which the rest of its spring follows, if it yields [rad or m].
    pub spring_yield: Option<f64>,
    /// What compensates gravity along it.
    pub compensator: Compensator,
    /// Softness of its limits.
    pub limit: Softness,
    /// Distance at which a limit acts [rad or m].
    pub margin: f64,
    /// Softness of its dry friction.
    pub friction: Softness,
    /// Bounds of the sum of actuator forces, if it has any [N·m or N].
    pub actuator_range: Option<[f64; 2]>,
}

/// Resistance of the medium to a link's motion, as [`sim_physics::constants::mujoco::Drag`] has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    /// The link.
    pub link: usize,
    /// Centre of mass and axes of inertia in its frame.
    pub inertial: Pose,
    /// [N·s/m, N·m·s/rad]
    pub viscous: [f64; 2],
    /// [N·s²/m², N·m·s²/rad²]
    pub quadratic: [[f64; 3]; 2],
    /// [m/s]
    pub wind: [f64; 3],
}

/// A geom that counts as an ellipsoid in a medium (MuJoCo: `fluidshape`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EllipsoidInFluid {
    /// Its link.
    pub link: usize,
    /// Its centre and axes in the link's frame.
    pub pose: Pose,
    /// [m]
    pub semi_axes: [f64; 3],
    /// The share of the forces that acts [–].
    pub interaction: f64,
    /// Drag of the area across the flow [–].
    pub blunt_drag: f64,
    /// Drag of the remaining area [–].
    pub slender_drag: f64,
    /// Drag of rotations [–].
    pub angular_drag: f64,
    /// Lift of a shape that stands across the flow [–].
    pub kutta_lift: f64,
    /// Lift of a shape that spins [–].
    pub magnus_lift: f64,
    /// Volume of medium that moves along with it, along each axis [m³].
    pub added_mass: [f64; 3],
    /// The same of rotations [m⁵].
    pub added_moments: [f64; 3],
    /// Of the medium [kg/m³].
    pub density: f64,
    /// Of the medium [Pa·s].
    pub viscosity: f64,
    /// Velocity of the medium [m/s].
    pub wind: [f64; 3],
}

/// Two geoms that touch whatever else says that they do not (MuJoCo: `contact/pair`).
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPair {
    /// Its name, unique in the robot.
    pub name: String,
    /// Their links, each with the place of the geom among the link's shapes.
    pub geoms: [(usize, usize); 2],
    /// How they touch; friction is that of the first tangent.
    pub contact: GeomContact,
    /// Sliding friction along the second tangent, and rolling friction about it [–, m].
    pub second: [f64; 2],
    /// `solref` of friction where the cone is elliptic; none where it is that of the contact.
    pub sliding: Option<[f64; 2]>,
}

/// What compensates gravity along a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compensator {
    /// A passive force.
    #[default]
    Passive,
    /// A force that counts as one of its actuators.
    Actuators,
    /// Nothing, since the model has no actuators that could.
    Nothing,
}

/// An actuator, as [`sim_physics::constants::mujoco::Actuator`] has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Its name, unique in the robot.
    pub name: String,
    /// Along which it acts.
    pub length: ActuatorLength,
    /// What its control drives, if that is not its force.
    pub activation: Option<ActuatorActivation>,
    /// How late its control acts, if not at once.
    pub delay: Option<ActuatorDelay>,
    /// Bounds of its control.
    pub ctrl_range: Option<[f64; 2]>,
    /// Bounds of its force [N or N·m].
    pub force_range: Option<[f64; 2]>,
    /// A constant, and factors of length and velocity.
    pub gain: [f64; 3],
    /// A constant, and factors of length and velocity.
    pub bias: [f64; 3],
    /// In place of that gain, a muscle's.
    pub muscle_gain: Option<Muscle<f64>>,
    /// In place of that bias, a muscle's.
    pub muscle_bias: Option<Muscle<f64>>,
    /// What a DC motor has besides.
    pub motor: Option<Motor<f64>>,
}

/// Along which an actuator acts.
#[derive(Clone, Debug, PartialEq)]
pub enum ActuatorLength {
    /// Indices of joints with one dof, each with its coefficient, gear included.
    Joints(Vec<(usize, f64)>),
    /// A ball joint.
    Ball {
        /// The joint.
        joint: usize,
        /// Factors of its rotation vector.
        gear: [f64; 3],
        /// Whether these are in the axes of the parent.
        in_parent: bool,
    },
    /// A free joint.
    Free {
        /// The joint.
        joint: usize,
        /// Force in the axes of the model's world, then torque.
        gear: [f64; 6],
        /// Whether the torque is in those axes too, instead of those of the link.
        in_parent: bool,
    },
    /// A spatial tendon.
    Tendon {
        /// Its place in [`Precompiled::spatial_tendons`].
        tendon: usize,
        /// What its length is multiplied with.
        gear: f64,
    },
    /// A rod from a slider to a crank.
    SliderCrank {
        /// The site along whose z axis the slider moves: its link and its frame there.
        slider: (usize, Pose),
        /// The site on the crank.
        crank: (usize, Pose),
        /// How long the rod is [m].
        rod: f64,
        /// What the length is multiplied with.
        gear: f64,
    },
    /// A site: its link and its frame there.
    Site {
        /// The site.
        site: (usize, Pose),
        /// The site that it is relative to.
        reference: Option<(usize, Pose)>,
        /// Force, then torque.
        gear: [f64; 6],
    },
    /// The contacts of a link, to which it is pulled.
    Contacts {
        /// The link.
        link: usize,
    },
}

/// How late the control of an actuator acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorDelay {
    /// How long it takes [s]; at least a step.
    pub seconds: f64,
    /// How many earlier controls are kept, at least 1. The oldest one stands for those before it.
    pub samples: usize,
    /// What acts between two controls.
    pub interpolation: Interpolation,
}

/// What acts between two controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier one.
    Hold,
    /// A line from the one to the other.
    Line,
    /// A cubic Hermite spline, whose slopes are those between the controls before and after. At the ends they are 0.
    Spline,
}

/// The state of an actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorActivation {
    /// How fast it changes.
    pub rate: ActivationRate<f64>,
    /// Whether its filter is solved exactly over a step, instead of by Euler's method.
    pub exact: bool,
    /// Its bounds.
    pub range: Option<[f64; 2]>,
    /// Whether the force is that of the next activation.
    pub early: bool,
}

/// A named state, in MuJoCo's conventions.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// Its name, unique in the model.
    pub name: String,
    /// Positions [rad or m].
    pub qpos: Vec<f64>,
    /// Velocities [rad/s or m/s].
    pub qvel: Vec<f64>,
    /// Activations.
    pub act: Vec<f64>,
    /// Controls.
    pub ctrl: Vec<f64>,
    /// Positions of mocap bodies, three each [m].
    pub mocap_pos: Vec<f64>,
    /// Their quaternions (w, x, y, z).
    pub mocap_quat: Vec<f64>,
}

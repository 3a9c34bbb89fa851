//! The model: what a simulation runs on.

use crate::description::ParamDraw;
use crate::distribution::Distribution;
use sim_physics::arrays::Axis;
use sim_physics::constants::Constants;
use sim_physics::constants::Sizes;
use sim_physics::constants::scan::HeightScan;
use std::ops::Range;

/// Where a robot's rows lie in the arrays of the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotRange {
    /// Name of the robot.
    pub name: String,
    /// Its columns of `(worlds, dofs)` arrays.
    pub dofs: Range<usize>,
    /// Its columns of `(worlds, coords)` arrays.
    pub coords: Range<usize>,
    /// Its columns of `(worlds, bodies, …)` arrays.
    pub bodies: Range<usize>,
    /// Its columns of `(worlds, actuators)` arrays.
    pub actuators: Range<usize>,
}

/// A scene that is ready to run: immutable, sorted, hashed.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) constants: Constants<f64>,
    pub(crate) dt: f64,
    pub(crate) substeps: usize,
    pub(crate) dof_names: Vec<String>,
    pub(crate) coord_names: Vec<String>,
    pub(crate) body_names: Vec<String>,
    pub(crate) shape_names: Vec<String>,
    pub(crate) actuator_names: Vec<String>,
    pub(crate) activation_names: Vec<String>,
    pub(crate) mocap_names: Vec<String>,
    pub(crate) equality_names: Vec<String>,
    pub(crate) contact_pair_names: Vec<String>,
    pub(crate) keyframes: Vec<KeyState>,
    pub(crate) sensors: Vec<SensorInfo>,
    pub(crate) refused_sensors: Vec<String>,
    pub(crate) site_names: Vec<String>,
    pub(crate) output_site_names: Vec<String>,
    pub(crate) output_tendon_names: Vec<String>,
    pub(crate) contact_sensors: Vec<SensedShapes>,
    pub(crate) command_delay_max: usize,
    pub(crate) robots: Vec<RobotRange>,
    pub(crate) start: Start,
    pub(crate) dof_inverse_weight: Vec<f64>,
    pub(crate) hash: u64,
}

/// A sensor of a MuJoCo model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorInfo {
    /// `robot/sensor`.
    pub name: String,
    /// Its scalars in `sensordata`.
    pub place: Range<usize>,
}

/// What a contact sensor adds up: forces on some shapes, from some.
#[derive(Clone, Debug)]
pub struct SensedShapes {
    /// Its name.
    pub name: String,
    /// Per shape: whether forces on it count.
    pub of: Vec<bool>,
    /// Per shape: whether forces from it count.
    pub against: Vec<bool>,
}

/// State and commands after a reset: positions per coordinate, the rest per dof.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// [rad or m]
    pub joint_q: Vec<f64>,
    /// [rad or m]
    pub joint_target_q: Vec<f64>,
    /// [rad/s or m/s]
    pub joint_target_qd: Vec<f64>,
    /// Positions of mocap bodies, three each [m].
    pub mocap_pos: Vec<f64>,
    /// Their quaternions (w, x, y, z).
    pub mocap_quat: Vec<f64>,
    /// 1 for each equality that acts, 0 for others.
    pub eq_active: Vec<f64>,
    /// What a reset draws and adds to the positions, as [`crate::JointDof::offset_q`] has it.
    pub joint_q_offset: Vec<Option<Distribution>>,
    /// What a reset draws and adds to the velocities, which are 0.
    pub joint_qd_offset: Vec<Option<Distribution>>,
    /// What a reset draws of the parameters.
    pub params: Vec<ParamDraw>,
}

/// A keyframe: a state of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyState {
    /// `model/keyframe`.
    pub name: String,
    /// Positions of all joints [rad or m].
    pub joint_q: Vec<f64>,
    /// Velocities [rad/s or m/s].
    pub joint_qd: Vec<f64>,
    /// Activations.
    pub act: Vec<f64>,
    /// Controls.
    pub ctrl: Vec<f64>,
    /// Positions of mocap bodies, three each [m].
    pub mocap_pos: Vec<f64>,
    /// Their quaternions (w, x, y, z).
    pub mocap_quat: Vec<f64>,
}

impl Model {
    /// Constants that the kernel source reads, in f64.
    pub fn constants(&self) -> &Constants<f64> {
        &self.constants
    }
    /// Duration of one substep [s].
    pub fn dt(&self) -> f64 {
        self.dt
    }
    /// Substeps in a control frame.
    pub fn substeps(&self) -> usize {
        self.substeps
    }
    /// Names of what an axis has an entry for; of a fixed length, x, y and z or numbers. Nothing where there are no names.
    pub fn names(&self, axis: Axis) -> Vec<String> {
        match axis {
            Axis::Dofs => self.dof_names.clone(),
            Axis::Coords => self.coord_names.clone(),
            Axis::Bodies => self.body_names.clone(),
            Axis::Shapes => self.shape_names.clone(),
            Axis::Sites => self.site_names.clone(),
            Axis::ContactSensors => {
                let sensors = self.contact_sensors.iter();
                sensors.map(|sensor| sensor.name.clone()).collect()
            }
            Axis::Actuators => self.actuator_names.clone(),
            Axis::ContactPairs => self.contact_pair_names.clone(),
            Axis::Activations => self.activation_names.clone(),
            Axis::Mocaps => self.mocap_names.clone(),
            Axis::Equalities => self.equality_names.clone(),
            Axis::OutputSites => self.output_site_names.clone(),
            Axis::OutputTendons => self.output_tendon_names.clone(),
            Axis::Size(3) => ["x", "y", "z"].map(str::to_owned).to_vec(),
            Axis::Size(n) => (0..n).map(|k| k.to_string()).collect(),
            Axis::Rows
            | Axis::Contacts
            | Axis::ScanRays
            | Axis::OutputBodies
            | Axis::OutputGeoms
            | Axis::Sensordata => Vec::new(),
        }
    }
    /// Names of the dofs, `robot/joint` or `robot/joint.part`.
    pub fn dof_names(&self) -> &[String] {
        &self.dof_names
    }
    /// Names of the position coordinates, `robot/joint` or `robot/joint.part`.
    pub fn coord_names(&self) -> &[String] {
        &self.coord_names
    }
    /// Names of the bodies, `robot/link`.
    pub fn body_names(&self) -> &[String] {
        &self.body_names
    }
    /// Names of the shapes, as [`crate::Description::shape_names`] has them.
    pub fn shape_names(&self) -> &[String] {
        &self.shape_names
    }
    /// Keyframes of the models from MuJoCo.
    pub fn keyframes(&self) -> &[KeyState] {
        &self.keyframes
    }
    /// Names of the equalities, `robot/equality`, in the order of `eq_active`.
    pub fn equality_names(&self) -> &[String] {
        &self.equality_names
    }
    /// The sensors of MuJoCo models, in MuJoCo's order.
    pub fn sensors(&self) -> &[SensorInfo] {
        &self.sensors
    }
    /// Sensors of MuJoCo models that are not supported, a sentence each.
    pub fn refused_sensors(&self) -> &[String] {
        &self.refused_sensors
    }
    /// Names of the sites.
    pub fn site_names(&self) -> &[String] {
        &self.site_names
    }
    /// Names of the sites of MuJoCo models, `robot/site`.
    pub fn output_site_names(&self) -> &[String] {
        &self.output_site_names
    }
    /// What each contact sensor adds up.
    pub fn contact_sensors(&self) -> &[SensedShapes] {
        &self.contact_sensors
    }
    /// Largest delay of commands that a world may have [substeps].
    pub fn command_delay_max(&self) -> usize {
        self.command_delay_max
    }
    /// Each robot's part of the arrays.
    pub fn robots(&self) -> &[RobotRange] {
        &self.robots
    }
    /// Number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.constants.dofs.len()
    }
    /// Number of position coordinates.
    pub fn coords(&self) -> usize {
        self.constants.coords
    }
    /// Number of bodies: links of all robots, fixed ones included.
    pub fn bodies(&self) -> usize {
        self.constants.frames.len()
    }
    /// Number of constraint rows: equalities, frictions, limits.
    pub fn rows(&self) -> usize {
        self.constants.rows()
    }
    /// Contacts that a world has room for.
    pub fn contacts_max(&self) -> usize {
        self.constants.contacts.contacts_max
    }
    /// How many of everything it has.
    pub fn sizes(&self) -> Sizes {
        Sizes {
            dofs: self.dofs(),
            coords: self.coords(),
            bodies: self.bodies(),
            rows: self.rows(),
            contacts: self.contacts_max(),
            shapes: self.shape_names.len(),
            sites: self.site_names.len(),
            scan_rays: self.constants.scans.iter().map(HeightScan::rays).sum(),
            contact_sensors: self.contact_sensors.len(),
            actuators: self.actuator_names.len(),
            contact_pairs: self.contact_pair_names.len(),
            activations: self.constants.actuators.activations,
            mocaps: self.constants.mocaps,
            equalities: self.constants.switches,
            output_bodies: self.constants.outputs.bodies.len(),
            output_sites: self.constants.outputs.sites.len(),
            output_geoms: self.constants.outputs.geoms.len(),
            output_tendons: self.constants.outputs.tendons.len(),
            sensordata: self.constants.sensors.scalars,
        }
    }
    /// State and commands after a reset.
    pub fn start(&self) -> &Start {
        &self.start
    }
    /// Diagonal of M⁻¹ at q = 0, MuJoCo's `dof_invweight0`. `(dofs)` [1/(kg·m²) or 1/kg]
    pub fn dof_inverse_weight(&self) -> &[f64] {
        &self.dof_inverse_weight
    }
    /// A number that differs between models that behave differently. Recordings store it.
    pub fn hash(&self) -> u64 {
        self.hash
    }
}

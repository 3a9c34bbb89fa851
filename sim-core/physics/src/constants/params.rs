//! THE table of parameters: scalars of a model that may differ from world to world, and change while it runs.
//!
//! Those that a scene names (`Description::params` in `sim-model`) vary; the others are constants of the program.

use super::actuators::Actuator;
use super::{Constants, Dof, Sizes};

/// What a parameter has a value for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// A fixed count of entries.
    Entry(usize),
    /// Each degree of freedom.
    Dof,
    /// Each link, and this many entries.
    Body(usize),
    /// Each collision shape, and this many entries.
    Shape(usize),
    /// Each site, and this many entries.
    Site(usize),
    /// Each contact sensor.
    ContactSensor,
    /// Each actuator of MuJoCo models, and this many entries.
    Actuator(usize),
    /// Each contact pair that MuJoCo models name, and this many entries.
    ContactPair(usize),
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct ParamRow {
    /// Its name for clients.
    pub name: &'static str,
    /// What it has a value for.
    pub per: Per,
    /// Unit; `–` for none.
    pub unit: &'static str,
    /// Its lower bound; none = any value.
    pub least: Option<f64>,
    /// What it is.
    pub doc: &'static str,
}

macro_rules! params {
    ($($param:ident $name:literal $per:expr, $unit:literal $least:expr, $doc:literal;)*) => {
        /// A parameter that may vary.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Param {
            $(#[doc = $doc] $param,)*
        }

        impl Param {
            /// All rows, in order.
            pub const ALL: [Param; [$(Param::$param),*].len()] = [$(Param::$param),*];

            /// Its row of the table.
            pub fn row(self) -> &'static ParamRow {
                match self {
                    $(Param::$param => {
                        const ROW: ParamRow = ParamRow {
                            name: $name,
                            per: $per,
                            unit: $unit,
                            least: $least,
                            doc: $doc,
                        };
                        &ROW
                    })*
                }
            }
        }
    };
}

params! {
    Gravity "gravity" Per::Entry(3), "m/s²" None, "Gravity in world axes.";
    BodyMassScale "body_mass_scale" Per::Body(1), "–" Some(MASS_SCALE_MIN), "Mass and inertia of each link over those of the scene. What derives from masses at the reference pose, such as the softness of contacts and limits, stays, and so does the point that the velocity of a free joint is of: the centre of mass that the scene has.";
    JointArmature "joint_armature" Per::Dof, "kg·m² or kg" Some(0.0), "Inertia of the drive; of a free joint, mass and inertia that are added to its body's without weight.";
    JointDamping "joint_damping" Per::Dof, "N·m·s/rad or N·s/m" Some(0.0), "Passive damping.";
    JointFriction "joint_friction" Per::Dof, "N·m or N" Some(0.0), "Bound of the dry friction's force. Free joints have no dry friction.";
    JointTargetKe "joint_target_ke" Per::Dof, "N·m/rad or N/m" Some(0.0), "Proportional gain of the drive. Free joints have no drive.";
    JointTargetKd "joint_target_kd" Per::Dof, "N·m·s/rad or N·s/m" Some(0.0), "Derivative gain of the drive. Free joints have no drive.";
    JointEffortLimit "joint_effort_limit" Per::Dof, "N·m or N" Some(0.0), "Bound of the drive's force; 1e30 where there is none. Free joints have no drive.";
    ShapeMu "shape_mu" Per::Shape(1), "–" Some(0.0), "Coefficient of sliding friction of each collision shape; of two shapes the larger counts, or what the scene's friction_combine makes of both.";
    CommandDelay "command_delay" Per::Entry(1), "substeps" Some(0.0), "Substeps from the start of a frame until its joint_f and targets act; a part of one counts as a whole one. Before the first have come, those of the reset act.";
    JointFNoise "joint_f_noise" Per::Dof, "N·m or N" Some(0.0), "Standard deviation of what is added to joint_f, drawn for each frame.";
    JointTargetQNoise "joint_target_q_noise" Per::Dof, "rad or m" Some(0.0), "Standard deviation of what is added to joint_target_q, drawn for each frame. Free joints have no drive.";
    JointTargetQdNoise "joint_target_qd_noise" Per::Dof, "rad/s or m/s" Some(0.0), "Standard deviation of what is added to joint_target_qd, drawn for each frame. Free joints have no drive.";
    JointQNoise "joint_q_noise" Per::Dof, "rad or m" Some(0.0), "Standard deviation of joint_q_measured around joint_q: of a ball a rotation vector in the child's axes, of a free joint its position, then a rotation vector in world axes.";
    JointQdNoise "joint_qd_noise" Per::Dof, "rad/s or m/s" Some(0.0), "Standard deviation of joint_qd_measured around joint_qd.";
    JointTorqueNoise "joint_torque_noise" Per::Dof, "N·m or N" Some(0.0), "Standard deviation of joint_torque.";
    SiteQNoise "site_q_noise" Per::Site(2), "m, rad" Some(0.0), "Standard deviation of site_q: of each part of the position, and of a rotation vector in the site's axes.";
    SiteQdNoise "site_qd_noise" Per::Site(2), "m/s, rad/s" Some(0.0), "Standard deviation of site_qd: of each part of the velocity, and of the angular velocity.";
    GyroNoise "gyro_noise" Per::Site(1), "rad/s" Some(0.0), "Standard deviation of each part of gyro.";
    AccelerometerNoise "accelerometer_noise" Per::Site(1), "m/s²" Some(0.0), "Standard deviation of each part of accelerometer.";
    ContactSensorNoise "contact_sensor_noise" Per::ContactSensor, "N" Some(0.0), "Standard deviation of each part of contact_sensor.";
    BodyF "body_f" Per::Body(6), "N, N·m" None, "Force on each link at its centre of mass, then torque, in world axes, until it is written again; a reset clears it.";
    BodyMass "body_mass" Per::Body(1), "kg" Some(0.0), "Mass of each link, before its scale. Its inertia stays.";
    BodyInertia "body_inertia" Per::Body(6), "kg·m²" None, "Inertia of each link about its centre of mass in the link's axes, before its scale: xx, yy, zz, xy, xz, yz.";
    ActuatorGain "actuator_gain" Per::Actuator(3), "–" None, "Gain of each actuator of MuJoCo models: constant, per length, per velocity; muscles keep their own.";
    ActuatorBias "actuator_bias" Per::Actuator(3), "–" None, "Bias of each actuator of MuJoCo models: constant, per length, per velocity; muscles keep their own.";
    BodyCom "body_com" Per::Body(3), "m" None, "Centre of mass of each link in its own axes. The point that the velocity of a free joint is of stays where the scene has it.";
    BodyInvweight0 "body_invweight0" Per::Body(1), "1/kg" Some(0.0), "Inverse weight of each link at the reference pose, MuJoCo's first `body_invweight0`: the softness of its contacts.";
    DofInvweight0 "dof_invweight0" Per::Dof, "1/(kg·m²) or 1/kg" Some(0.0), "Inverse inertia of each dof at the reference pose, as MuJoCo's: the softness of the limits of hinges and slides.";
    ShapeMuTorsional "shape_mu_torsional" Per::Shape(1), "m" Some(0.0), "Coefficient of torsional friction of each geom of MuJoCo models. It counts where contacts have condim 4 or 6.";
    ShapeMuRolling "shape_mu_rolling" Per::Shape(1), "m" Some(0.0), "Coefficient of rolling friction of each geom of MuJoCo models. It counts where contacts have condim 6.";
    JointRef "joint_ref" Per::Dof, "rad or m" None, "Position at which each hinge or slide leaves its link in place: MuJoCo's `qpos0`, 0 of robots from URDF. Balls and free joints have none.";
    JointLimitLower "joint_limit_lower" Per::Dof, "rad or m" None, "Lower end of the range of each joint with limits; -1e30 where there are none.";
    JointLimitUpper "joint_limit_upper" Per::Dof, "rad or m" None, "Upper end of the range of each joint with limits; 1e30 where there are none.";
    BodyGravcomp "body_gravcomp" Per::Body(1), "–" None, "Share of its weight by which each link of MuJoCo models is held against gravity.";
    ActuatorForcerange "actuator_forcerange" Per::Actuator(2), "N or N·m" None, "Least and largest force of each actuator of MuJoCo models that has bounds; -1e30 and 1e30 of others.";
    ShapeSolref "shape_solref" Per::Shape(2), "s, –" None, "MuJoCo's `solref` of each shape: time constant and damping ratio of its contacts, or both negative.";
    ShapeSolimp "shape_solimp" Per::Shape(5), "–" None, "MuJoCo's `solimp` of each shape: dmin, dmax, width [m], midpoint, power. The power stays as the scene has it.";
    PairFriction "pair_friction" Per::ContactPair(3), "–, m, m" Some(0.0), "Sliding, torsional and rolling friction of each contact pair that MuJoCo models name.";
}

/// Least mass and inertia of a link over those of the scene [–].
const MASS_SCALE_MIN: f64 = 1e-3;
/// Effort limit of a drive, end of a range, or bound of a force where there is none.
pub const NO_LIMIT: f64 = 1e30;

impl Param {
    /// The parameter of this name.
    pub fn named(name: &str) -> Option<Param> {
        Param::ALL
            .into_iter()
            .find(|param| param.row().name == name)
    }

    /// Its values per world.
    pub fn columns(self, sizes: &Sizes) -> usize {
        match self.row().per {
            Per::Entry(n) => n,
            Per::Dof => sizes.dofs,
            Per::Body(n) => n * sizes.bodies,
            Per::Shape(n) => n * sizes.shapes,
            Per::Site(n) => n * sizes.sites,
            Per::ContactSensor => sizes.contact_sensors,
            Per::Actuator(n) => n * sizes.actuators,
            Per::ContactPair(n) => n * sizes.contact_pairs,
        }
    }

    /// Initial values of a world.
    pub fn starts(self, m: &Constants<f64>, scene: &SceneStarts) -> Vec<f64> {
        let of_dofs = |number: fn(&Dof<f64>) -> f64| m.dofs.iter().map(number).collect();
        let of_actuators = |numbers: fn(&Actuator<f64>) -> Vec<f64>| {
            m.actuators.all.iter().flat_map(numbers).collect()
        };
        match self {
            Param::Gravity => m.gravity.to_vec(),
            Param::BodyMassScale => vec![1.0; m.frames.len()],
            Param::JointArmature => of_dofs(|dof| dof.armature),
            Param::JointDamping => of_dofs(|dof| dof.damping),
            Param::JointFriction => {
                let mut losses = vec![0.0; m.dofs.len()];
                m.frictions.iter().for_each(|f| losses[f.dof] = f.loss);
                losses
            }
            Param::JointTargetKe => of_dofs(|dof| dof.ke),
            Param::JointTargetKd => of_dofs(|dof| dof.kd),
            Param::JointEffortLimit => of_dofs(|dof| dof.effort_limit.unwrap_or(NO_LIMIT)),
            Param::ShapeMu => scene.mu.clone(),
            Param::CommandDelay => vec![0.0],
            Param::JointFNoise
            | Param::JointTargetQNoise
            | Param::JointTargetQdNoise
            | Param::JointQNoise
            | Param::JointQdNoise
            | Param::JointTorqueNoise => vec![0.0; m.dofs.len()],
            Param::SiteQNoise | Param::SiteQdNoise => vec![0.0; 2 * m.sites.len()],
            Param::GyroNoise | Param::AccelerometerNoise => vec![0.0; m.sites.len()],
            Param::ContactSensorNoise => vec![0.0; scene.contact_sensors],
            Param::BodyF => vec![0.0; 6 * m.frames.len()],
            Param::BodyMass => scene.masses.clone(),
            Param::BodyInertia => scene.inertias.as_flattened().to_vec(),
            Param::BodyCom => scene.centers.as_flattened().to_vec(),
            Param::BodyInvweight0 => scene.link_inverse_weights.clone(),
            Param::DofInvweight0 => scene.dof_inverse_weights.clone(),
            Param::ShapeMuTorsional => scene.turning_mu.iter().map(|mu| mu[0]).collect(),
            Param::ShapeMuRolling => scene.turning_mu.iter().map(|mu| mu[1]).collect(),
            Param::JointRef => scene.references.clone(),
            Param::JointLimitLower => scene.ranges.iter().map(|range| range[0]).collect(),
            Param::JointLimitUpper => scene.ranges.iter().map(|range| range[1]).collect(),
            Param::BodyGravcomp => scene.gravity_shares.clone(),
            Param::ActuatorForcerange => of_actuators(|actuator| {
                actuator
                    .force_range
                    .unwrap_or([-NO_LIMIT, NO_LIMIT])
                    .to_vec()
            }),
            Param::ShapeSolref => scene.shape_solref.as_flattened().to_vec(),
            Param::ShapeSolimp => scene.shape_solimp.as_flattened().to_vec(),
            Param::PairFriction => scene.pair_frictions.as_flattened().to_vec(),
            Param::ActuatorGain => of_actuators(|actuator| actuator.gain.to_vec()),
            Param::ActuatorBias => of_actuators(|actuator| actuator.bias.to_vec()),
        }
    }

    /// Is it a load, which a reset clears?
    pub fn is_load(self) -> bool {
        self == Param::BodyF
    }
}

/// What parameters start with beside the constants of a model.
#[derive(Clone, Debug, Default)]
pub struct SceneStarts {
    /// Coefficient of friction of each shape [–].
    pub mu: Vec<f64>,
    /// How many contact sensors there are.
    pub contact_sensors: usize,
    /// Mass of each link [kg].
    pub masses: Vec<f64>,
    /// Inertia of each link in its axes: xx, yy, zz, xy, xz, yz [kg·m²].
    pub inertias: Vec<[f64; 6]>,
    /// Centre of mass of each link in its axes [m].
    pub centers: Vec<[f64; 3]>,
    /// Inverse weight of each link at the reference pose [1/kg].
    pub link_inverse_weights: Vec<f64>,
    /// Inverse inertia of each dof at the reference pose [1/(kg·m²) or 1/kg].
    pub dof_inverse_weights: Vec<f64>,
    /// Torsional and rolling friction of each shape [m].
    pub turning_mu: Vec<[f64; 2]>,
    /// Position of each dof at which its joint leaves its link in place [rad or m].
    pub references: Vec<f64>,
    /// Range of each dof [rad or m].
    pub ranges: Vec<[f64; 2]>,
    /// Share of its weight by which each link is held against gravity [–].
    pub gravity_shares: Vec<f64>,
    /// MuJoCo's `solref` of each shape.
    pub shape_solref: Vec<[f64; 2]>,
    /// MuJoCo's `solimp` of each shape.
    pub shape_solimp: Vec<[f64; 5]>,
    /// Sliding [–], torsional and rolling friction [m] of each contact pair.
    pub pair_frictions: Vec<[f64; 3]>,
}

/// The noise of each command, in the order `joint_f`, `joint_target_q`, `joint_target_qd`.
pub const COMMAND_NOISES: [Param; 3] = [
    Param::JointFNoise,
    Param::JointTargetQNoise,
    Param::JointTargetQdNoise,
];

/// Which parameters vary, and where their values are among those of a world.
#[derive(Clone, Debug)]
pub struct Varying {
    first: [Option<usize>; Param::ALL.len()],
    starts: Vec<(Param, f64)>,
}

impl Default for Varying {
    /// None varies.
    fn default() -> Varying {
        Varying {
            first: [None; Param::ALL.len()],
            starts: Vec::new(),
        }
    }
}

impl Varying {
    /// Adds a parameter with its initial values.
    pub fn add(&mut self, param: Param, numbers: impl IntoIterator<Item = f64>) {
        self.first[param as usize] = Some(self.starts.len());
        self.starts.extend(numbers.into_iter().map(|x| (param, x)));
    }

    /// Place of its first value, if it varies.
    #[inline(always)]
    pub fn first(&self, param: Param) -> Option<usize> {
        self.first[param as usize]
    }

    /// Places of its values, if it varies.
    pub fn range(&self, param: Param) -> Option<std::ops::Range<usize>> {
        let first = self.first(param)?;
        let len = self.starts.iter().filter(|(of, _)| *of == param).count();
        Some(first..first + len)
    }

    /// Those that vary, in the order of the table.
    pub fn params(&self) -> impl Iterator<Item = Param> + '_ {
        let all = Param::ALL.into_iter();
        all.filter(|param| self.first(*param).is_some())
    }

    /// Initial values of a world, each with its parameter.
    pub fn starts(&self) -> &[(Param, f64)] {
        &self.starts
    }

    /// Initial value at a place.
    #[inline(always)]
    pub fn start(&self, place: usize) -> f64 {
        self.starts[place].1
    }

    /// Values per world.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.starts.len()
    }

    /// Does no parameter vary?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.starts.is_empty()
    }
}

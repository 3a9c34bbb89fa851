//! What a daemon reports about itself, so that a client that attaches knows as much as the one that launched.

use serde::{Deserialize, Serialize};

use crate::Dtype;

/// A running daemon in full: everything that does not change while it runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Protocol version of the daemon.
    pub protocol: u32,
    /// Release of the daemon, such as "0.1.0".
    pub release: String,
    /// Name of the daemon.
    pub name: String,
    /// Random number of this run of the daemon.
    pub session: u64,
    /// Process of the daemon.
    pub pid: u32,
    /// Number of worlds: of this group, where there are several.
    pub worlds: usize,
    /// Which group this is.
    #[serde(default)]
    pub group: usize,
    /// Groups of as many worlds that the daemon has, which step independently.
    #[serde(default = "one")]
    pub groups: usize,
    /// The number of the first world among those of all groups; what is drawn depends on it.
    #[serde(default)]
    pub first_world: usize,
    /// Where the physics runs, such as "cpu".
    pub device: String,
    /// Name of the GPU, empty on the CPU.
    pub adapter: String,
    /// How frames reach shared memory: `direct` (the processor writes them there), `imported` (a GPU does), `copied` (from a GPU).
    pub delivery: String,
    /// Precision of the run and of every real array of it: "f32" or "f64".
    pub precision: String,
    /// Whether frames have the same bits on the processor and on GPUs.
    #[serde(default)]
    pub cpu_bits: bool,
    /// Threads that a step uses; those of all groups are the same.
    pub threads: usize,
    /// Physics step [s].
    pub dt: f64,
    /// Physics steps per control frame.
    pub substeps: usize,
    /// Gravity in world axes [m/s²].
    pub gravity: [f64; 3],
    /// `robot/joint` of each dof.
    pub dof_names: Vec<String>,
    /// `robot/joint` of each coordinate.
    pub coord_names: Vec<String>,
    /// `robot/connection` of each body.
    pub body_names: Vec<String>,
    /// Collision shapes: `shape`, `body/shape` or `robot/connection/shape`.
    pub shape_names: Vec<String>,
    /// Sites.
    pub site_names: Vec<String>,
    /// Contact sensors.
    pub contact_sensor_names: Vec<String>,
    /// `robot/actuator` of each actuator. Older recordings have none.
    #[serde(default)]
    pub actuator_names: Vec<String>,
    /// Of them, those that have an activation. Older recordings have none.
    #[serde(default)]
    pub activation_names: Vec<String>,
    /// `robot/body` of each body that clients place. Older recordings have none.
    #[serde(default)]
    pub mocap_names: Vec<String>,
    /// Their quaternions (w, x, y, z) at the start, four each. Older recordings have none.
    #[serde(default)]
    pub mocap_quat: Vec<f64>,
    /// `robot/equality` of each equality of MuJoCo models. Older recordings have none.
    #[serde(default)]
    pub equality_names: Vec<String>,
    /// Keyframes of the models from MuJoCo. Older recordings have none.
    #[serde(default)]
    pub keyframes: Vec<KeyframeInfo>,
    /// `robot/sensor` of each sensor of MuJoCo models. Older recordings have none.
    #[serde(default)]
    pub sensor_names: Vec<String>,
    /// Its scalars in `sensordata`, `[start, stop)`.
    #[serde(default)]
    pub sensors: Vec<[usize; 2]>,
    /// The robots with their ranges in the lists above.
    pub robots: Vec<RobotRange>,
    /// Mimic joints. Older recordings list none.
    #[serde(default)]
    pub followers: Vec<Follower>,
    /// Rows of the field table: what every frame carries, in this order.
    pub fields: Vec<FieldInfo>,
    /// What the labels of segmentation stand for: bodies, then parts of the world. Older recordings have none.
    #[serde(default)]
    pub segment_names: Vec<String>,
    /// Every row that could have been asked for.
    pub known_fields: Vec<FieldInfo>,
    /// What a step may set (`joint_f`, targets).
    pub commands: Vec<InputInfo>,
    /// What a write may set (`joint_q`, `joint_qd`, and the parameters that vary).
    pub writes: Vec<InputInfo>,
    /// Parameters, those that do not vary included.
    pub params: Vec<ParamInfo>,
    /// The scene as TOML text.
    pub scene: String,
    /// Folder to which paths in the scene are relative.
    pub scene_folder: String,
    /// Hash of the model, for a client that evaluates the scene itself.
    pub model_hash: u64,
    /// What was ignored or mended while the scene was read, one sentence each.
    pub notes: Vec<String>,
    /// What is most likely a mistake in the scene, a sentence or two each. Older recordings have none.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Which targets the drive of each dof follows: 1 positions, 2 velocities, 3 both; 4 more where the scene gives
    /// it a target. Older recordings have none.
    #[serde(default)]
    pub driven: Vec<u8>,
    /// Limits of each dof that turns [rad]; null for the others. Older recordings have none.
    #[serde(default)]
    pub angle_range: Vec<Option<[f64; 2]>>,
    /// Frames that the controller, or one observer, may hold at once.
    pub frames_held: usize,
    /// Worlds that observers see: the first ones.
    pub watch_worlds: usize,
    /// Size of their state, as observers get it: a snapshot of these worlds [bytes].
    pub watch_state_bytes: u64,
    /// Largest |joint_q| of a world before it is frozen [rad or m], if there is one.
    pub joint_q_max: Option<f64>,
    /// Largest |joint_qd| of a world before it is frozen [rad/s or m/s], if there is one.
    pub joint_qd_max: Option<f64>,
    /// What becomes of a frozen world: "freeze" or "reset".
    pub on_fault: String,
    /// What becomes of a command that is NaN or infinite: "refuse" for all worlds, or "freeze" the world.
    pub on_nan: String,
    /// What the draws of a world depend on: its number and its seed ("world"), or its "seed" alone.
    pub draws: String,
    /// Which state evaluated outputs belong to: that in the "frame", or that of the "last_substep". Older recordings have the first.
    #[serde(default = "in_frame")]
    pub outputs_at: String,
    /// The pace of frames, where they keep one. Older recordings have none.
    #[serde(default)]
    pub pace: Option<Pace>,
    /// Size of the state of all worlds, as recorders get it [bytes].
    pub state_bytes: u64,
    /// Hash over the fields, inputs, worlds and dofs; see [`Description::schema_hash`].
    pub schema: u64,
}

/// Frames that keep to real time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Simulated seconds a second.
    pub realtime: f64,
    /// From one frame to the next [ns].
    pub period_ns: u64,
    /// What becomes of worlds whose command is late.
    pub late: Late,
    /// Time without a command after which [`Late::Hold`] becomes [`Late::Stop`] [ns].
    pub command_timeout_ns: Option<u64>,
}

/// What worlds do whose next command has not come when their frame is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Late {
    /// Stand still until it comes.
    Pause,
    /// Go on with the last commands.
    Hold,
    /// Go on with efforts, controls and velocity targets of zero; position targets stay.
    Stop,
}

impl Late {
    /// The inverse of its name on the command line.
    pub fn named(name: &str) -> Option<Late> {
        match name {
            "pause" => Some(Late::Pause),
            "hold" => Some(Late::Hold),
            "stop" => Some(Late::Stop),
            _ => None,
        }
    }
}

/// A number of the model that may vary from world to world.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParamInfo {
    /// The place of its first number among those of a world, if it varies.
    pub place: Option<usize>,
    /// What it is.
    pub info: InputInfo,
}

/// A keyframe: a state of the scene, in the order of the names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframeInfo {
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

/// Ranges of one robot, each `[start, stop)`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotRange {
    /// Name of the robot.
    pub name: String,
    /// Its dofs.
    pub dofs: [usize; 2],
    /// Its coordinates.
    pub coords: [usize; 2],
    /// Its bodies.
    pub bodies: [usize; 2],
    /// Its actuators. Older recordings have none.
    #[serde(default)]
    pub actuators: [usize; 2],
    /// Whether it is a model from MuJoCo, which has no drives but actuators.
    #[serde(default)]
    pub is_mujoco: bool,
}

/// A joint that follows another one: q = offset + multiplier · q of the leader.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Follower {
    /// `robot/joint` of the follower, which has one dof and one coordinate.
    pub name: String,
    /// `robot/joint` of its leader, likewise, which follows none.
    pub leader: String,
    /// Factor on the leader's position.
    pub multiplier: f64,
    /// Position at the leader's 0 [rad or m].
    pub offset: f64,
}

/// One row of the field table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldInfo {
    /// Name, such as `joint_q`.
    pub name: String,
    /// Type of an entry.
    pub dtype: Dtype,
    /// Shape in numbers, worlds first. Empty in `known_fields` rows that are not exported.
    pub shape: Vec<usize>,
    /// Shape in words, such as `(worlds, coords)`.
    pub axes: String,
    /// Unit, such as "rad or m".
    pub unit: String,
    /// One sentence.
    pub doc: String,
}

/// An array that a client may send.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputInfo {
    /// Name, such as `joint_f`.
    pub name: String,
    /// Full number of columns: dofs or coordinates.
    pub columns: usize,
    /// Unit.
    pub unit: String,
    /// One sentence.
    pub doc: String,
}

/// Most entries of an array, and most worlds: beyond any memory, and still a number of bytes.
const ENTRIES_MAX: usize = 1 << 48;

/// Axes whose entries have names, in the order of [`Description::schema_hash`].
const NAMED_AXES: [&str; 10] = [
    "dofs",
    "coords",
    "bodies",
    "shapes",
    "sites",
    "contact_sensors",
    "actuators",
    "activations",
    "mocaps",
    "equalities",
];

impl RobotRange {
    /// Its part of an axis, such as "dofs", if robots have parts of it.
    pub fn columns(&self, axis: &str) -> Option<[usize; 2]> {
        match axis {
            "dofs" => Some(self.dofs),
            "coords" => Some(self.coords),
            "bodies" => Some(self.bodies),
            "actuators" => Some(self.actuators),
            _ => None,
        }
    }

    /// Whether robots have parts of an axis.
    pub fn has(axis: &str) -> bool {
        RobotRange::default().columns(axis).is_some()
    }
}

impl Description {
    /// Names of what an axis of a field has an entry for, such as "dofs"; none where it has no names.
    pub fn names(&self, axis: &str) -> Option<&[String]> {
        let names = match axis {
            "dofs" => &self.dof_names,
            "coords" => &self.coord_names,
            "bodies" => &self.body_names,
            "shapes" => &self.shape_names,
            "sites" => &self.site_names,
            "contact_sensors" => &self.contact_sensor_names,
            "actuators" => &self.actuator_names,
            "activations" => &self.activation_names,
            "mocaps" => &self.mocap_names,
            "equalities" => &self.equality_names,
            _ => return None,
        };
        Some(names)
    }

    /// FNV-1a over everything that decides how bytes are read: both sides compute it and must agree.
    pub fn schema_hash(&self) -> u64 {
        let mut hash = crate::wire::hash::Fnv::new();
        hash.number(self.worlds as u64);
        hash.text(&self.precision);
        hash.number(self.frames_held as u64);
        hash.number(self.watch_worlds as u64);
        hash.number(self.watch_state_bytes);
        let named = NAMED_AXES.iter().filter_map(|axis| self.names(axis));
        let names = named.flatten().chain(&self.sensor_names);
        names.for_each(|name| hash.text(name));
        for field in &self.fields {
            hash.text(&field.name);
            hash.number(field.dtype as u64);
            field.shape.iter().for_each(|&n| hash.number(n as u64));
        }
        for input in self.commands.iter().chain(&self.writes) {
            hash.text(&input.name);
            hash.number(input.columns as u64);
        }
        hash.value()
    }

    /// Type of the real arrays of this run.
    pub fn real(&self) -> Dtype {
        if self.precision == "f64" {
            Dtype::F64
        } else {
            Dtype::F32
        }
    }

    /// Threads that steps keep busy: one world cannot use more than one.
    pub fn busy_threads(&self) -> usize {
        self.threads
            .min(self.worlds.saturating_mul(self.groups))
            .max(1)
    }

    /// Whether counts and ranges fit each other, so that what is computed of them neither overflows nor leaves its list.
    pub(crate) fn is_consistent(&self) -> bool {
        let entries = |inputs: &[InputInfo]| {
            let mut columns = inputs.iter().map(|input| input.columns);
            let columns = columns.try_fold(0usize, usize::checked_add)?;
            columns.checked_mul(self.worlds)
        };
        let of_field = |field: &FieldInfo| {
            let mut shape = field.shape.iter();
            shape.try_fold(1usize, |all, &n| all.checked_mul(n))
        };
        let sizes = [&self.commands, &self.writes].map(|inputs| entries(inputs));
        let fields = self.fields.iter().chain(&self.known_fields).map(of_field);
        let all_worlds = self.worlds.checked_mul(self.groups);
        let last_world = all_worlds.and_then(|worlds| worlds.checked_add(self.first_world));
        let mut sizes = sizes.into_iter().chain(fields).chain([last_world]);
        let are_there = |robot: &RobotRange| {
            NAMED_AXES.iter().all(|axis| {
                let (range, names) = (robot.columns(axis), self.names(axis));
                range
                    .zip(names)
                    .is_none_or(|([start, stop], names)| start <= stop && stop <= names.len())
            })
        };
        sizes.all(|size| size.is_some_and(|size| size <= ENTRIES_MAX))
            && self.robots.iter().all(are_there)
    }
}

/// Where the outputs are in a description that was recorded before there was a choice.
fn in_frame() -> String {
    "frame".to_owned()
}

/// What a description has of groups that was recorded before there were any.
fn one() -> usize {
    1
}

//! Description of a field that clients write, step or read: name, group, shape, unit.

use super::table::{Field, Source};
use crate::constants::Sizes;

/// Element type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dtype {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 32-bit integer.
    U32,
    /// Unsigned 64-bit integer.
    U64,
    /// Byte.
    U8,
}

impl Dtype {
    /// Size of an element [bytes].
    pub const fn bytes(self) -> usize {
        match self {
            Dtype::U8 => 1,
            Dtype::F32 | Dtype::I32 | Dtype::U32 => 4,
            Dtype::F64 | Dtype::U64 => 8,
        }
    }
}

/// Element type of a field: fixed, or the precision of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldDtype {
    /// f32 or f64, as the run is.
    Real,
    /// Fixed.
    Fixed(Dtype),
}

/// Who may write a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// What resumes a world; `write` sets it.
    State,
    /// Held over a control frame; `step` sets it.
    Command,
    /// Evaluated at the state of the frame.
    Derived,
    /// Kept by the simulation itself; part of every frame.
    Counter,
}

/// How a command is kept, and which values it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// Who keeps it.
    pub keeper: Keeper,
    /// The values that it takes.
    pub takes: Takes,
    /// Whether it becomes 0 in worlds that run in real time and stop because no command comes.
    pub stops: bool,
}

/// Who keeps a command until the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeper {
    /// The drives of joints: it acts with the world's delay and noise, and only `step` sets it.
    Drive,
    /// The state: it acts at once, and `write` sets it, too.
    State,
}

/// Values that a command takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// Any that are finite.
    Reals,
    /// The same, but 0 for dofs of free bodies, which have no drive.
    Targets,
    /// 0 or 1.
    Switches,
}

/// A dimension after `worlds`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Degrees of freedom.
    Dofs,
    /// Position coordinates.
    Coords,
    /// Links.
    Bodies,
    /// Constraint rows.
    Rows,
    /// Contacts that a world has room for.
    Contacts,
    /// Collision shapes.
    Shapes,
    /// Sites.
    Sites,
    /// Rays of all height scans.
    ScanRays,
    /// Contact sensors.
    ContactSensors,
    /// Actuators.
    Actuators,
    /// Contact pairs that MuJoCo models name.
    ContactPairs,
    /// Bodies that clients place.
    Mocaps,
    /// Equalities of MuJoCo models.
    Equalities,
    /// Activations of actuators.
    Activations,
    /// Bodies of MuJoCo models.
    OutputBodies,
    /// Sites of MuJoCo models.
    OutputSites,
    /// Geoms of MuJoCo models.
    OutputGeoms,
    /// Tendons of MuJoCo models.
    OutputTendons,
    /// Scalars of the sensors of MuJoCo models.
    Sensordata,
    /// A fixed length.
    Size(usize),
}

impl Axis {
    /// Its length for a model.
    pub fn len(self, sizes: &Sizes) -> usize {
        match self {
            Axis::Dofs => sizes.dofs,
            Axis::Coords => sizes.coords,
            Axis::Bodies => sizes.bodies,
            Axis::Rows => sizes.rows,
            Axis::Contacts => sizes.contacts,
            Axis::Shapes => sizes.shapes,
            Axis::Sites => sizes.sites,
            Axis::ScanRays => sizes.scan_rays,
            Axis::ContactSensors => sizes.contact_sensors,
            Axis::Actuators => sizes.actuators,
            Axis::ContactPairs => sizes.contact_pairs,
            Axis::Mocaps => sizes.mocaps,
            Axis::Equalities => sizes.equalities,
            Axis::Activations => sizes.activations,
            Axis::OutputBodies => sizes.output_bodies,
            Axis::OutputSites => sizes.output_sites,
            Axis::OutputGeoms => sizes.output_geoms,
            Axis::OutputTendons => sizes.output_tendons,
            Axis::Sensordata => sizes.sensordata,
            Axis::Size(n) => n,
        }
    }

    /// Its name in documents.
    pub fn name(self) -> String {
        match self {
            Axis::Dofs => "dofs".into(),
            Axis::Coords => "coords".into(),
            Axis::Bodies => "bodies".into(),
            Axis::Rows => "rows".into(),
            Axis::Contacts => "contacts".into(),
            Axis::Shapes => "shapes".into(),
            Axis::Sites => "sites".into(),
            Axis::ScanRays => "scan_rays".into(),
            Axis::ContactSensors => "contact_sensors".into(),
            Axis::Actuators => "actuators".into(),
            Axis::ContactPairs => "contact_pairs".into(),
            Axis::Mocaps => "mocaps".into(),
            Axis::Equalities => "equalities".into(),
            Axis::Activations => "activations".into(),
            Axis::OutputBodies => "nbody".into(),
            Axis::OutputSites => "nsite".into(),
            Axis::OutputGeoms => "ngeom".into(),
            Axis::OutputTendons => "ntendon".into(),
            Axis::Sensordata => "nsensordata".into(),
            Axis::Size(n) => n.to_string(),
        }
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct FieldRow {
    /// The field.
    pub field: Field,
    /// Its name for clients.
    pub name: &'static str,
    /// Who may write it.
    pub group: Group,
    /// Of a command, how it is kept.
    pub command: Option<Command>,
    /// Dimensions after `worlds`.
    pub shape: &'static [Axis],
    /// Unit; `–` for none.
    pub unit: &'static str,
    /// Element type.
    pub dtype: FieldDtype,
    /// What it is made of.
    pub source: Source,
    /// What it is.
    pub doc: &'static str,
}

const fn command(keeper: Keeper, takes: Takes, stops: bool) -> Command {
    Command {
        keeper,
        takes,
        stops,
    }
}
// what commands of the table are
pub(super) const FORCE: Command = command(Keeper::Drive, Takes::Reals, true);
pub(super) const TARGET: Command = command(Keeper::Drive, Takes::Targets, false);
pub(super) const RATE: Command = command(Keeper::Drive, Takes::Targets, true);
pub(super) const CONTROL: Command = command(Keeper::State, Takes::Reals, true);
pub(super) const POSE: Command = command(Keeper::State, Takes::Reals, false);
pub(super) const SWITCH: Command = command(Keeper::State, Takes::Switches, false);

pub(super) const REAL: FieldDtype = FieldDtype::Real;
pub(super) const F64: FieldDtype = FieldDtype::Fixed(Dtype::F64);
pub(super) const U64: FieldDtype = FieldDtype::Fixed(Dtype::U64);
pub(super) const U32: FieldDtype = FieldDtype::Fixed(Dtype::U32);
pub(super) const I32: FieldDtype = FieldDtype::Fixed(Dtype::I32);

impl Field {
    /// The field of this name.
    pub fn named(name: &str) -> Option<Field> {
        Field::ALL
            .iter()
            .copied()
            .find(|field| field.row().name == name)
    }

    /// The commands, in the order of the table.
    pub fn commands() -> impl Iterator<Item = Field> {
        let all = Field::ALL.iter().copied();
        all.filter(|field| field.row().command.is_some())
    }

    /// Whether a write may set it: a state, or a command that the state keeps.
    pub fn is_written(self) -> bool {
        let row = self.row();
        let kept = row.command.map(|command| command.keeper);
        row.group == Group::State || kept == Some(Keeper::State)
    }

    /// Whether every scene has it, even one without a joint. Scenes have other inputs where these have columns.
    pub fn is_of_joints(self) -> bool {
        matches!(self.row().shape, [Axis::Dofs | Axis::Coords, ..])
    }

    /// Whether it belongs to the state before the last substep where outputs do, as MuJoCo's data after a step: all but the state
    /// itself, commands and counters.
    pub fn lags(self) -> bool {
        use Field::{JointQMeasured, JointQdMeasured, Qpos, Qvel};
        let is_state = matches!(self, Qpos | Qvel | JointQMeasured | JointQdMeasured);
        self.row().group == Group::Derived && !is_state
    }

    /// Elements per world.
    pub fn elements(self, sizes: &Sizes) -> usize {
        self.row()
            .shape
            .iter()
            .map(|axis| axis.len(sizes))
            .product()
    }
}

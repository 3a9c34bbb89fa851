//! From a simulation to the protocol and back: its description, its frames, and commands that a client sends.

pub(crate) mod arrays;
pub(crate) mod refusal;
pub(crate) mod snapshot;

use sim_engine::backend::sharing::SharedMemory;
use sim_engine::backend::{Input, Values};
use sim_engine::simulation::{Options, Precision, Simulation};
use sim_model::{Description as Scene, JointKind, KeyState, Model};
use sim_physics::arrays::{Axis, Dtype, Field, FieldDtype, FieldRow, Layout};
use sim_physics::constants::Equality;
use sim_physics::constants::params::Param;
use sim_protocol::host::{Inbox, Numbers};
use sim_protocol::{
    self as protocol, InputInfo, Op, ParamInfo, RefusalKind, RobotRange, Row, Table,
};

use crate::export::refusal::{Refusal, refusal};
use crate::eyes::{self, Images};

// a frame can carry all fields, and an observer's the state besides
const _: () = assert!(Field::ALL.len() < protocol::ROWS_MAX);

/// What remains to be done for a frame once the inputs are set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Advance {
    Step,
    Forward,
}

/// Facts about a run besides its model.
pub(crate) struct RunInfo<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) scene_text: String,
    pub(crate) scene_folder: String,
    pub(crate) device: String,
    pub(crate) threads: usize,
    pub(crate) frames_held: usize,
    pub(crate) watch_worlds: usize,
    /// Images of cameras in the frames.
    pub(crate) images: &'a Images,
}

/// The table of a frame: the arena of the layout and the images behind the field table.
pub(crate) fn frame_table(layout: &Layout, images: &Images) -> Table {
    let slots = layout.slots.iter();
    let slots = slots.map(|slot| {
        let name = slot.field.row().name.to_owned();
        (name, dtype(slot.dtype), slot.shape.clone(), slot.offset)
    });
    let rows = images.fields().iter().map(|image| {
        let name = image.name.clone();
        (name, image.dtype, image.shape.clone(), image.offset)
    });
    Table::over_arena(slots.chain(rows), images.arena_bytes())
}

/// Names of the commands that are 0 in worlds that stop because no command comes.
pub(crate) fn stops() -> Vec<&'static str> {
    let stops = |input: &Input| input.kept().is_some_and(|command| command.stops);
    Input::commands().filter(stops).map(Input::name).collect()
}

/// Memory of a GPU, as clients import it.
pub(crate) fn device_memory(memory: SharedMemory, layout: &Layout) -> protocol::Delivery {
    let commands = memory.commands.iter();
    let commands = commands.map(|command| protocol::DeviceCommand {
        name: command.input.name().to_owned(),
        columns: command.columns,
        offset: command.offset,
    });
    let offsets = layout.slots.iter().map(|slot| slot.offset as u64);
    let there = protocol::DeviceMemory {
        uuid: memory.uuid.map(|byte| format!("{byte:02x}")).concat(),
        allocated: memory.allocated,
        dedicated: memory.dedicated,
        slots: memory.slots,
        stride: memory.stride,
        offsets: offsets.collect(),
        commands: commands.collect(),
        host_order: memory.timelines.as_ref().err().cloned(),
    };
    let mut descriptors = vec![memory.memory];
    descriptors.extend(memory.timelines.into_iter().flatten());
    (there, descriptors)
}

/// A keyframe, as clients see it.
fn keyframe(state: &KeyState) -> protocol::KeyframeInfo {
    let state = state.clone();
    protocol::KeyframeInfo {
        name: state.name,
        joint_q: state.joint_q,
        joint_qd: state.joint_qd,
        act: state.act,
        ctrl: state.ctrl,
        mocap_pos: state.mocap_pos,
        mocap_quat: state.mocap_quat,
    }
}

/// The description for clients; the host adds name, session and process.
pub(crate) fn description(
    model: &Model,
    options: &Options,
    layout: &Layout,
    info: RunInfo<'_>,
) -> protocol::Description {
    let real = real(options.precision);
    let sizes = model.sizes();
    let input = |is_one: fn(Field) -> bool| {
        let rows = Field::ALL.iter().filter(move |field| {
            is_one(**field) && (field.is_of_joints() || field.elements(&sizes) > 0)
        });
        rows.map(|field| InputInfo {
            name: field.row().name.to_owned(),
            columns: field.elements(&model.sizes()),
            unit: field.row().unit.to_owned(),
            doc: field.row().doc.to_owned(),
        })
        .collect()
    };
    protocol::Description {
        protocol: 0,
        release: String::new(),
        name: String::new(),
        session: 0,
        pid: 0,
        worlds: options.worlds,
        group: 0,
        groups: 1,
        first_world: options.first_world,
        device: info.device,
        adapter: String::new(),
        delivery: "direct".to_owned(),
        precision: precision_name(options.precision).to_owned(),
        cpu_bits: options.cpu_bits && options.precision == Precision::F32,
        threads: info.threads,
        dt: model.dt(),
        substeps: model.substeps(),
        gravity: info.scene.gravity,
        dof_names: model.names(Axis::Dofs),
        coord_names: model.names(Axis::Coords),
        body_names: model.names(Axis::Bodies),
        shape_names: model.names(Axis::Shapes),
        site_names: model.names(Axis::Sites),
        actuator_names: model.names(Axis::Actuators),
        activation_names: model.names(Axis::Activations),
        mocap_names: model.names(Axis::Mocaps),
        mocap_quat: model.start().mocap_quat.clone(),
        equality_names: model.names(Axis::Equalities),
        keyframes: model.keyframes().iter().map(keyframe).collect(),
        sensor_names: {
            let sensors = model.sensors().iter();
            sensors.map(|sensor| sensor.name.clone()).collect()
        },
        sensors: {
            let places = model.sensors().iter().map(|sensor| &sensor.place);
            places.map(|place| [place.start, place.end]).collect()
        },
        contact_sensor_names: model.names(Axis::ContactSensors),
        robots: model
            .robots()
            .iter()
            .map(|robot| RobotRange {
                name: robot.name.clone(),
                dofs: [robot.dofs.start, robot.dofs.end],
                coords: [robot.coords.start, robot.coords.end],
                bodies: [robot.bodies.start, robot.bodies.end],
                actuators: [robot.actuators.start, robot.actuators.end],
                is_mujoco: {
                    let mut models = info.scene.robots.iter();
                    models.any(|model| model.name == robot.name && model.precompiled.is_some())
                },
            })
            .collect(),
        followers: {
            let names = model.dof_names();
            let mimics = model.constants().equalities.iter();
            let follower = |mimic: &Equality<f64>| protocol::Follower {
                name: names[mimic.follower].clone(),
                leader: names[mimic.leader].clone(),
                multiplier: mimic.multiplier,
                offset: mimic.offset,
            };
            mimics.map(follower).collect()
        },
        fields: layout
            .slots
            .iter()
            .map(|slot| field_info(slot.field.row(), dtype(slot.dtype), slot.shape.clone()))
            .chain(info.images.fields().iter().map(|image| image.info()))
            .collect(),
        known_fields: Field::ALL
            .iter()
            .map(|field| {
                let row = field.row();
                let dtype = match row.dtype {
                    FieldDtype::Real => real,
                    FieldDtype::Fixed(fixed) => dtype(fixed),
                };
                field_info(row, dtype, Vec::new())
            })
            .chain(eyes::known(info.scene).map(|image| image.known()))
            .collect(),
        segment_names: info.images.segments().to_vec(),
        commands: {
            let mut commands: Vec<InputInfo> = input(|field| field.row().command.is_some());
            let loads = model.constants().varying.params();
            let loads = loads.filter(|param| param.is_load());
            commands.extend(loads.map(|param| param_info(model, param)));
            commands
        },
        writes: {
            let mut writes: Vec<InputInfo> = input(Field::is_written);
            let varying = model.constants().varying.params();
            writes.extend(varying.map(|param| param_info(model, param)));
            writes
        },
        params: Param::ALL
            .map(|param| ParamInfo {
                place: model.constants().varying.first(param),
                info: param_info(model, param),
            })
            .to_vec(),
        scene: info.scene_text,
        scene_folder: info.scene_folder,
        model_hash: model.hash(),
        notes: [notes(info.scene), info.images.notes().to_vec()].concat(),
        warnings: Vec::new(),
        driven: driven(model, info.scene),
        angle_range: angle_range(info.scene),
        frames_held: info.frames_held,
        watch_worlds: info.watch_worlds.min(options.worlds),
        watch_state_bytes: 0,
        joint_q_max: bound(options.faults.joint_q_max),
        joint_qd_max: bound(options.faults.joint_qd_max),
        on_fault: if options.faults.resets {
            "reset".to_owned()
        } else {
            "freeze".to_owned()
        },
        on_nan: if options.faults.freezes_nan {
            "freeze".to_owned()
        } else {
            "refuse".to_owned()
        },
        draws: options.draws.name().to_owned(),
        outputs_at: options.outputs_at.name().to_owned(),
        pace: None,
        state_bytes: 0,
        schema: 0,
    }
}

/// Which targets the drive of each dof follows: 1 positions, 2 velocities, 3 both; 4 more where the scene gives it one.
/// It has gains, or worlds may get some.
fn driven(model: &Model, scene: &Scene) -> Vec<u8> {
    let varies = |param| model.constants().varying.first(param).is_some();
    let [ke, kd] = [Param::JointTargetKe, Param::JointTargetKd].map(varies);
    let joints = scene.robots.iter().flat_map(|robot| {
        let moving = robot.moving_joints().into_iter();
        moving.map(|joint| &robot.joints[joint])
    });
    let aims = joints.flat_map(|joint| joint.dofs.iter().map(|dof| dof.target_q.is_some()));
    let dofs = model.constants().dofs.iter().zip(aims);
    dofs.map(|(dof, aims)| {
        let positions = dof.follows_position && (ke || dof.ke > 0.0);
        let velocities = dof.follows_velocity && (kd || dof.kd > 0.0);
        u8::from(positions) | u8::from(velocities) << 1 | u8::from(aims) << 2
    })
    .collect()
}

/// Limits of each dof that turns [rad], where it has any.
fn angle_range(scene: &Scene) -> Vec<Option<[f64; 2]>> {
    let mut ranges = Vec::new();
    for robot in &scene.robots {
        for joint in robot.moving_joints() {
            let joint = &robot.joints[joint];
            let turns = joint.kind == JointKind::Revolute;
            let limits = joint.range.filter(|range| {
                let is_finite = range.iter().all(|end| end.is_finite());
                turns && is_finite
            });
            ranges.resize(ranges.len() + joint.dofs.len(), limits);
        }
    }
    ranges
}

/// JSON has no infinity.
fn bound(largest: f64) -> Option<f64> {
    largest.is_finite().then_some(largest)
}

fn param_info(model: &Model, param: Param) -> InputInfo {
    let row = param.row();
    InputInfo {
        name: row.name.to_owned(),
        columns: param.columns(&model.sizes()),
        unit: row.unit.to_owned(),
        doc: row.doc.to_owned(),
    }
}

/// What was ignored or mended, and what is kept without an effect.
fn notes(scene: &Scene) -> Vec<String> {
    let mut notes = Vec::new();
    for shape in &scene.shapes {
        let named = shape.shape.notes();
        notes.extend(named.map(|note| format!("{}: {note}", shape.name)));
    }
    for robot in &scene.robots {
        let named = robot
            .notes
            .iter()
            .map(|note| format!("{}: {note}", robot.name));
        notes.extend(named);
    }
    notes
}

fn field_info(row: &FieldRow, dtype: protocol::Dtype, shape: Vec<usize>) -> protocol::FieldInfo {
    let axes = row
        .shape
        .iter()
        .map(|axis| format!(", {}", axis.name()))
        .collect::<String>();
    protocol::FieldInfo {
        name: row.name.to_owned(),
        dtype,
        shape,
        axes: if axes.is_empty() {
            "(worlds,)".to_owned()
        } else {
            format!("(worlds{axes})")
        },
        unit: row.unit.to_owned(),
        doc: row.doc.to_owned(),
    }
}

/// "f32" or "f64".
pub(crate) fn precision_name(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => "f32",
        Precision::F64 => "f64",
    }
}

fn real(precision: Precision) -> protocol::Dtype {
    match precision {
        Precision::F32 => protocol::Dtype::F32,
        Precision::F64 => protocol::Dtype::F64,
    }
}

fn dtype(dtype: Dtype) -> protocol::Dtype {
    match dtype {
        Dtype::F32 => protocol::Dtype::F32,
        Dtype::F64 => protocol::Dtype::F64,
        Dtype::I32 => protocol::Dtype::I32,
        Dtype::U32 => protocol::Dtype::U32,
        Dtype::U64 => protocol::Dtype::U64,
        Dtype::U8 => protocol::Dtype::U8,
    }
}

/// Sets the inputs of a command, all of them or none, and says how to go on.
///
/// `mask` is scratch that is kept between calls, so that nothing is allocated.
pub(crate) fn apply(
    simulation: &mut Simulation,
    inbox: &Inbox,
    mask: &mut Vec<bool>,
) -> Result<Advance, Refusal> {
    let masked = match (inbox.op(), inbox.mask()) {
        (_, None) => None,
        (Op::Reset | Op::Write | Op::Restore, Some(bytes)) => {
            mask.clear();
            mask.extend(bytes.iter().map(|&byte| byte != 0));
            Some(mask.as_slice())
        }
        (op, Some(_)) => {
            return Err(refusal(
                RefusalKind::Malformed,
                format!("{op:?} takes no mask"),
            ));
        }
    };
    match inbox.op() {
        Op::Step | Op::Write => {
            simulation.check_mask(masked)?;
            // one array is checked as it is set; of several, none may be set before all are checked
            let alone = inbox.arrays().nth(1).is_none();
            for row in inbox.arrays().filter(|_| !alone) {
                let (array, columns, values) = input(simulation, inbox, row)?;
                match inbox.op() {
                    Op::Step => simulation.check_command(array, &columns, values)?,
                    _ => simulation.check_write(array, &columns, values, masked)?,
                }
            }
            for row in inbox.arrays() {
                let (array, columns, values) = input(simulation, inbox, row)?;
                match inbox.op() {
                    Op::Step => simulation.command(array, columns, values)?,
                    _ => simulation.write(array, columns, values, masked)?,
                }
            }
        }
        Op::Reset => {
            let seeds = seeds(inbox)?;
            let states = || inbox.arrays().filter(|row| row.name != SEED);
            simulation.check_mask(masked)?;
            for row in states() {
                let (array, columns, values) = input(simulation, inbox, row)?;
                simulation.check_write(array, &columns, values, masked)?;
            }
            simulation.reset(masked, seeds)?;
            for row in states() {
                let (array, columns, values) = input(simulation, inbox, row)?;
                simulation.write(array, columns, values, masked)?;
            }
        }
        // the server answers a question before, and moves no world
        Op::Forward | Op::Ik | Op::Rollout => {}
        Op::Snapshot => snapshot::save(simulation, inbox)?,
        Op::Restore => snapshot::restore(simulation, inbox, masked)?,
    }
    Ok(if inbox.op() == Op::Step {
        Advance::Step
    } else {
        Advance::Forward
    })
}

/// Name of the seeds of a reset.
const SEED: &str = "seed";

/// The seeds of a reset; its other arrays are states.
fn seeds(inbox: &Inbox) -> Result<Option<&[u64]>, Refusal> {
    let mut seeds = None;
    for row in inbox.arrays().filter(|row| row.name == SEED) {
        let Some(Numbers::U64(values)) = inbox.numbers(row) else {
            let reason = "`seed`: entries must be uint64".to_owned();
            return Err(refusal(RefusalKind::Shape, reason));
        };
        seeds = Some(values);
    }
    Ok(seeds)
}

/// An array of a command as the simulation takes it.
fn input<'a>(
    simulation: &Simulation,
    inbox: &'a Inbox,
    row: &Row,
) -> Result<(Input, std::ops::Range<usize>, Values<'a>), Refusal> {
    let named = match inbox.op() {
        Op::Step => Input::command(&row.name).or_else(|| Field::named(&row.name).map(Input::Field)),
        _ => Input::named(&row.name),
    };
    let array = named.ok_or_else(|| {
        refusal(
            RefusalKind::Field,
            format!("there is no field `{}`", row.name),
        )
    })?;
    let shape = |needed: String| refusal(RefusalKind::Shape, format!("`{}`: {needed}", row.name));
    let [worlds, columns] = row.shape[..] else {
        return Err(shape(format!(
            "an array (worlds, columns) is needed, this one has {} axes",
            row.shape.len()
        )));
    };
    if worlds != simulation.worlds() {
        return Err(shape(format!(
            "{worlds} worlds given, the simulation has {}",
            simulation.worlds()
        )));
    }
    let end = row
        .start
        .checked_add(columns)
        .ok_or_else(|| shape("columns out of range".to_owned()))?;
    let values = match (inbox.numbers(row), simulation.precision()) {
        (Some(Numbers::F32(values)), Precision::F32) => Values::F32(values),
        (Some(Numbers::F64(values)), Precision::F64) => Values::F64(values),
        (_, precision) => {
            return Err(shape(format!(
                "entries must be {}",
                real(precision).numpy_name()
            )));
        }
    };
    Ok((array, row.start..end, values))
}

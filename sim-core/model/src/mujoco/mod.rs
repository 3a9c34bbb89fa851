//! Models that MuJoCo compiled, from a file that `tightloop.precompiled` exports.
//!
//! The file holds arrays of `mjModel` under their own names (`format.rs` reads them). MuJoCo's defaults,
//! includes and unit conversions are done then. What the physics does not have is refused by the element's name
//! ([`refusals`]): a model never runs differently in silence.

mod actuators;
mod constraints;
mod contents;
mod fields;
mod format;
mod frames;
mod geoms;
mod keyframes;
mod looks;
mod meshes;
mod names;
mod options;
mod pairs;
mod passive;
mod plasticity;
mod rays;
mod reflected;
mod refusals;
mod sensors;
mod tendons;
mod tree;

use std::path::Path;

use crate::description::{Description, Robot};
use crate::error::ModelError;
use crate::pose::Pose;
pub use contents::{MujocoContents, MujocoElement};
use format::ModelFile;
pub use looks::MujocoCamera;
pub use options::MujocoOptions;
use sim_physics::constants::options::Integrator;

impl Robot {
    /// Reads a model that MuJoCo compiled as one robot. Its link 0 is the world, which `options.pose` places.
    ///
    /// # Errors
    /// A file that cannot be read, or whose elements are not supported, by their names.
    pub fn from_mujoco(
        path: impl AsRef<Path>,
        options: MujocoOptions,
    ) -> Result<Robot, ModelError> {
        let path = path.as_ref();
        let file = ModelFile::read(path)?;
        let refused = refusals::refusals(&file)?;
        if !refused.is_empty() {
            let reasons = refusals::listed(&refused);
            return Err(ModelError::MujocoRefused { reasons });
        }
        let mut robot = tree::robot(&file, &options)?;
        robot.notes.extend(notes(&file)?);
        let places = geoms::add_geoms(&file, &options, &mut robot)?;
        pairs::add_pairs(&file, &places, &mut robot)?;
        actuators::add_actuators(&file, &mut robot)?;
        sensors::add_sensors(&file, &mut robot)?;
        robot.notes.extend(sensor_notes(&file, &robot)?);
        Ok(robot)
    }
}

impl Description {
    /// A scene with the options and the only robot of a model that MuJoCo compiled: its time step, gravity and solver, one
    /// substep a control frame.
    ///
    /// # Errors
    /// As [`Robot::from_mujoco`].
    pub fn from_mujoco(
        path: impl AsRef<Path>,
        options: MujocoOptions,
    ) -> Result<Description, ModelError> {
        let file = ModelFile::read(path.as_ref())?;
        let mut scene = options::scene(&file)?;
        scene.add_robot(Robot::from_mujoco(path, options)?)?;
        Ok(scene)
    }
}

/// What a run does differently from what the model says, or leaves out.
fn notes(file: &ModelFile) -> Result<Vec<String>, ModelError> {
    let mut notes = Vec::new();
    let solver = file.texts("opt.solver")?;
    if let Some(solver) = solver.first().filter(|solver| *solver != "mjSOL_NEWTON") {
        notes.push(format!("Newton's method takes the place of {solver}"));
    }
    let is_spatial = tendons::spatial_tendons(file)?;
    let used = tendons::used(file, is_spatial.len())?;
    if is_spatial
        .iter()
        .zip(used)
        .any(|(&spatial, used)| spatial && used)
    {
        notes.push(
            "cfrc_ext, cfrc_int and sensors of forces between bodies leave out spatial tendons, as in MuJoCo 3.11"
                .to_owned(),
        );
    }
    notes.extend(newer_steps(file)?);
    // what `without` left out of the model
    if file.has("notes.without") {
        notes.extend(file.texts("notes.without")?);
    }
    Ok(notes)
}

/// Where MuJoCo 4.0 changed a step, and ours is that of MuJoCo 3.17.
fn newer_steps(file: &ModelFile) -> Result<Vec<String>, ModelError> {
    if !file.is_since([4, 0])? {
        return Ok(Vec::new());
    }
    let integrator = options::integrator(file)?;
    let kinds = file.kinds("jnt_type", file.rows("jnt_type"))?;
    let turns = kinds
        .iter()
        .any(|kind| kind == "mjJNT_BALL" || kind == "mjJNT_FREE");
    let limits = ["jnt_actfrclimited", "tendon_actfrclimited"];
    let saturates = limits.iter().any(|limit| file.first_set(limit).is_some());
    let acts = file.rows("actuator_trntype") > 0;
    let changes = [
        (
            integrator == Integrator::RungeKutta && turns,
            "RK4 turns ball and free joints as in MuJoCo 3.17, with second order",
        ),
        (
            integrator == Integrator::ImplicitFast && saturates && acts,
            "implicitfast damps by actuators beyond `actuatorfrcrange`, as in MuJoCo 3.17",
        ),
        (
            integrator == Integrator::Implicit && saturates && acts,
            "implicit damps by actuators beyond `actuatorfrcrange`, as in MuJoCo 3.17",
        ),
    ];
    let changed = changes.iter().filter(|(is_changed, _)| *is_changed);
    Ok(changed.map(|(_, note)| (*note).to_owned()).collect())
}

/// Sensors that are not there.
fn sensor_notes(file: &ModelFile, robot: &Robot) -> Result<Vec<String>, ModelError> {
    let sensors = file.integer("nsensor")?;
    if sensors > 0 && !file.has("sensor_type") {
        return Ok(vec![format!(
            "its {sensors} sensors are not read; save the scene again"
        )]);
    }
    let parts = robot.precompiled.as_ref().map(|parts| &parts.sensors);
    let refused = parts.map_or(&[][..], |sensors| &sensors.refused);
    Ok(match refused.is_empty() {
        true => Vec::new(),
        false => vec![format!(
            "`sensordata` cannot be shown: {}",
            refusals::listed(refused)
        )],
    })
}

/// A quaternion of MuJoCo's, (w, x, y, z), in our order.
fn quat([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [x, y, z, w]
}

/// A frame by MuJoCo's position and quaternion.
fn frame(pos: [f64; 3], mujoco: [f64; 4]) -> Pose {
    Pose {
        pos,
        quat: quat(mujoco),
    }
    .normalized()
}

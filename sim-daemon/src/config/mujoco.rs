//! MuJoCo models of a scene file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sim_model::{Cone, Description, Lens, MujocoCamera, MujocoOptions, Robot};

use super::error::ConfigError;
use super::number::Number;
use super::pose::{no_rotation, pose};
use super::summary::robot_summary;

fn hull_vertices() -> usize {
    MujocoOptions::HULL_VERTICES
}

/// A model that MuJoCo compiled, from a file that `tightloop.mujoco` exports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MujocoTable {
    /// Its name in the scene.
    pub name: String,
    /// The exported file.
    pub model: PathBuf,
    /// Position of the model's world in the scene's [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation of the model's world in the scene's, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
    /// Most vertices of the convex hull of a mesh, 8 to 1024.
    #[serde(default = "hull_vertices")]
    pub mesh_max_hull_vertices: usize,
}

impl MujocoTable {
    /// The model as a robot; relative paths are looked for in `base_dir`.
    pub(super) fn robot(&self, base_dir: &Path) -> Result<Robot, ConfigError> {
        let options = MujocoOptions {
            name: self.name.clone(),
            pose: pose(&self.pos, &self.quat),
            max_hull_vertices: self.mesh_max_hull_vertices,
        };
        Ok(Robot::from_mujoco(base_dir.join(&self.model), options)?)
    }
}

/// What a client wants to know of an exported model: the keys of [`robot_summary`], names of actuators, sites, geoms, tendons and
/// sensors, `cameras`, and `options` with the keys of a scene.
///
/// # Errors
/// What is wrong with the file, or not supported, by name.
pub fn mujoco_summary(path: &Path, max_hull_vertices: usize) -> Result<Value, ConfigError> {
    let options = MujocoOptions {
        max_hull_vertices,
        ..MujocoOptions::named("model")
    };
    let scene = Description::from_mujoco(path, options)?;
    scene.validate()?;
    let robot = &scene.robots[0];
    let mut summary = robot_summary(robot);
    let actuators = robot.precompiled.iter().flat_map(|parts| &parts.actuators);
    let solver = &scene.solver;
    summary["actuator_names"] = actuators
        .map(|actuator| Value::from(actuator.name.as_str()))
        .collect();
    if let Some(parts) = &robot.precompiled {
        let sensors = parts.sensors.all.iter().map(|sensor| &sensor.name);
        summary["site_names"] = json!(parts.frames.site_names);
        summary["geom_names"] = json!(parts.frames.geom_names);
        summary["tendon_names"] = json!(parts.frames.tendon_names);
        summary["sensor_names"] = sensors.map(|name| json!(name)).collect();
    }
    let integrator = robot.precompiled.as_ref().map(|parts| {
        let implicit = if parts.implicit_damping {
            ""
        } else {
            ", eulerdamp off"
        };
        let safe = if parts.safe_references {
            ""
        } else {
            ", refsafe off"
        };
        let islands = if parts.islands { "" } else { ", island off" };
        let warm = if parts.warm_start {
            ""
        } else {
            ", warmstart off"
        };
        let (kind, ls_tolerance) = (parts.integrator, parts.ls_tolerance);
        let noslip = match parts.noslip {
            (0, _) => String::new(),
            (iterations, tolerance) => {
                format!(", noslip_iterations {iterations} to {tolerance}")
            }
        };
        format!("{kind:?}{implicit}{safe}{islands}{warm}, ls_tolerance {ls_tolerance}{noslip}")
    });
    let cameras = Robot::mujoco_cameras(path)?;
    summary["cameras"] = cameras.iter().map(camera_summary).collect();
    summary["options"] = json!({
        "integrator": integrator,
        "dt": scene.dt,
        "gravity": scene.gravity,
        "solver": {
            "iterations": solver.iterations,
            "ls_iterations": solver.ls_iterations,
            "tolerance": solver.tolerance,
            "cone": match solver.cone {
                Cone::Elliptic => "elliptic",
                Cone::Pyramidal => "pyramidal",
            },
            "impratio": solver.impratio,
        },
    });
    Ok(summary)
}

/// A camera: its link, its frame there, `resolution` [pixels], and `fov` [rad], or `focal` and `center` [pixels].
fn camera_summary(camera: &MujocoCamera) -> Value {
    let (fov, focal, center) = match camera.lens {
        Lens::Fov(fov) => (Some(fov), None, None),
        Lens::Intrinsics { focal, center } => (None, Some(focal), Some(center)),
    };
    json!({
        "name": camera.name,
        "link": camera.link,
        "pos": camera.pose.pos,
        "quat": camera.pose.quat,
        "resolution": camera.resolution,
        "fov": fov,
        "focal": focal,
        "center": center,
        "is_fixed": camera.is_fixed,
    })
}

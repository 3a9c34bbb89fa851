//! What a client wants to know of a robot before any daemon runs.

use std::path::Path;

use serde_json::{Value, json};
use sim_model::geometry::{Mesh, MeshOptions};
use sim_model::{Joint, JointDof, JointKind, Robot, UrdfOptions};

use super::error::ConfigError;
use super::number::Number;

/// Names, defaults and notes of a URDF file; no limit is `null` for ranges, `"inf"` otherwise.
///
/// Keys: `name`; one entry a moving joint: `joint_names`, `joint_types`, `joint_range` (pairs), `joint_velocity_limit`,
/// `joint_mimic` (`null`, or an object with `joint`, `multiplier`, `offset`); one entry per coordinate: `coord_names`, `joint_q`;
/// one entry per dof: `dof_names`, `dof_driven`, `joint_effort_limit`, `joint_limit_ke`, `joint_limit_kd`, `joint_damping`, `joint_friction`, `joint_armature`;
/// `link_names` (in body order), `shape_names` (`link/shape`), `notes`, `warnings`.
///
/// # Errors
/// What is wrong with the file, by name.
pub fn urdf_summary(path: &Path, options: UrdfOptions) -> Result<Value, ConfigError> {
    Ok(robot_summary(&Robot::from_urdf(path, options)?))
}

/// What a scene's robot is, as [`urdf_summary`] has it.
pub(crate) fn robot_summary(robot: &Robot) -> Value {
    let joints: Vec<&Joint> = robot
        .moving_joints()
        .into_iter()
        .map(|joint| &robot.joints[joint])
        .collect();
    let links: Vec<_> = robot
        .link_order()
        .into_iter()
        .map(|link| &robot.links[link].name)
        .collect();
    let each = |value: &dyn Fn(&Joint) -> Value| -> Value {
        joints.iter().map(|joint| value(joint)).collect()
    };
    let dofs = |value: &dyn Fn(&JointDof) -> Value| -> Value {
        let all = joints.iter().flat_map(|joint| &joint.dofs);
        all.map(value).collect()
    };
    let limit = |limit: Option<f64>| json!(Number(limit.unwrap_or(f64::INFINITY)));
    let start: Vec<f64> = joints.iter().flat_map(|joint| joint.q.clone()).collect();
    let driven: Vec<bool> = driven(robot);
    json!({
        "name": robot.name,
        "joint_names": each(&|joint| json!(joint.name)),
        "joint_types": each(&|joint| json!(joint_type(joint))),
        "joint_range": each(&|joint| json!(joint.range)),
        "joint_velocity_limit": each(&|joint| limit(joint.velocity_limit)),
        "joint_mimic": each(&|joint| match joint.mimic {
            None => Value::Null,
            Some(mimic) => json!({
                "joint": robot.joints[mimic.joint].name,
                "multiplier": mimic.multiplier,
                "offset": mimic.offset,
            }),
        }),
        "coord_names": robot.coord_names(),
        "joint_q": start,
        "dof_names": robot.dof_names(),
        "dof_driven": driven,
        "joint_effort_limit": dofs(&|dof| limit(dof.effort_limit)),
        "joint_limit_ke": dofs(&|dof| json!(dof.limit_gains()[0])),
        "joint_limit_kd": dofs(&|dof| json!(dof.limit_gains()[1])),
        "joint_damping": dofs(&|dof| json!(dof.damping)),
        "joint_friction": dofs(&|dof| json!(dof.friction)),
        "joint_armature": dofs(&|dof| json!(dof.armature)),
        "link_names": links,
        "shape_names": robot.shape_names(),
        "notes": robot.notes,
        "warnings": robot.warnings,
    })
}

/// What a mesh file becomes: `file`, `scale`, `triangles`, `closed`, `hull_vertices` (a number per hull), `extent`, `notes`.
///
/// # Errors
/// Why the file cannot be used, with the cure.
pub fn mesh_summary(
    path: &Path,
    scale: [f64; 3],
    options: &MeshOptions,
) -> Result<Value, ConfigError> {
    let mesh = Mesh::load(path, scale, options)?;
    let mut summary = mesh_properties(&mesh);
    summary["notes"] = json!(mesh.notes);
    Ok(summary)
}

/// What a mesh is, as [`mesh_summary`] has it, without its notes.
pub(crate) fn mesh_properties(mesh: &Mesh) -> Value {
    json!({
        "file": mesh.path.to_string_lossy(),
        "scale": mesh.scale,
        "triangles": mesh.triangles.triangles.len(),
        "closed": mesh.closed,
        "hull_vertices": mesh.hulls.iter().map(|hull| hull.vertices.len()).collect::<Value>(),
        "extent": mesh.triangles.extent(),
    })
}

/// URDF's word for a joint's motion.
pub(crate) fn joint_type(joint: &Joint) -> &'static str {
    match joint.kind {
        JointKind::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Ball => "spherical",
        JointKind::Planar => "planar",
        JointKind::Free => "floating",
        JointKind::Revolute if joint.range.is_none() => "continuous",
        JointKind::Revolute => "revolute",
    }
}

/// Whether each dof can have a drive: those of a free body cannot.
pub(super) fn driven(robot: &Robot) -> Vec<bool> {
    let joints = robot
        .moving_joints()
        .into_iter()
        .map(|joint| &robot.joints[joint]);
    joints
        .flat_map(|joint| vec![joint.kind != JointKind::Free; joint.dofs.len()])
        .collect()
}

//! What a client wants to know of a robot before any daemon runs.

use std::path::Path;

use serde_json::{Value, json};
use sim_core::model::{Robot, UrdfOptions};

use super::{ConfigError, Number};

/// Names, defaults and notes of a URDF file, arrays in dof order; no limit is `null` for ranges, `"inf"` otherwise.
///
/// Keys: `name`, `joint_names`, `joint_types`, `joint_q`, `joint_range` (pairs), `joint_effort_limit`,
/// `joint_velocity_limit`, `joint_damping`, `joint_friction`, `joint_armature`, `joint_mimic` (`null`, or an object with `joint`,
/// `multiplier`, `offset`), `link_names` (in body order), `notes`.
///
/// # Errors
/// What is wrong with the file, by name.
pub fn urdf_summary(path: &Path, options: UrdfOptions) -> Result<Value, ConfigError> {
    let robot = Robot::from_urdf(path, options)?;
    let joints: Vec<_> = robot
        .dofs()
        .into_iter()
        .map(|dof| &robot.joints[dof])
        .collect();
    let links: Vec<_> = robot
        .link_order()
        .into_iter()
        .map(|link| &robot.links[link].name)
        .collect();
    let each = |value: &dyn Fn(&sim_core::model::Joint) -> Value| -> Value {
        joints.iter().map(|joint| value(joint)).collect()
    };
    let limit = |limit: Option<f64>| json!(Number(limit.unwrap_or(f64::INFINITY)));
    Ok(json!({
        "name": robot.name,
        "joint_names": each(&|joint| json!(joint.name)),
        "joint_types": each(&|joint| json!(match joint.kind {
            sim_core::model::JointKind::Prismatic => "prismatic",
            _ if joint.range.is_none() => "continuous",
            _ => "revolute",
        })),
        "joint_q": each(&|joint| json!(joint.q)),
        "joint_range": each(&|joint| json!(joint.range)),
        "joint_effort_limit": each(&|joint| limit(joint.effort_limit)),
        "joint_velocity_limit": each(&|joint| limit(joint.velocity_limit)),
        "joint_damping": each(&|joint| json!(joint.damping)),
        "joint_friction": each(&|joint| json!(joint.friction)),
        "joint_armature": each(&|joint| json!(joint.armature)),
        "joint_mimic": each(&|joint| match joint.mimic {
            None => Value::Null,
            Some(mimic) => json!({
                "joint": robot.joints[mimic.joint].name,
                "multiplier": mimic.multiplier,
                "offset": mimic.offset,
            }),
        }),
        "link_names": links,
        "notes": robot.notes,
    }))
}

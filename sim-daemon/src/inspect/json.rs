//! The report as JSON.

use std::path::Path;

use serde_json::{Value, json};
use sim_model::{Collision, Joint, MujocoContents, Pose, Shape, principal_moments};

use super::mujoco;
use super::properties::Properties;
use crate::config::{joint_type, mesh_properties, robot_summary};

/// All there is to say of a robot or a model: what [`crate::config::urdf_summary`] has, and `file`, `floating`, `base`, `mass`,
/// `links`, `picture`.
///
/// Of a model that MuJoCo compiled also `mujoco`, as [`super::mujoco::json`] has it; a link may have several `joints`.
///
/// A link, in body order: `name`, `parent`, `merged_into`, `joint` (`name`, `type`, `axis`, `pos`, `quat`), `mass`, `center`,
/// `inertia`, `principal_moments`, `collisions` (`type`, sizes, `pos`, `quat`). What is absent is `null`; SI units.
pub(super) fn document(
    properties: &Properties,
    contents: Option<&MujocoContents>,
    file: &Path,
    picture: Option<&Path>,
) -> Value {
    let robot = properties.robot;
    let mut document = robot_summary(robot);
    let mut add = |key: &str, value: Value| document[key] = value;
    add("file", path(Some(file)));
    add("floating", json!(properties.is_floating()));
    add("base", json!(properties.base()));
    add("mass", json!(properties.mass()));
    add(
        "links",
        properties
            .order
            .iter()
            .map(|&l| link(properties, l))
            .collect(),
    );
    add("picture", path(picture));
    if let Some(contents) = contents {
        add("mujoco", mujoco::json(contents));
    }
    document
}

fn path(path: Option<&Path>) -> Value {
    path.map_or(Value::Null, |path| json!(path.to_string_lossy()))
}

fn link(properties: &Properties, index: usize) -> Value {
    let robot = properties.robot;
    let link = &robot.links[index];
    let joint = properties.joint(index);
    let parent = joint.and_then(|joint| joint.parent);
    let inertial = link.inertial.as_ref();
    json!({
        "name": link.name,
        "parent": parent.map(|parent| &robot.links[parent].name),
        "merged_into": properties.merged_into(index),
        "joint": joint.map(above),
        "joints": properties.joints(index).map(above).collect::<Value>(),
        "mass": inertial.map(|inertial| inertial.mass),
        "center": inertial.map(|inertial| inertial.pos),
        "inertia": inertial.map(|inertial| inertial.inertia),
        "principal_moments": inertial.map(|inertial| principal_moments(inertial.inertia)),
        "collisions": link.collisions.iter().map(collision).collect::<Value>(),
    })
}

fn above(joint: &Joint) -> Value {
    let joint_type = joint_type(joint);
    let value = json!({ "name": joint.name, "type": joint_type, "axis": joint.axis });
    placed(&joint.origin, value)
}

fn collision(collision: &Collision) -> Value {
    let mut value = match &collision.shape {
        Shape::Plane => json!({}),
        Shape::Box { half_extents } => json!({ "half_extents": half_extents }),
        Shape::Sphere { radius } => json!({ "radius": radius }),
        Shape::Cylinder {
            radius,
            half_height,
        }
        | Shape::Capsule {
            radius,
            half_height,
        } => json!({ "radius": radius, "half_height": half_height }),
        Shape::Ellipsoid { radii } => json!({ "radii": radii }),
        Shape::Mesh(mesh) => mesh_properties(mesh),
        Shape::HeightField(field) => json!({
            "samples": [field.rows, field.columns],
            "size": field.half.map(|half| 2.0 * half),
            "elevation": field.range(),
        }),
    };
    value["name"] = json!(collision.name);
    value["type"] = json!(collision.shape.kind());
    placed(&collision.pose, value)
}

/// With the place of its frame in the frame above.
fn placed(pose: &Pose, mut value: Value) -> Value {
    value["pos"] = json!(pose.pos);
    value["quat"] = json!(pose.quat);
    value
}

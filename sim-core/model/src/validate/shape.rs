//! Checks of frames and shapes.

use crate::description::Collision;
use crate::error::ModelError;
use crate::geometry::Shape;
use crate::pose::{Pose, QUAT_SLACK};
use crate::value_checks::{finite, positive, within};

/// Largest length [m]: f32 keeps a tenth of a metre there.
const LENGTH_MAX: f64 = 1e6;

/// Refuses a frame with a number that is not finite, or a quaternion that is no rotation.
pub(crate) fn pose(what: &str, pose: &Pose) -> Result<(), ModelError> {
    length(&format!("{what}: position"), pose.pos)?;
    for value in pose.quat {
        finite(&format!("{what}: quaternion"), value)?;
    }
    let length = pose.quat_length();
    if (length - 1.0).abs() > QUAT_SLACK {
        return Err(ModelError::Quaternion {
            what: what.to_owned(),
            length,
        });
    }
    Ok(())
}

/// A collision by its name, or by its place in its link.
pub(crate) fn collision_name(owner: &str, index: usize, collision: &Collision) -> String {
    match &collision.name {
        Some(name) => format!("{owner}: collision `{name}`"),
        None => format!("{owner}: collision {index}"),
    }
}

/// Refuses lengths beyond what a scene can hold.
pub(super) fn length<const N: usize>(what: &str, values: [f64; N]) -> Result<(), ModelError> {
    let rule = "give at most 1e6 m";
    let mut values = values.into_iter();
    values.try_for_each(|value| within(what, value, LENGTH_MAX, rule))
}

/// Refuses sizes that are not positive.
fn size<const N: usize>(what: &str, values: [f64; N]) -> Result<(), ModelError> {
    values
        .into_iter()
        .try_for_each(|value| positive(what, value))?;
    length(what, values)
}

/// Refuses sizes that are not positive or too large.
pub(crate) fn shape_sizes(what: &str, shape: &Shape) -> Result<(), ModelError> {
    match *shape {
        Shape::Plane => Ok(()),
        Shape::Box { half_extents } => {
            size(&format!("{what}: half extent of the box"), half_extents)
        }
        Shape::Sphere { radius } => size(&format!("{what}: radius of the sphere"), [radius]),
        Shape::Cylinder {
            radius,
            half_height,
        }
        | Shape::Capsule {
            radius,
            half_height,
        } => {
            let kind = shape.kind();
            size(&format!("{what}: radius of the {kind}"), [radius])?;
            size(&format!("{what}: half height of the {kind}"), [half_height])
        }
        Shape::Ellipsoid { radii } => size(&format!("{what}: radius of the ellipsoid"), radii),
        // checked when it was read
        Shape::Mesh(_) | Shape::HeightField(_) => Ok(()),
    }
}

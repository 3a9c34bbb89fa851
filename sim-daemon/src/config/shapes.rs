//! Shapes of a scene file: static ones, and those of bodies.

use serde::{Deserialize, Serialize};
use sim_core::model::{Pose, Shape};

use super::{BodyTable, ConfigError, Number, no_rotation, pose};

/// A shape, static or of a body; which sizes it has depends on its type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeTable {
    /// Its name; left out, a static shape is named after its type.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: ShapeName,
    /// Half of each edge of a box [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_extents: Option<[Number; 3]>,
    /// Radius of a sphere, cylinder or capsule [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<Number>,
    /// Half of the height of a cylinder, or of that between the half spheres of a capsule [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_height: Option<Number>,
    /// Name of the body that bears it; left out, it is static.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Density of a body's shape [kg/m³]; left out, that of water. A static shape has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<Number>,
    /// Position in the world, or in the body's frame [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation in the world, or in the body's frame, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
}

/// Type of a shape, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShapeName {
    /// A cuboid.
    Box,
    /// A ball.
    Sphere,
    /// A cylinder along its z.
    Cylinder,
    /// A capsule along its z.
    Capsule,
}

impl ShapeTable {
    /// Its name, or its place in the list, for messages.
    fn called(&self, index: usize) -> String {
        self.name.clone().unwrap_or_else(|| format!("#{index}"))
    }

    /// Refuses a bearer that is not there, and the density of what bears no mass.
    pub(super) fn check_body(&self, index: usize, bodies: &[BodyTable]) -> Result<(), ConfigError> {
        let reason = match (&self.body, self.density) {
            (None, Some(_)) => {
                "a static shape has no density; leave it out, or name its body".to_owned()
            }
            (Some(body), _) if bodies.iter().all(|table| table.name != *body) => {
                format!("its body `{body}` is none of the scene's [[body]] tables")
            }
            _ => return Ok(()),
        };
        let shape = self.called(index);
        Err(ConfigError::Shape { shape, reason })
    }

    /// Its frame.
    pub(super) fn pose(&self) -> Pose {
        pose(&self.pos, &self.quat)
    }

    /// Its geometry; `index` is its place in the list, from 0.
    pub(super) fn shape(&self, index: usize) -> Result<Shape, ConfigError> {
        let (kind, sizes): (_, &[&str]) = match self.kind {
            ShapeName::Box => ("box", &["half_extents"]),
            ShapeName::Sphere => ("sphere", &["radius"]),
            ShapeName::Cylinder => ("cylinder", &["radius", "half_height"]),
            ShapeName::Capsule => ("capsule", &["radius", "half_height"]),
        };
        let given = [
            ("half_extents", self.half_extents.is_some()),
            ("radius", self.radius.is_some()),
            ("half_height", self.half_height.is_some()),
        ];
        for (size, given) in given {
            if given != sizes.contains(&size) {
                let shape = self.called(index);
                let reason = match given {
                    true => format!("a {kind} has no {size}; give {}", sizes.join(" and ")),
                    false => format!("{size} is missing; a {kind} needs {}", sizes.join(" and ")),
                };
                return Err(ConfigError::Shape { shape, reason });
            }
        }
        let radius = self.radius.unwrap_or_default().0;
        let half_height = self.half_height.unwrap_or_default().0;
        Ok(match self.kind {
            ShapeName::Box => Shape::Box {
                half_extents: self.half_extents.unwrap_or_default().map(|half| half.0),
            },
            ShapeName::Sphere => Shape::Sphere { radius },
            ShapeName::Cylinder => Shape::Cylinder {
                radius,
                half_height,
            },
            ShapeName::Capsule => Shape::Capsule {
                radius,
                half_height,
            },
        })
    }
}

//! Rigid bodies of a scene file.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sim_model::Body;
use sim_model::geometry::DENSITY;

use super::error::ConfigError;
use super::number::Number;
use super::pose::{no_rotation, pose};
use super::shapes::ShapeTable;

/// A rigid body, free in the world or fixed in it; what is left out comes from its shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyTable {
    /// Its name in the scene.
    pub name: String,
    /// Position of its frame in the world, at the start [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation of its frame in the world, at the start, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
    /// Whether it stands still.
    #[serde(default)]
    pub fixed: bool,
    /// Mass [kg]; left out, that of its shapes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<Number>,
    /// Centre of mass in its frame [m]; left out, that of its shapes, or the origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub com: Option<[Number; 3]>,
    /// Inertia about the centre of mass in its axes `(3, 3)` [kg·m²]; left out, that of its shapes at its mass, or,
    /// without any, that of a solid ball of water.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<[[Number; 3]; 3]>,
}

impl BodyTable {
    /// The body that it stands for, with those of the scene's shapes that name it; relative paths are looked for in
    /// `base_dir`.
    pub(super) fn body(&self, shapes: &[ShapeTable], base_dir: &Path) -> Result<Body, ConfigError> {
        let mut body = Body::new(&self.name, pose(&self.pos, &self.quat));
        body.fixed = self.fixed;
        body.mass = self.mass.map(|mass| mass.0);
        body.com = self.com.map(|com| com.map(|part| part.0));
        body.inertia = self
            .inertia
            .map(|inertia| inertia.map(|row| row.map(|entry| entry.0)));
        for (index, shape) in shapes.iter().enumerate() {
            if shape.body.as_ref() == Some(&self.name) {
                let collision = shape.collision(index, base_dir)?;
                let density = shape.density.map_or(DENSITY, |density| density.0);
                body.shapes.push((collision, density));
            }
        }
        Ok(body)
    }
}

//! Rigid bodies of a scene, each a robot of one link that is free or fixed.

use crate::description::{BODY_LINK, Collision, Description, Link, Robot};
use crate::error::ModelError;
use crate::geometry::{DENSITY, Shape, mass_properties};
use crate::inertia::{Inertial, merge};
use crate::pose::Pose;
use crate::validate::collision_name;

/// A rigid body as users describe it. Its shapes give what is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name, unique in the scene.
    pub name: String,
    /// Its frame in the world, at the start.
    pub pose: Pose,
    /// Whether it stands still.
    pub fixed: bool,
    /// Mass [kg]; `None` is that of its shapes.
    pub mass: Option<f64>,
    /// Centre of mass in its frame [m]; `None` is that of its shapes, or the origin.
    pub com: Option<[f64; 3]>,
    /// Inertia about the centre of mass, in body axes `(3, 3)` [kg·m²]; `None` is that of its shapes at its mass, or,
    /// without any, that of a solid ball of water.
    pub inertia: Option<[[f64; 3]; 3]>,
    /// Its shapes, each with its density [kg/m³].
    pub shapes: Vec<(Collision, f64)>,
}

impl Body {
    /// A free body without mass and shapes.
    pub fn new(name: &str, pose: Pose) -> Body {
        Body {
            name: name.to_owned(),
            pose,
            fixed: false,
            mass: None,
            com: None,
            inertia: None,
            shapes: Vec::new(),
        }
    }

    /// Mass, centre and inertia; `None` for nothing at all.
    fn inertial(&self) -> Result<Option<Inertial>, ModelError> {
        let mut shapes: Option<Inertial> = None;
        for (index, (collision, density)) in self.shapes.iter().enumerate() {
            if matches!(collision.shape, Shape::Plane | Shape::HeightField(_)) {
                let owner = format!("body `{}`", self.name);
                let what = collision_name(&owner, index, collision);
                return Err(ModelError::PlaneBorne { what });
            }
            let part = mass_properties(&collision.shape, *density)?;
            let whole = shapes.unwrap_or(Inertial {
                mass: 0.0,
                pos: [0.0; 3],
                inertia: [[0.0; 3]; 3],
            });
            shapes = Some(merge(&whole, &collision.pose, &part));
        }
        if let (None, Some(_)) = (self.mass, self.inertia) {
            return Err(ModelError::BodyMass {
                body: self.name.clone(),
                problem: "has an inertia but no mass; give its mass too",
            });
        }
        let Some(mass) = self.mass.or(shapes.map(|shapes| shapes.mass)) else {
            if self.fixed {
                return Ok(None);
            }
            return Err(ModelError::BodyMass {
                body: self.name.clone(),
                problem: "weighs nothing; give its mass, give it a shape, or fix it",
            });
        };
        let inertia = match (self.inertia, shapes) {
            (Some(inertia), _) => inertia,
            (None, Some(shapes)) => shapes
                .inertia
                .map(|row| row.map(|entry| entry * mass / shapes.mass)),
            (None, None) => ball(mass),
        };
        Ok(Some(Inertial {
            mass,
            pos: self
                .com
                .or(shapes.map(|shapes| shapes.pos))
                .unwrap_or([0.0; 3]),
            inertia,
        }))
    }
}

/// Inertia of a solid ball of water, 2/5 m r². `(3, 3)` [kg·m²]
fn ball(mass: f64) -> [[f64; 3]; 3] {
    let radius = libm::cbrt(mass / (DENSITY * 4.0 / 3.0 * std::f64::consts::PI));
    let moment = 0.4 * mass * radius * radius;
    [[moment, 0.0, 0.0], [0.0, moment, 0.0], [0.0, 0.0, moment]]
}

impl Description {
    /// Adds a rigid body: a robot of one link, `body`, that joint `free` carries if it is not fixed.
    ///
    /// # Errors
    /// A body that weighs nothing, or a value that is out of range, by name; the scene is then unchanged.
    pub fn add_body(&mut self, body: Body) -> Result<&mut Robot, ModelError> {
        let notes = (body.shapes.iter())
            .flat_map(|(shape, _)| shape.shape.notes())
            .collect();
        let link = Link {
            name: BODY_LINK.to_owned(),
            inertial: body.inertial()?,
            collisions: body.shapes.into_iter().map(|(shape, _)| shape).collect(),
        };
        let mut robot = Robot {
            name: body.name,
            pose: body.pose.normalized(),
            floating: false,
            self_collisions: false,
            links: vec![link],
            joints: Vec::new(),
            notes,
            warnings: Vec::new(),
            urdf: None,
            precompiled: None,
        };
        if !body.fixed {
            robot.free_root("free");
        }
        robot.validate()?;
        self.add_robot(robot)
    }
}

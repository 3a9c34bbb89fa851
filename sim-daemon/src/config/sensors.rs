//! What a scene file has of sensors: sites, sums of contact forces, and height scans.

use serde::{Deserialize, Serialize};
use sim_model::{ContactSensor, HeightScan, Site};

use super::number::Number;
use super::pose::{no_rotation, pose};

/// A frame of interest, in the world or on a body or link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SiteTable {
    /// Its name among the sites.
    pub name: String,
    /// Name of the body that carries it, or `robot/link`; left out, it stands in the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Position in the world, or in the frame of what carries it [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation there, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
    /// The site, body or `robot/link` that its pose and velocity are measured from; left out, the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_to: Option<String>,
    /// Damping of its inverse Jacobian [m and rad alike].
    #[serde(default = "damping")]
    pub damping: Number,
}

fn damping() -> Number {
    Number(Site::DAMPING)
}

/// The sum of contact forces on some shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactSensorTable {
    /// Its name among the contact sensors.
    pub name: String,
    /// What the forces are on: a shape, or a robot, body or link for all its shapes.
    pub of: String,
    /// What they come from, named alike; left out, everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<String>,
}

/// A grid of vertical rays under a frame, which turns with its yaw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightScanTable {
    /// Its name among the height scans.
    pub name: String,
    /// Name of the body that carries it, or `robot/link`; left out, it stands in the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Middle of the grid in the world, or in the frame of what carries it [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Rays along x and y of the frame.
    pub counts: [usize; 2],
    /// Distances between neighbouring rays along x and y [m].
    pub spacing: [Number; 2],
    /// The value where the ground is farther away, or where there is none; left out, 10 [m].
    #[serde(default = "reach")]
    pub reach: Number,
}

fn reach() -> Number {
    Number(10.0)
}

impl HeightScanTable {
    /// The scan that it stands for.
    pub(super) fn scan(&self) -> HeightScan {
        HeightScan {
            name: self.name.clone(),
            body: self.body.clone(),
            pos: self.pos.map(|x| x.0),
            counts: self.counts,
            spacing: self.spacing.map(|x| x.0),
            reach: self.reach.0,
        }
    }
}

impl SiteTable {
    /// The site that it stands for.
    pub(super) fn site(&self) -> Site {
        Site {
            name: self.name.clone(),
            body: self.body.clone(),
            pose: pose(&self.pos, &self.quat),
            relative_to: self.relative_to.clone(),
            damping: self.damping.0,
        }
    }
}

impl ContactSensorTable {
    /// The sensor that it stands for.
    pub(super) fn sensor(&self) -> ContactSensor {
        ContactSensor {
            name: self.name.clone(),
            of: self.of.clone(),
            against: self.against.clone(),
        }
    }
}

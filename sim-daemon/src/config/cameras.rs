//! Cameras in scene files.

use serde::{Deserialize, Serialize};
use sim_model::{Camera, Lens, Sees};

use super::error::ConfigError;
use super::number::Number;
use super::pose::{no_rotation, pose};

/// A pinhole camera, in the world or on a body or link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Its name, an identifier of 19 bytes at most; its fields are `NAME_depth`, `NAME_segmentation` and `NAME_rgb`.
    pub name: String,
    /// Name of the body that carries it, or `robot/link`; left out, it stands in the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Position in the world, or in the frame of what carries it [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation there, unit quaternion (x, y, z, w), of axes x right, y down and z forward in the image [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Vertical field of view [rad]; left out, 45° or what `focal` gives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov: Option<Number>,
    /// Focal lengths along x and y in place of `fov` [pixels].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal: Option<[Number; 2]>,
    /// Principal point from the upper left corner, with `focal`; left out, the middle [pixels].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[Number; 2]>,
    /// Nearest depth that is seen [m].
    #[serde(default = "near")]
    pub near: Number,
    /// Farthest depth that is seen [m].
    #[serde(default = "far")]
    pub far: Number,
    /// Control frames from one image to the next; between them, frames repeat the last image.
    #[serde(default = "one")]
    pub every: usize,
    /// Numbers of the worlds that have images; left out, all worlds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worlds: Option<Vec<usize>>,
    /// What is seen of robots: their `visuals`, or their `collisions`.
    #[serde(default)]
    pub sees: SeesName,
    /// Standard deviation of depths: so much [m], and so much times the square of the depth [1/m].
    #[serde(default, skip_serializing_if = "is_exact")]
    pub depth_noise: [Number; 2],
}

/// What a camera sees of robots, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SeesName {
    /// What they look like.
    #[default]
    Visuals,
    /// What touches.
    Collisions,
}

fn near() -> Number {
    Number(Camera::NEAR)
}

fn far() -> Number {
    Number(Camera::FAR)
}

fn one() -> usize {
    1
}

fn is_exact(noise: &[Number; 2]) -> bool {
    *noise == [Number(0.0); 2]
}

impl CameraTable {
    /// The camera that it stands for.
    ///
    /// # Errors
    /// Two lenses, or a part of one.
    pub(super) fn camera(&self) -> Result<Camera, ConfigError> {
        let wrong = |reason: &str| {
            Err(ConfigError::Camera {
                camera: self.name.clone(),
                reason: reason.to_owned(),
            })
        };
        let lens = match (self.fov, self.focal, self.center) {
            (Some(_), Some(_), _) => return wrong("has both `fov` and `focal`; give one of them"),
            (_, None, Some(_)) => return wrong("has a `center` and no `focal`; give both"),
            (fov, None, None) => Lens::Fov(fov.map_or(Camera::FOV, |fov| fov.0)),
            (None, Some(focal), center) => Lens::Intrinsics {
                focal: focal.map(|pixels| pixels.0),
                center: match center {
                    Some(center) => center.map(|pixels| pixels.0),
                    None => [self.width, self.height].map(|pixels| 0.5 * pixels as f64),
                },
            },
        };
        Ok(Camera {
            name: self.name.clone(),
            body: self.body.clone(),
            pose: pose(&self.pos, &self.quat),
            width: self.width,
            height: self.height,
            lens,
            near: self.near.0,
            far: self.far.0,
            every: self.every,
            worlds: self.worlds.clone(),
            sees: match self.sees {
                SeesName::Visuals => Sees::Visuals,
                SeesName::Collisions => Sees::Collisions,
            },
            depth_noise: self.depth_noise.map(|part| part.0),
            draws: Default::default(), // which `randomize` has
        })
    }
}

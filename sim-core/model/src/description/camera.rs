//! Cameras. Physics knows none of them, and no hash has them: those who draw read them beside the model.

use super::scene::Description;
use crate::distribution::Distribution;
use crate::error::ModelError;
use crate::pose::Pose;

/// A pinhole camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its name, an identifier that is unique among the cameras.
    pub name: String,
    /// What carries it: a body, or `robot/link`; `None` is the world.
    pub body: Option<String>,
    /// Its frame there: x to the right of the image, y down, z forward, as in OpenCV.
    pub pose: Pose,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Which rays its pixels have.
    pub lens: Lens,
    /// Depths from here on are seen [m].
    pub near: f64,
    /// Depths up to here are seen [m].
    pub far: f64,
    /// Control frames from one image to the next.
    pub every: usize,
    /// Numbers of the worlds that have images; all of them if there are none.
    pub worlds: Option<Vec<usize>>,
    /// What it sees of robots.
    pub sees: Sees,
    /// Standard deviation of a depth: so much [m], and so much times the square of the depth [1/m].
    pub depth_noise: [f64; 2],
    /// Offsets that a reset draws, by [`CameraPart`].
    pub draws: [Option<Distribution>; CameraPart::ALL.len()],
}

/// What a reset may draw of a camera, in the order of [`Camera::draws`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraPart {
    /// Along the x axis of the camera [m].
    X,
    /// Along its y axis [m].
    Y,
    /// Along its z axis [m].
    Z,
    /// About its x axis, first of three turns about fixed axes [rad].
    Roll,
    /// About its y axis [rad].
    Pitch,
    /// About its z axis [rad].
    Yaw,
    /// Of the focal lengths, as a part of them [–].
    Focal,
}

impl CameraPart {
    /// All parts.
    pub const ALL: [CameraPart; 7] = [
        CameraPart::X,
        CameraPart::Y,
        CameraPart::Z,
        CameraPart::Roll,
        CameraPart::Pitch,
        CameraPart::Yaw,
        CameraPart::Focal,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            CameraPart::X => "x",
            CameraPart::Y => "y",
            CameraPart::Z => "z",
            CameraPart::Roll => "roll",
            CameraPart::Pitch => "pitch",
            CameraPart::Yaw => "yaw",
            CameraPart::Focal => "focal",
        }
    }
}

/// Which rays the pixels of a camera have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// A vertical field of view about the middle of the image [rad].
    Fov(f64),
    /// Measured intrinsics.
    Intrinsics {
        /// Focal lengths along x and y [pixels].
        focal: [f64; 2],
        /// The principal point, from the upper left corner of the image [pixels].
        center: [f64; 2],
    },
}

/// What a camera sees of robots whose files have both visuals and collision shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sees {
    /// What they look like.
    Visuals,
    /// What touches.
    Collisions,
}

impl Camera {
    /// Vertical field of view where none is given, as in MuJoCo: 45° [rad].
    pub const FOV: f64 = std::f64::consts::FRAC_PI_4;
    /// Nearest depth where none is given [m].
    pub const NEAR: f64 = 0.01;
    /// Farthest depth where none is given [m].
    pub const FAR: f64 = 10.0;

    /// Focal lengths along x and y, and the principal point from the upper left corner [pixels].
    pub fn intrinsics(&self) -> ([f64; 2], [f64; 2]) {
        match self.lens {
            Lens::Fov(fov) => {
                let [width, height] = [self.width, self.height].map(|pixels| 0.5 * pixels as f64);
                ([height / (0.5 * fov).tan(); 2], [width, height])
            }
            Lens::Intrinsics { focal, center } => (focal, center),
        }
    }
}

impl Description {
    /// The link that carries a camera, as the model names it, and the camera's frame there; no link in the world.
    ///
    /// # Errors
    /// A body or link that the scene does not have.
    pub fn camera_frame(&self, camera: &Camera) -> Result<(Option<String>, Pose), ModelError> {
        let what = format!("camera `{}`", camera.name);
        let Some((robot, link)) = self.bearer(&what, camera.body.as_deref())? else {
            return Ok((None, camera.pose));
        };
        let robot = &self.robots[robot];
        // the first link of a MuJoCo model is its world
        if robot.precompiled.is_some() && link == 0 {
            return Ok((None, robot.pose.mul(&camera.pose)));
        }
        let body = format!("{}/{}", robot.name, robot.links[link].name);
        Ok((Some(body), camera.pose))
    }
}

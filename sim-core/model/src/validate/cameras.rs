//! Checks of cameras.

use super::shape::pose;
use crate::description::{Camera, CameraPart, Description, Lens};
use crate::error::ModelError;
use crate::value_checks::{count, in_range, unique, within};

/// Most cameras: each has a stream of random numbers.
const CAMERAS_MAX: f64 = 100.0;
/// Longest name [bytes]: fields of frames are named after cameras, and have 32.
const NAME_MAX: usize = 19;
/// Most pixels along an axis.
const PIXELS_MAX: usize = 4096;
/// Most frames from one image to the next.
const EVERY_MAX: usize = 1_000_000;
/// No launch has as many worlds.
const WORLDS_MAX: f64 = (1u64 << 31) as f64;

impl Description {
    pub(super) fn validate_cameras(&self) -> Result<(), ModelError> {
        let rule = "give at most 100 cameras";
        within("cameras", self.cameras.len() as f64, CAMERAS_MAX, rule)?;
        let names = self.cameras.iter().map(|camera| camera.name.as_str());
        unique("scene", "camera", names).map_err(|(_, error)| error)?;
        self.cameras
            .iter()
            .try_for_each(|camera| self.validate_camera(camera))
    }

    fn validate_camera(&self, camera: &Camera) -> Result<(), ModelError> {
        name(&camera.name)?;
        let what = format!("camera `{}`", camera.name);
        pose(&what, &camera.pose)?;
        self.bearer(&what, camera.body.as_deref())?;
        for (side, pixels) in [("width", camera.width), ("height", camera.height)] {
            let rule = "it must be between 1 and 4096 pixels";
            count(&format!("{what}: {side}"), pixels, PIXELS_MAX, rule)?;
        }
        match camera.lens {
            Lens::Fov(fov) => {
                // a pixel at the edge of a wider one would be thousands of focal lengths away
                let holds = (1e-3..=3.1).contains(&fov);
                let rule = "it must be between 0.001 and 3.1 rad";
                in_range(&format!("{what}: fov"), fov, holds, rule)?;
            }
            Lens::Intrinsics { focal, center } => {
                for value in focal {
                    let holds = (1e-2..=1e7).contains(&value);
                    let rule = "it must be between 0.01 and 1e7 pixels";
                    in_range(&format!("{what}: focal"), value, holds, rule)?;
                }
                for value in center {
                    let holds = value.abs() <= 1e6;
                    let rule = "it must be between -1e6 and 1e6 pixels";
                    in_range(&format!("{what}: center"), value, holds, rule)?;
                }
            }
        }
        let holds = (1e-6..=1e6).contains(&camera.near);
        let rule = "it must be between 1e-6 and 1e6 m";
        in_range(&format!("{what}: near"), camera.near, holds, rule)?;
        let holds = camera.far > camera.near && camera.far <= 1e6;
        let rule = "it must be above `near`, and at most 1e6 m";
        in_range(&format!("{what}: far"), camera.far, holds, rule)?;
        let rule = "it must be between 1 and 1000000 frames";
        count(&format!("{what}: every"), camera.every, EVERY_MAX, rule)?;
        if let Some(worlds) = &camera.worlds {
            let rule = "give 1 to 1000000, or leave them out for all";
            let named = format!("{what}: number of worlds");
            count(&named, worlds.len(), EVERY_MAX, rule)?;
            let last = worlds.iter().copied().max().unwrap_or(0) as f64;
            let rule = "it must be below 2^31";
            in_range(&format!("{what}: world"), last, last < WORLDS_MAX, rule)?;
        }
        for value in camera.depth_noise {
            let rule = "it must be between 0 and 1000";
            let holds = (0.0..=1000.0).contains(&value);
            in_range(&format!("{what}: depth_noise"), value, holds, rule)?;
        }
        for (part, draw) in CameraPart::ALL.iter().zip(&camera.draws) {
            if let Some(draw) = draw {
                draw.validate(&format!("{what}: {}", part.name()))?;
            }
        }
        Ok(())
    }
}

/// Refuses a name that is no identifier, or too long for a field of frames.
fn name(name: &str) -> Result<(), ModelError> {
    let mut letters = name.chars();
    let starts = letters
        .next()
        .is_some_and(|first| first.is_ascii_alphabetic() || first == '_');
    let is_identifier = starts && letters.all(|next| next.is_ascii_alphanumeric() || next == '_');
    let rule = match name.len() <= NAME_MAX {
        true if is_identifier => return Ok(()),
        true => {
            "fields are named after cameras; give letters, digits and _, and no digit at the start"
        }
        false => "fields are named after cameras; give it at most 19 bytes",
    };
    Err(ModelError::BadName {
        what: "camera",
        name: name.chars().take(80).flat_map(char::escape_debug).collect(),
        rule,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::Sees;
    use crate::pose::Pose;

    fn camera() -> Camera {
        Camera {
            name: "wrist".to_owned(),
            body: None,
            pose: Pose::identity(),
            width: 64,
            height: 48,
            lens: Lens::Fov(Camera::FOV),
            near: Camera::NEAR,
            far: Camera::FAR,
            every: 1,
            worlds: None,
            sees: Sees::Visuals,
            depth_noise: [0.0; 2],
            draws: [None; 7],
        }
    }

    /// What is wrong with a scene of these cameras.
    fn problem(cameras: Vec<Camera>) -> String {
        let mut scene = Description::new(0.002, 1);
        scene.cameras = cameras;
        let result = scene.validate();
        result.map_or_else(|error| error.to_string(), |()| String::new())
    }

    #[test]
    fn what_is_wrong_with_a_camera_is_named() {
        assert_eq!(problem(vec![camera()]), "");
        type Change = (&'static str, fn(&mut Camera));
        let wrong: [Change; 16] = [
            ("`a b`", |camera| camera.name = "a b".to_owned()),
            ("`3d`", |camera| camera.name = "3d".to_owned()),
            ("at most 19 bytes", |camera| camera.name = "c".repeat(20)),
            (
                "camera `wrist`: there is no body or link `arm/hand`",
                |camera| {
                    camera.body = Some("arm/hand".to_owned());
                },
            ),
            ("width", |camera| camera.width = 0),
            ("height", |camera| camera.height = 5000),
            ("fov", |camera| camera.lens = Lens::Fov(3.2)),
            ("fov", |camera| camera.lens = Lens::Fov(f64::NAN)),
            ("focal", |camera| {
                camera.lens = Lens::Intrinsics {
                    focal: [50.0, 0.0],
                    center: [32.0, 24.0],
                };
            }),
            ("near", |camera| camera.near = 0.0),
            ("far", |camera| camera.far = camera.near),
            ("far", |camera| camera.far = 1e40),
            ("every", |camera| camera.every = 0),
            ("depth_noise", |camera| camera.depth_noise = [0.0, -1.0]),
            ("number of worlds", |camera| {
                camera.worlds = Some(Vec::new())
            }),
            ("world is", |camera| {
                camera.worlds = Some(vec![0, usize::MAX])
            }),
        ];
        for (culprit, make_wrong) in wrong {
            let mut camera = camera();
            make_wrong(&mut camera);
            let said = problem(vec![camera]);
            assert!(said.contains(culprit), "{said:?} names no {culprit}");
        }
        let twice = problem(vec![camera(), camera()]);
        assert!(twice.contains("wrist"), "{twice}");
    }

    #[test]
    fn a_field_of_view_is_that_of_the_rows() {
        let (focal, center) = camera().intrinsics();
        let expected = 24.0 / (0.5 * Camera::FOV).tan();
        assert_eq!((focal, center), ([expected; 2], [32.0, 24.0]));
    }
}

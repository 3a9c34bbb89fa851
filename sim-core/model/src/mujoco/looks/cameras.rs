//! The cameras of a MuJoCo model, as scenes have them.

use std::path::Path;

use crate::description::{Lens, Robot};
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use crate::mujoco::frames::on_links;
use crate::mujoco::names::names;
use crate::pose::Pose;

/// Half a turn about x: MuJoCo's cameras look along -z with y up, ours along z with y down.
const TURNED: Pose = Pose {
    pos: [0.0; 3],
    quat: [1.0, 0.0, 0.0, 0.0],
};

/// A camera of a MuJoCo model.
#[derive(Clone, Debug, PartialEq)]
pub struct MujocoCamera {
    /// Its name.
    pub name: String,
    /// The link that carries it.
    pub link: String,
    /// Its frame there: x to the right of the image, y down, z forward.
    pub pose: Pose,
    /// Width and height of its image [pixels]; 1 where the model does not say.
    pub resolution: [usize; 2],
    /// Its rays, for an image of that resolution.
    pub lens: Lens,
    /// Whether it is fixed to its link, and neither tracks nor targets a body.
    pub is_fixed: bool,
}

impl Robot {
    /// Reads the cameras of a model that MuJoCo compiled; none where the file has no names of them.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn mujoco_cameras(path: impl AsRef<Path>) -> Result<Vec<MujocoCamera>, ModelError> {
        let file = &ModelFile::read(path.as_ref())?;
        if !file.has("names.camera") {
            return Ok(Vec::new());
        }
        let links = names(file, "body", file.rows("body_parentid"))?;
        let places = on_links(file, "cam", links.len())?;
        let count = places.len();
        let names = names(file, "camera", count)?;
        let modes = file.kinds("cam_mode", count)?;
        let fovs = file.vectors::<1>("cam_fovy", count)?;
        let sizes = file.vectors_of_integers::<2>("cam_resolution", count)?;
        let sensors = file.vectors::<2>("cam_sensorsize", count)?;
        let intrinsics = file.vectors::<4>("cam_intrinsic", count)?;
        let camera = |(k, name): (usize, String)| {
            let resolution = sizes[k].map(|pixels| usize::try_from(pixels).unwrap_or(0).max(1));
            MujocoCamera {
                name,
                link: links[places[k].link].clone(),
                pose: places[k].pose.mul(&TURNED),
                resolution,
                lens: match sensors[k].iter().all(|&size| size > 0.0) {
                    true => measured(resolution, sensors[k], intrinsics[k]),
                    false => Lens::Fov(fovs[k][0].to_radians()),
                },
                is_fixed: modes[k] == "mjCAMLIGHT_FIXED",
            }
        };
        Ok(names.into_iter().enumerate().map(camera).collect())
    }
}

/// The lens before a sensor of a size [m], with its focal lengths and its principal point from the middle, x to the left and y
/// down (`mjv_cameraFrustum`) [m].
fn measured(resolution: [usize; 2], sensor: [f64; 2], [fx, fy, cx, cy]: [f64; 4]) -> Lens {
    let per_metre = [0, 1].map(|k| resolution[k] as f64 / sensor[k]);
    let middle = resolution.map(|pixels| 0.5 * pixels as f64);
    Lens::Intrinsics {
        focal: [fx * per_metre[0], fy * per_metre[1]],
        center: [middle[0] - cx * per_metre[0], middle[1] + cy * per_metre[1]],
    }
}

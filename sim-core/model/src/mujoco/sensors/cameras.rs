//! Sensors about cameras and zones.

use super::{Reader, Sensed};
use crate::description::{AimPart, EyePart, OnLink, Sense};
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use crate::mujoco::frames::on_links;

/// Cameras of a model.
pub(super) struct Cameras {
    /// Their frames where nothing aims them.
    pub(super) places: Vec<OnLink>,
    modes: Vec<String>,
}

impl Cameras {
    pub(super) fn read(file: &ModelFile, bodies: usize) -> Result<Cameras, ModelError> {
        let places = on_links(file, "cam", bodies)?;
        Ok(Cameras {
            modes: file.kinds("cam_mode", places.len())?,
            places,
        })
    }

    /// A camera, and what it follows or looks at.
    pub(super) fn eye(
        &self,
        file: &ModelFile,
        camera: usize,
    ) -> Result<Result<EyePart, String>, ModelError> {
        let count = self.places.len();
        let on = self.places[camera];
        let mode = self.modes[camera].as_str();
        if mode == "mjCAMLIGHT_FIXED" {
            let aim = AimPart::Fixed;
            return Ok(Ok(EyePart { on, aim }));
        }
        // files of older versions have none of the arrays below
        if !file.has("cam_mat0") {
            return Ok(Err("cameras that track or target".to_owned()));
        }
        let aim = match mode {
            "mjCAMLIGHT_TRACK" | "mjCAMLIGHT_TRACKCOM" => {
                let is_center = mode == "mjCAMLIGHT_TRACKCOM";
                let offsets = if is_center { "cam_poscom0" } else { "cam_pos0" };
                let [x, y, z, u, v, w, r, s, t] = file.vectors::<9>("cam_mat0", count)?[camera];
                AimPart::Follows {
                    is_center,
                    offset: file.vectors::<3>(offsets, count)?[camera],
                    axes: [[x, y, z], [u, v, w], [r, s, t]],
                }
            }
            _ => {
                let bodies = file.rows("body_parentid");
                match file.indices("cam_targetbodyid", count, bodies)?[camera] {
                    Some(link) => AimPart::LooksAt {
                        link,
                        is_center: mode == "mjCAMLIGHT_TARGETBODYCOM",
                    },
                    // as in MuJoCo
                    None => AimPart::Fixed,
                }
            }
        };
        Ok(Ok(EyePart { on, aim }))
    }
}

impl Reader<'_> {
    /// The pixel of a site in the picture of a camera.
    pub(super) fn projection(&self, k: usize) -> Sensed {
        if self.objects[1][k] != "mjOBJ_CAMERA" {
            return Err(self.fault(k));
        }
        let camera = match self.eye(k, 1)? {
            Ok(camera) => camera,
            Err(what) => return Ok(Err(what)),
        };
        // files of older versions have none of the arrays below
        if !self.file.has("cam_resolution") {
            return Ok(Err("camprojection".to_owned()));
        }
        let (id, count) = (self.ids[1][k] as usize, self.cameras.places.len());
        let [width, height] = self
            .file
            .vectors_of_integers::<2>("cam_resolution", count)?[id];
        let size = self.file.vectors::<2>("cam_sensorsize", count)?[id];
        let lens = self.file.vectors::<4>("cam_intrinsic", count)?[id];
        let fovy = self.file.reals("cam_fovy", count)?[id];
        let pixels = [width as f64, height as f64];
        // by a sensor's size in MuJoCo's single precision, else by the angle of view, whatever the
        // projection
        let focal = match size.iter().all(|side| *side != 0.0) {
            true => [0, 1].map(|i| {
                let ratio = lens[i] as f32 / size[i] as f32;
                f64::from(ratio * pixels[i] as f32)
            }),
            false => [0.5 / (fovy.to_radians() / 2.0).tan() * pixels[1]; 2],
        };
        Ok(Ok(Sense::Projection {
            camera,
            site: self.site(k)?,
            focal,
            middle: pixels.map(|side| side / 2.0),
        }))
    }

    /// Whether the origin of a frame is in the zone of a site, which a sensor has as its reference.
    pub(super) fn inside(&self, k: usize) -> Sensed {
        let zone = self.zone(k, 1)?;
        Ok(match self.eye(k, 0)? {
            Ok(eye) => Ok(Sense::Inside(zone, eye)),
            Err(what) => Err(what),
        })
    }
}

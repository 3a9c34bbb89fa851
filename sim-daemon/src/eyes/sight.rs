//! The cameras that were asked for, and what they see.

use std::path::Path;
use std::sync::Arc;

use sim_model::{Camera, Description, Model, ModelError, Sees};
use sim_render::{Draw, Frame, Scene, draw};

use super::chance::Chance;
use super::fields::{ImageField, known};
use super::parts::{Segments, seen};
use crate::config::SceneFile;
use crate::error::DaemonError;

/// Cameras with their scenes, which all groups of worlds share.
pub(crate) struct Sight {
    pub(super) eyes: Vec<Eye>,
    /// Images of one world, camera by camera.
    pub(super) fields: Vec<ImageField>,
    pub(super) draw: Draw,
    /// What labels of segmentation are places in.
    pub(crate) segments: Vec<String>,
    /// What cannot be seen, a sentence each.
    pub(crate) notes: Vec<String>,
}

/// A camera that is asked for.
pub(super) struct Eye {
    /// Its index in the scene.
    pub(super) number: usize,
    pub(super) camera: sim_render::Camera,
    /// The body that carries it.
    pub(super) body: Option<usize>,
    /// Its frame there.
    pub(super) frame: Frame,
    /// Control frames from one image to the next.
    pub(super) every: u64,
    /// Numbers of the worlds that have images, in order; all worlds if there are none.
    worlds: Option<Vec<usize>>,
    pub(super) chance: Chance,
    pub(super) scene: Arc<Scene>,
}

impl Eye {
    /// Whether the world of this number has its images.
    pub(super) fn sees(&self, world: usize) -> bool {
        let worlds = self.worlds.as_ref();
        worlds.is_none_or(|worlds| worlds.binary_search(&world).is_ok())
    }

    /// The last world that has images, if not all have.
    pub(super) fn last_world(&self) -> Option<usize> {
        self.worlds.as_ref()?.last().copied()
    }
}

impl Sight {
    /// The cameras of these image fields; none if there is no field.
    ///
    /// # Errors
    /// A field that the scene's cameras do not have, and a processor that cannot draw.
    pub(crate) fn open(
        file: &SceneFile,
        base_dir: &Path,
        description: &Description,
        model: &Model,
        names: &[String],
    ) -> Result<Option<Sight>, DaemonError> {
        let Some(first) = names.first() else {
            return Ok(None);
        };
        let wrong = |name: &str, problem: String| DaemonError::Argument {
            argument: "fields",
            value: name.to_owned(),
            problem,
        };
        let all: Vec<_> = known(description).collect();
        for name in names {
            if !all.iter().any(|field| field.name == *name) {
                let there: Vec<_> = all.iter().map(|field| field.name.as_str()).collect();
                let cure = match there.is_empty() {
                    true => "the scene has no cameras; add one with Scene.add_camera".to_owned(),
                    false => format!("those of the scene's cameras are {}", there.join(", ")),
                };
                return Err(wrong(name, format!("unknown field; {cure}")));
            }
        }
        let Some(draw) = draw() else {
            let problem = "cameras need a processor with AVX2 and FMA, or with NEON";
            return Err(wrong(first, problem.to_owned()));
        };
        let fields = all.into_iter().filter(|field| names.contains(&field.name));
        let fields: Vec<_> = fields.collect();
        let looks = file.looks(description, base_dir);
        let mut scenes: Vec<(Sees, Arc<Scene>)> = Vec::new();
        let mut sight = Sight {
            eyes: Vec::new(),
            fields,
            draw,
            segments: Vec::new(),
            notes: looks.notes.clone(),
        };
        let mut segments = Segments::new(model.body_names());
        for (number, camera) in description.cameras.iter().enumerate() {
            if !sight.fields.iter().any(|field| field.camera == number) {
                continue;
            }
            let built = scenes.iter().find(|(sees, _)| *sees == camera.sees);
            let scene = match built {
                Some((_, scene)) => Arc::clone(scene),
                None => {
                    let (parts, notes) = seen(&looks, &mut segments, camera.sees);
                    sight.notes.extend(notes);
                    let scene = Arc::new(Scene::new(&parts));
                    scenes.push((camera.sees, Arc::clone(&scene)));
                    scene
                }
            };
            sight
                .eyes
                .push(eye(description, model, number, camera, scene)?);
        }
        sight.segments = segments.names;
        Ok(Some(sight))
    }
}

fn eye(
    description: &Description,
    model: &Model,
    number: usize,
    camera: &Camera,
    scene: Arc<Scene>,
) -> Result<Eye, ModelError> {
    let (body, pose) = description.camera_frame(camera)?;
    let (focal, center) = camera.intrinsics();
    let place = |name: String| model.body_names().iter().position(|other| *other == name);
    Ok(Eye {
        number,
        camera: sim_render::Camera {
            width: camera.width,
            height: camera.height,
            focal: focal.map(|pixels| pixels as f32),
            center: center.map(|pixels| pixels as f32),
            near: camera.near as f32,
            far: camera.far as f32,
        },
        body: body.map(|name| place(name).expect("links are bodies of the model")),
        frame: Frame::from(&pose),
        every: camera.every as u64,
        worlds: camera.worlds.clone().map(|mut worlds| {
            worlds.sort_unstable();
            worlds
        }),
        chance: Chance::new(number, camera),
        scene,
    })
}

//! Where images are in a frame: behind the arrays of the simulation.

use std::sync::Arc;

use sim_engine::workers::PARTS_PER_THREAD;
use sim_physics::arrays::{Field, Layout, Slot};
use sim_protocol::{ALIGNMENT, ROWS_MAX};

use super::fields::{ImageField, Plane};
use super::sight::Sight;
use crate::error::DaemonError;

/// The images of frames, laid out.
#[derive(Clone)]
pub(crate) struct Images {
    pub(super) seen: Option<Seen>,
    fields: Vec<ImageField>,
    arena_bytes: usize,
    /// Whether images are kept for later frames.
    pub(super) keeps: bool,
}

/// What images are drawn from.
#[derive(Clone)]
pub(super) struct Seen {
    pub(super) sight: Arc<Sight>,
    /// Where the simulation's arrays end [words].
    pub(super) words: usize,
    /// Poses of bodies.
    pub(super) bodies: Slot,
    /// Control frames since each world's reset.
    pub(super) steps: Slot,
    /// Statuses of worlds.
    pub(super) statuses: Slot,
}

impl Seen {
    /// Size of the poses of a world's bodies [bytes].
    pub(super) fn poses_bytes(&self) -> usize {
        self.bodies.bytes / self.bodies.shape[0]
    }
}

impl Images {
    /// No images.
    pub(crate) fn none(layout: &Layout) -> Images {
        Images {
            seen: None,
            fields: Vec::new(),
            arena_bytes: layout.bytes,
            keeps: true,
        }
    }

    /// The same, of frames that are not kept: each is drawn whole.
    pub(crate) fn unkept(self) -> Images {
        Images {
            keeps: false,
            ..self
        }
    }

    /// Images of frames with this layout, which has `body_q` where there are cameras.
    ///
    /// # Errors
    /// More fields than a frame has.
    pub(crate) fn new(sight: Option<Sight>, layout: &Layout) -> Result<Images, DaemonError> {
        let mut images = Images::none(layout);
        let Some(sight) = sight else {
            return Ok(images);
        };
        // observers get the state besides
        if layout.slots.len() + sight.fields.len() >= ROWS_MAX {
            return Err(DaemonError::Argument {
                argument: "fields",
                value: sight.fields[0].name.clone(),
                problem: format!("a frame has at most {} fields; ask for fewer", ROWS_MAX - 1),
            });
        }
        let slot = |field: Field| {
            let mut slots = layout.slots.iter();
            let slot = slots.find(|slot| slot.field == field);
            slot.expect("cameras need it").clone()
        };
        let steps = slot(Field::Step);
        for field in &sight.fields {
            let mut field = field.clone();
            field.shape[0] = steps.shape[0];
            field.offset = images.arena_bytes;
            images.arena_bytes = field
                .checked_bytes()
                .and_then(|bytes| {
                    field
                        .offset
                        .checked_add(bytes)?
                        .checked_next_multiple_of(ALIGNMENT)
                })
                .ok_or_else(|| DaemonError::Argument {
                    argument: "fields",
                    value: field.name.clone(),
                    problem: "images of all worlds exceed every memory; ask for fewer worlds"
                        .to_owned(),
                })?;
            images.fields.push(field);
        }
        images.seen = Some(Seen {
            sight: Arc::new(sight),
            words: layout.bytes / size_of::<u64>(),
            bodies: slot(Field::BodyQ),
            statuses: slot(Field::Status),
            steps,
        });
        Ok(images)
    }

    /// Refuses a camera that is to see worlds beyond these.
    ///
    /// # Errors
    /// [`DaemonError::Argument`] with the field and the world.
    pub(super) fn check_worlds(&self, worlds: usize) -> Result<(), DaemonError> {
        let eyes = self.seen.iter().flat_map(|seen| &seen.sight.eyes);
        for eye in eyes {
            let Some(last) = eye.last_world().filter(|&last| last >= worlds) else {
                continue;
            };
            let mine = self.fields.iter().find(|field| field.camera == eye.number);
            return Err(DaemonError::Argument {
                argument: "fields",
                value: mine.map_or(String::new(), |field| field.name.clone()),
                problem: format!(
                    "its camera sees world {last}, and the last world is {}; give it other worlds, or launch more",
                    worlds - 1
                ),
            });
        }
        Ok(())
    }

    /// Their fields.
    pub(crate) fn fields(&self) -> &[ImageField] {
        &self.fields
    }

    /// Names of what labels of segmentation stand for.
    pub(crate) fn segments(&self) -> &[String] {
        let seen = self.seen.as_ref();
        seen.map_or(&[], |seen| &seen.sight.segments)
    }

    /// Size of a frame's arrays, those of the simulation included [bytes].
    pub(crate) fn arena_bytes(&self) -> usize {
        self.arena_bytes
    }

    /// Whether a camera repeats images.
    pub(crate) fn repeat(&self) -> bool {
        let seen = self.seen.as_ref();
        seen.is_some_and(|seen| seen.sight.eyes.iter().any(|eye| eye.every > 1))
    }

    /// What cannot be seen, a sentence each.
    pub(crate) fn notes(&self) -> &[String] {
        let seen = self.seen.as_ref();
        seen.map_or(&[], |seen| &seen.sight.notes)
    }

    /// Memory that drawing takes besides on so many threads: the last images with the poses that they show, and depths of
    /// cameras without a field of them [bytes].
    pub(crate) fn memory_bytes(&self, threads: usize) -> u64 {
        let Some(seen) = &self.seen else { return 0 };
        let images = self.fields.iter().map(|field| field.bytes() as u64);
        let kept = match self.keeps {
            true => images.sum::<u64>() + seen.bodies.bytes as u64,
            false => 0,
        };
        let spare = spare_pixels(&seen.sight, &self.fields) * size_of::<f32>();
        kept.saturating_add((spare * parts(threads, seen.steps.shape[0])) as u64)
    }
}

/// How many parts of worlds threads draw.
pub(super) fn parts(threads: usize, worlds: usize) -> usize {
    match threads {
        1 => 1,
        _ => threads.saturating_mul(PARTS_PER_THREAD).min(worlds),
    }
}

/// Pixels of the largest image without a field of depths.
pub(super) fn spare_pixels(sight: &Sight, fields: &[ImageField]) -> usize {
    let has_depth = |number| {
        let mut fields = fields.iter();
        fields.any(|field| field.camera == number && field.plane == Plane::Depth)
    };
    let without = sight.eyes.iter().filter(|eye| !has_depth(eye.number));
    let pixels = without.map(|eye| eye.camera.width * eye.camera.height);
    pixels.max().unwrap_or(0)
}

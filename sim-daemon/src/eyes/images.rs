//! Where images are in a frame: behind the arrays of the simulation.

use std::sync::Arc;

use sim_physics::arrays::{Field, Layout, Slot};
use sim_protocol::{ALIGNMENT, ROWS_MAX};

use super::fields::ImageField;
use super::sight::Sight;
use crate::error::DaemonError;

/// The images of frames, laid out.
#[derive(Clone)]
pub(crate) struct Images {
    pub(super) seen: Option<Seen>,
    fields: Vec<ImageField>,
    arena_bytes: usize,
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
}

impl Images {
    /// No images.
    pub(crate) fn none(layout: &Layout) -> Images {
        Images {
            seen: None,
            fields: Vec::new(),
            arena_bytes: layout.bytes,
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
            images.arena_bytes = (field.offset + field.bytes()).next_multiple_of(ALIGNMENT);
            images.fields.push(field);
        }
        images.seen = Some(Seen {
            sight: Arc::new(sight),
            words: layout.bytes / size_of::<u64>(),
            bodies: slot(Field::BodyQ),
            steps,
        });
        Ok(images)
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

    /// Memory that drawing takes besides: the last images of cameras that do not draw in each frame [bytes].
    pub(crate) fn memory_bytes(&self) -> u64 {
        let Some(seen) = &self.seen else { return 0 };
        let repeats = seen.sight.eyes.iter().filter(|eye| eye.every > 1);
        let of_camera = |number| {
            self.fields
                .iter()
                .filter(move |field| field.camera == number)
        };
        let images = repeats.flat_map(|eye| of_camera(eye.number));
        images.map(|field| field.bytes() as u64).sum()
    }
}

//! Some worlds, which one thread draws.

use std::ops::Range;

use sim_render::{Frame, Image, Scratch};

use super::chance::Moment;
use super::fields::{ImageField, Plane};
use super::images::{Images, Seen, spare_pixels};
use super::memory::{Memory, State};
use super::sight::{Eye, Sight};

/// Some worlds, which one thread draws.
pub(super) struct Part {
    worlds: Range<usize>,
    /// Number of the first world of the simulation.
    first_world: usize,
    scratch: Scratch,
    /// Frames of a world's bodies.
    frames: Vec<Frame>,
    /// Depths of images without a field of depths.
    spare: Vec<f32>,
    repeats: Vec<Repeat>,
    /// What the frame before showed of each world; none before the first one.
    shown: Vec<Option<Moment>>,
    /// Poses of its bodies then, one world after the other.
    poses: Vec<u8>,
}

/// The last images of a camera, which later frames repeat.
struct Repeat {
    /// When each world's was drawn, of a camera that draws none in some frames; none before the first one, and where the
    /// next frame has a new one.
    drawn: Vec<Option<Moment>>,
    /// Images of each world, one after the other.
    bytes: Vec<u8>,
    of_world: usize,
}

impl Part {
    pub(super) fn new(
        seen: &Seen,
        images: &Images,
        worlds: Range<usize>,
        first_world: usize,
    ) -> Part {
        let (sight, fields) = (&seen.sight, images.fields());
        let kept = if images.keeps { worlds.len() } else { 0 };
        let repeats = sight.eyes.iter().map(|eye| {
            let seen = fields.iter().filter(|field| field.camera == eye.number);
            let of_world = seen.map(|field| field.bytes() / field.shape[0]).sum();
            Repeat {
                drawn: vec![None; if eye.every > 1 { kept } else { 0 }],
                bytes: vec![0; kept * of_world],
                of_world,
            }
        });
        Part {
            repeats: repeats.collect(),
            shown: vec![None; kept],
            poses: vec![0; kept * seen.poses_bytes()],
            worlds,
            first_world,
            scratch: Scratch::default(),
            frames: Vec::with_capacity(sight.segments.len()),
            spare: vec![0.0; spare_pixels(sight, fields)],
        }
    }

    /// Draws all images of the next frame, whatever its step.
    pub(super) fn forget(&mut self) {
        let repeats = self.repeats.iter_mut();
        repeats.for_each(|repeat| repeat.drawn.fill(None));
        self.shown.fill(None);
    }

    /// Draws the images of a frame. Where a world is as in the frame before, such as one that goes on while others are
    /// reset, its images are those of that frame.
    pub(super) fn draw(
        &mut self,
        sight: &Sight,
        fields: &[ImageField],
        state: &State,
        images: Memory,
        keeps: bool,
    ) {
        for world in self.worlds.clone() {
            let number = self.first_world + world;
            if !sight.eyes.iter().any(|eye| eye.sees(number)) {
                continue;
            }
            state.frames(world, &mut self.frames);
            let moment = state.moment(world);
            let place_in_part = world - self.worlds.start;
            let is_as_before = self.is_as_before(place_in_part, moment, state.poses(world), keeps);
            let eyes = sight.eyes.iter().enumerate();
            for (place, eye) in eyes.filter(|(_, eye)| eye.sees(number)) {
                let drawn = self.repeats[place].drawn.get_mut(place_in_part);
                let is_due = match &drawn {
                    Some(drawn) => drawn.is_none_or(|then| !moment.repeats(&then, eye.every)),
                    None => !is_as_before,
                };
                if is_due {
                    if keeps && let Some(drawn) = drawn {
                        *drawn = Some(moment);
                    }
                    self.draw_image(sight, eye, fields, (world, moment), images);
                    if !keeps {
                        continue;
                    }
                }
                let mine = fields.iter().filter(|field| field.camera == eye.number);
                self.repeats[place].exchange(
                    place_in_part,
                    is_due,
                    mine.map(|field| {
                        // SAFETY: this world is ours alone, and so are its rows, one after the other
                        unsafe { images.row::<u8>(field, world) }
                    }),
                );
            }
        }
    }

    /// Whether a frame shows a world as the last one that was kept. Notes what it shows if it is kept.
    fn is_as_before(&mut self, world: usize, moment: Moment, poses: &[u8], keeps: bool) -> bool {
        if self.shown.is_empty() {
            return false;
        }
        let known = &mut self.poses[world * poses.len()..][..poses.len()];
        let is_as_before = self.shown[world] == Some(moment) && known == poses;
        if keeps && !is_as_before {
            self.shown[world] = Some(moment);
            known.copy_from_slice(poses);
        }
        is_as_before
    }

    fn draw_image(
        &mut self,
        sight: &Sight,
        eye: &Eye,
        fields: &[ImageField],
        (world, moment): (usize, Moment),
        images: Memory,
    ) {
        let plane = |plane| {
            let mut fields = fields.iter();
            fields.find(|field| field.camera == eye.number && field.plane == plane)
        };
        let (depth, labels) = (plane(Plane::Depth), plane(Plane::Segmentation));
        let rgb = plane(Plane::Rgb);
        let frame = match eye.body {
            Some(body) => self.frames[body].then(&eye.frame),
            None => eye.frame,
        };
        let (frame, camera) = eye.chance.moved(&moment, &frame, &eye.camera);
        let pixels = eye.camera.width * eye.camera.height;
        // SAFETY: this world is ours alone, and its rows are apart
        let depths = depth.map(|field| unsafe { images.row(field, world) });
        let mut image = Image {
            depth: depths.unwrap_or_else(|| &mut self.spare[..pixels]),
            // SAFETY: as above
            labels: labels.map(|field| unsafe { images.row(field, world) }),
            // SAFETY: as above
            rgb: rgb.map(|field| unsafe { images.row(field, world) }),
        };
        let (scratch, frames) = (&mut self.scratch, &self.frames);
        (sight.draw)(&eye.scene, frames, &frame, &camera, scratch, &mut image);
        if depth.is_some() {
            eye.chance.add_noise(&moment, &camera, image.depth);
        }
    }
}

impl Repeat {
    /// Keeps the images of a world if they are new, else repeats the last ones.
    fn exchange<'a>(
        &mut self,
        world: usize,
        are_new: bool,
        images: impl Iterator<Item = &'a mut [u8]>,
    ) {
        let mut rest = &mut self.bytes[world * self.of_world..][..self.of_world];
        for image in images {
            let (kept, others) = rest.split_at_mut(image.len());
            rest = others;
            match are_new {
                true => kept.copy_from_slice(image),
                false => image.copy_from_slice(kept),
            }
        }
    }
}

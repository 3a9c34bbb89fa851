//! The arrays of a frame, as those who draw see them.

use bytemuck::Pod;
use sim_engine::random::Episode;
use sim_physics::arrays::{Dtype, Slot, status};
use sim_render::Frame;

use super::chance::Moment;
use super::fields::ImageField;

/// Numbers of a body's pose: position and quaternion.
const POSE: usize = 7;

/// The simulation's arrays of a frame.
pub(super) struct State<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) bodies: &'a Slot,
    pub(super) steps: &'a Slot,
    pub(super) episodes: &'a [Episode],
    /// Statuses of worlds, where these are reset after a fault.
    pub(super) faults: Option<&'a Slot>,
}

impl State<'_> {
    /// Numbers of a world in an array.
    fn row<T: Pod>(&self, slot: &Slot, world: usize) -> &[T] {
        let bytes = slot.bytes / slot.shape[0];
        bytemuck::cast_slice(&self.bytes[slot.offset + world * bytes..][..bytes])
    }

    fn steps(&self, world: usize) -> u64 {
        self.row::<u64>(self.steps, world)[0]
    }

    /// What a world's draws depend on.
    pub(super) fn moment(&self, world: usize) -> Moment {
        let mut episode = self.episodes.get(world).copied().unwrap_or_default();
        let bits = |slot| self.row::<u32>(slot, world)[0];
        if self.faults.map_or(0, bits) & status::FROZEN != 0 {
            // the frame that shows a fault is the last one of its episode, after which the next one was counted
            episode.episode = episode.episode.wrapping_sub(1);
        }
        Moment {
            episode,
            step: self.steps(world),
        }
    }

    /// The poses of a world's bodies, as they lie in the frame.
    pub(super) fn poses(&self, world: usize) -> &[u8] {
        self.row(self.bodies, world)
    }

    /// Frames of a world's bodies.
    pub(super) fn frames(&self, world: usize, to: &mut Vec<Frame>) {
        to.clear();
        match self.bodies.dtype {
            Dtype::F64 => {
                let poses = self.row::<f64>(self.bodies, world).chunks_exact(POSE);
                to.extend(poses.map(|pose| frame(&|k| pose[k] as f32)));
            }
            _ => {
                let poses = self.row::<f32>(self.bodies, world).chunks_exact(POSE);
                to.extend(poses.map(|pose| frame(&|k| pose[k])));
            }
        }
    }
}

fn frame(number: &impl Fn(usize) -> f32) -> Frame {
    let pos = [number(0), number(1), number(2)];
    Frame::new(pos, [number(3), number(4), number(5), number(6)])
}

/// The images of a frame, shared by the threads that draw them.
#[derive(Clone, Copy)]
pub(super) struct Memory {
    start: *mut u8,
    bytes: usize,
    /// Where it begins in the arena [bytes].
    offset: usize,
}

// SAFETY: threads write the rows of their own worlds only (contract of `row`).
unsafe impl Send for Memory {}
// SAFETY: as above.
unsafe impl Sync for Memory {}

impl Memory {
    /// The memory behind the simulation's arrays, which begins there in the arena [bytes].
    pub(super) fn new(images: &mut [u64], offset: usize) -> Memory {
        Memory {
            start: images.as_mut_ptr().cast(),
            bytes: size_of_val(images),
            offset,
        }
    }

    /// The image of a world.
    ///
    /// # Safety
    /// The arena lives, and nobody else uses this row.
    pub(super) unsafe fn row<'a, T: Pod>(self, field: &ImageField, world: usize) -> &'a mut [T] {
        let of_world = field.bytes() / field.shape[0];
        let first = field.offset - self.offset + world * of_world;
        let count = of_world / size_of::<T>();
        assert!(size_of::<T>() == field.dtype.size() || size_of::<T>() == 1);
        assert!(world < field.shape[0] && first + of_world <= self.bytes);
        // SAFETY: inside the arena (asserted), aligned since offsets are multiples of 64 and arenas of 8; alive and
        // exclusive by contract
        unsafe { std::slice::from_raw_parts_mut(self.start.add(first).cast(), count) }
    }
}

//! Records of a snapshot: worlds out of lanes and back. They do not depend on lanes or threads.

use super::chunk::{Chunk, Job};
use crate::backend::COUNTERS;
use sim_physics::arrays::Array;
use sim_physics::lane::{Lane, Real};
use std::array;

impl<F: Lane> Job<F> {
    /// Scalars of a world's state and commands.
    pub fn numbers(&self) -> usize {
        self.shape.total()
    }

    fn record(&self) -> usize {
        COUNTERS + self.numbers() * size_of::<F::Real>()
    }
}

impl<F: Lane> Chunk<F> {
    /// Writes the chunk's worlds into the records of all.
    pub fn save(&self, job: &Job<F>, records: &mut [u8]) {
        let shape = job.shape;
        let records = records.chunks_exact_mut(job.record());
        let chunk_records = records.skip(self.worlds.start).take(self.worlds.len());
        for (world, record) in chunk_records.enumerate() {
            let (counters, numbers) = record.split_at_mut(COUNTERS);
            counters[..8].copy_from_slice(&self.steps[world].to_le_bytes());
            counters[8..12].copy_from_slice(&self.status[world].to_le_bytes());
            counters[12..16].copy_from_slice(&self.left_out[world].to_le_bytes());
            counters[16..24].copy_from_slice(&self.seeds[world].to_le_bytes());
            counters[24..].copy_from_slice(&self.episodes[world].to_le_bytes());
            // of a scene in which nothing moves, there are none
            let first = self.place(shape, world, Array::JointQd, 0);
            let state = self.state.iter().skip(first).step_by(F::WIDTH);
            let to = numbers.chunks_exact_mut(size_of::<F::Real>());
            for (to, x) in to.zip(state) {
                if F::Real::DOUBLE {
                    to.copy_from_slice(&x.to_f64().to_le_bytes());
                } else {
                    to.copy_from_slice(&(x.to_f64() as f32).to_le_bytes());
                }
            }
        }
    }

    /// Sets the chunk's worlds of the mask (none = all) to their records, or to that of one world.
    pub fn restore(
        &mut self,
        job: &Job<F>,
        records: &[u8],
        mask: Option<&[bool]>,
        from_world: Option<usize>,
    ) {
        let shape = job.shape;
        for world in 0..self.worlds.len() {
            let outside = self.worlds.start + world;
            if mask.is_some_and(|mask| !mask[outside]) {
                continue;
            }
            let first = from_world.unwrap_or(outside) * job.record();
            let (counters, numbers) = records[first..first + job.record()].split_at(COUNTERS);
            self.steps[world] = u64::from_le_bytes(array::from_fn(|i| counters[i]));
            self.status[world] = u32::from_le_bytes(array::from_fn(|i| counters[8 + i]));
            self.left_out[world] = u32::from_le_bytes(array::from_fn(|i| counters[12 + i]));
            self.seeds[world] = u64::from_le_bytes(array::from_fn(|i| counters[16 + i]));
            self.episodes[world] = u32::from_le_bytes(array::from_fn(|i| counters[24 + i]));
            let first = self.place(shape, world, Array::JointQd, 0);
            let state = self.state.iter_mut().skip(first).step_by(F::WIDTH);
            for (x, from) in state.zip(numbers.chunks_exact(size_of::<F::Real>())) {
                *x = if F::Real::DOUBLE {
                    F::Real::from_f64(f64::from_le_bytes(array::from_fn(|i| from[i])))
                } else {
                    let from = f32::from_le_bytes(array::from_fn(|i| from[i]));
                    F::Real::from_f64(f64::from(from))
                };
            }
        }
    }
}

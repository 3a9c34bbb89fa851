//! What the host keeps of the worlds: randomness, parameters, and the counters of the last frame.

use crate::backend::Frozen;

pub(super) struct Host {
    /// Seeds of what is drawn for each world.
    pub seeds: Vec<u64>,
    /// Resets of each world since it got its seed.
    pub episodes: Vec<u32>,
    /// Control frames since the reset of each world, as the last frame showed them.
    pub steps: Vec<u64>,
    /// As the last frame showed it, or as it was set since.
    pub status: Vec<u32>,
    /// Parameters that vary, world by world.
    params: Vec<f32>,
    /// How many a world has.
    varying: usize,
    /// Control frames so far.
    pub frames: u64,
    /// Worlds that were frozen since somebody asked.
    pub frozen: Frozen,
}

impl Host {
    pub fn new(worlds: usize, varying: usize) -> Host {
        Host {
            seeds: vec![0; worlds],
            episodes: vec![0; worlds],
            steps: vec![0; worlds],
            status: vec![0; worlds],
            params: vec![0.0; worlds * varying],
            varying,
            frames: 0,
            frozen: Frozen::default(),
        }
    }

    /// Gives every world the same parameters.
    pub fn fill_params(&mut self, params: &[f32]) {
        for own in self.params.chunks_exact_mut(self.varying.max(1)) {
            own.copy_from_slice(params);
        }
    }

    /// The parameters of a world.
    pub fn params(&self, world: usize) -> &[f32] {
        &self.params[world * self.varying..][..self.varying]
    }

    /// The same, to be changed.
    pub fn params_mut(&mut self, world: usize) -> &mut [f32] {
        &mut self.params[world * self.varying..][..self.varying]
    }
}

/// Makes a quaternion unit; one that is so to the last bits stays as it was written.
pub(super) fn normalize(quaternion: &mut [f32]) {
    let square: f64 = quaternion.iter().map(|x| f64::from(*x).powi(2)).sum();
    if (square - 1.0).abs() > 4.0 * f64::from(f32::EPSILON) {
        for x in quaternion {
            *x = (f64::from(*x) / square.sqrt()) as f32;
        }
    }
}

/// An array of a frame.
pub(super) fn array<T: bytemuck::Pod>(arena: &mut [u64], offset: usize, size: usize) -> &mut [T] {
    bytemuck::cast_slice_mut(&mut bytes(arena)[offset..offset + size])
}

/// A frame as bytes.
pub(super) fn bytes(arena: &mut [u64]) -> &mut [u8] {
    bytemuck::cast_slice_mut(arena)
}

/// Bytes that are aligned, as words.
pub(super) fn words(bytes: &[u8]) -> &[u32] {
    bytemuck::cast_slice(bytes)
}

//! Mirror of the worlds in host memory: seeds, episodes, parameters, and the counters of the last frame.
//!
//! Starts and noise are drawn from it on the host, by the functions of the CPU backend, and sent as rows. So a reset, a write or a
//! snapshot has the CPU's bits, and a snapshot of one backend runs on the other.

use crate::backend::Frozen;
use std::ops::Range;

pub(super) struct HostMirror {
    /// Seed of each world.
    pub seeds: Vec<u64>,
    /// Resets of each world since it got its seed.
    pub episodes: Vec<u32>,
    /// Control frames since the reset of each world, as of the last frame.
    pub steps: Vec<u64>,
    /// Status of each world, as of the last frame or as set since.
    pub status: Vec<u32>,
    /// Parameters that vary, `(worlds, varying)`.
    params: Vec<f32>,
    /// Parameters per world.
    varying: usize,
    /// Control frames so far.
    pub frames: u64,
    /// Worlds that were frozen since the last report.
    pub frozen: Frozen,
}

impl HostMirror {
    pub fn new(worlds: usize, varying: usize) -> HostMirror {
        HostMirror {
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
        for world_params in self.params.chunks_exact_mut(self.varying.max(1)) {
            world_params.copy_from_slice(params);
        }
    }

    /// The parameters of a world.
    pub fn params(&self, world: usize) -> &[f32] {
        &self.params[world * self.varying..][..self.varying]
    }

    /// The parameters of a world, mutable.
    pub fn params_mut(&mut self, world: usize) -> &mut [f32] {
        &mut self.params[world * self.varying..][..self.varying]
    }

    /// Sets columns of the parameters of all worlds, `(worlds, columns)`.
    pub fn set_params(&mut self, columns: &Range<usize>, values: &[f32]) {
        let rows = values.chunks_exact(columns.len().max(1));
        for (world_params, row) in self.params.chunks_exact_mut(self.varying.max(1)).zip(rows) {
            world_params[columns.clone()].copy_from_slice(row);
        }
    }
}

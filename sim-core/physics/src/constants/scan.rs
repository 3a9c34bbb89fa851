//! Height scans: grids of vertical rays under frames, as physics code reads them.

use super::recast::{Recast, recast};
use super::site::Mount;

recast! {
    /// A grid of vertical rays under a frame, turned with the frame about the vertical alone.
    #[derive(Clone, Debug)]
    pub struct HeightScan<R> {
        /// The frame.
        pub mount: Mount<R>,
        /// Rays along the frame's x and y.
        pub counts: [usize; 2],
        /// Distances between neighbouring rays [m].
        pub spacing: [R; 2],
        /// The distance where the ground is farther away, or where there is none [m].
        pub reach: R,
        /// Its first ray among all.
        pub first: usize,
        /// What it sees: places of planes and height fields among the solids, and of fields in their table.
        pub ground: Vec<(usize, usize)>,
    }
}

impl<R> HeightScan<R> {
    /// Its rays.
    pub fn rays(&self) -> usize {
        self.counts[0] * self.counts[1]
    }
}

//! Scratch tables in which features of two shapes are clipped against each other.

use super::hull::CORNERS_MAX;
use crate::lane::Table;

/// Scratch tables of a pair; see `step/collide/manifold/clip.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Corners of both faces across and along the normal (2 × 3), and the second's edges as half-planes (3).
    pub corners: Table,
    /// Candidates of each corner: the ends of the clipped edge of the first, a corner of the second (3 × 3).
    pub candidates: Table,
    /// Edges of a hull that may make the nearest face of the Minkowski difference with one of another hull.
    pub edges: Table,
}

impl Cut {
    /// Rows of `corners`, and scalars per row.
    pub const CORNERS: [usize; 2] = [CORNERS_MAX + 1, 9];
    /// Rows of `candidates`, and scalars per row.
    pub const CANDIDATES: [usize; 2] = [CORNERS_MAX + 1, 9];
    /// Rows of `edges`, and scalars per row. A hull of 64 vertices has at most 186 edges; those that do not fit are left out.
    pub const EDGES: [usize; 2] = [48, 1];
}

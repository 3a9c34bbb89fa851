//! Scratch tables in which faces of two shapes are cut against each other.

use super::hull::CORNERS_MAX;
use crate::lane::Table;

/// Scratch tables of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Corners of both faces across and along the normal (2 × 3), and the second's edges as half-planes (3).
    pub corners: Table,
    /// Candidates: the ends of an edge of the first that is cut, a corner of the second (3 × 3).
    pub candidates: Table,
    /// Edges of a hull that may cross one of another where they are least deep.
    pub edges: Table,
}

impl Cut {
    /// Rows and numbers a row of `corners`.
    pub const CORNERS: [usize; 2] = [CORNERS_MAX + 1, 9];
    /// Rows and numbers a row of `candidates`.
    pub const CANDIDATES: [usize; 2] = [CORNERS_MAX + 1, 9];
    /// Rows and numbers a row of `edges`. A hull of 64 vertices has at most 186 edges; of more than this many the rest
    /// is left out.
    pub const EDGES: [usize; 2] = [48, 1];
}

//! Where the height fields of a model are in its tables.

use crate::lane::Fixed;

/// Contacts that a pair of a height field and another shape keeps. Of more, these span most; see `step/collide/height_field/fields.rs`.
pub const FIELD_CONTACTS: usize = 8;

/// Most candidates of such a pair, before that choice, and most prisms that it looks at closely: later ones are left out.
pub const FIELD_CANDIDATES: usize = 256;

/// Cells along each side of a tile, of which `ceilings` has the highest elevation.
pub const TILE: usize = 2;

/// Where the height fields of a model are in its tables.
///
/// A field is a grid of elevations over the x and y axes of its frame, in rows along x. Two triangles lie over each cell: one on
/// either side of the diagonal from its lowest corner to its highest one, along x and y. Below each is a prism, down to the
/// field's bottom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldTables {
    /// Elevations of all fields, row after row. `(samples, 1)` [m]
    pub heights: Fixed,
    /// Highest elevation around each tile of cells, as far as any shape of the field's pairs reaches. `(tiles, 1)` [m]
    pub ceilings: Fixed,
    /// Highest corner of each cell, at the place of its first corner in `heights`. `(samples, 1)` [m]
    pub tops: Fixed,
    /// Of each field; see [`field`]. `(fields, field::LEN)`
    pub sizes: Fixed,
    /// Of each pair, the cells that its second shape may lie over, 0 of pairs without a field. Indices. `(pairs, 1)`
    pub cells: Fixed,
    /// The most of any pair.
    pub cells_max: usize,
}

/// Places of the scalars of a field in `sizes`.
pub mod field {
    /// The first sample, from the world's origin, in the field's axes; of z, where elevations count from (3) [m].
    pub const BASE: usize = 0;
    /// Edges of a cell (2) [m].
    pub const CELL: usize = 3;
    /// 1 over the edges of a cell (2) [1/m].
    pub const INVERSE: usize = 5;
    /// Cells along x and y (2).
    pub const CELLS: usize = 7;
    /// Its first sample in `heights`.
    pub const FIRST: usize = 9;
    /// Its bottom, counted as elevations are [m].
    pub const BOTTOM: usize = 10;
    /// A bound of all coordinates of its samples [m].
    pub const EXTENT: usize = 11;
    /// Its first tile in `ceilings`.
    pub const TILES_FIRST: usize = 12;
    /// Its tiles along x.
    pub const TILES: usize = 13;
    /// Unit normal of the diagonals of cells, to the right seen along them (2) [–].
    pub const ACROSS: usize = 14;
    /// 1 over the squared length of a diagonal, seen from above [1/m²].
    pub const DIAGONAL: usize = 16;
    /// Scalars.
    pub const LEN: usize = 17;
}

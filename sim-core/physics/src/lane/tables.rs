//! Tables: of scratch memory, with a value per world, and of the model, the same for all.

/// A table in scratch memory: `rows` rows of `stride` scalars, each with a value per world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Table {
    /// First scalar of row 0.
    pub base: usize,
    /// Scalars per row.
    pub stride: usize,
    /// Rows that fit.
    pub rows: usize,
}

/// A table of the model: the same for every world, read at a run-time index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Fixed {
    /// First scalar of row 0.
    pub base: usize,
    /// Scalars per row.
    pub stride: usize,
    /// Rows.
    pub rows: usize,
}

/// The tables of a model, one after another: scalars, and indices into tables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables<R> {
    /// For [`Cx::constant`](super::Cx::constant) and [`Cx::pick`](super::Cx::pick).
    pub numbers: Vec<R>,
    /// For [`Cx::index`](super::Cx::index).
    pub indices: Vec<u32>,
}

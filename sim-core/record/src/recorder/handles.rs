//! Handles that the recorder gives to physics code: scalars, masks, variables, indices, rows, lists, blocks and loops.

use crate::error::Place;
use crate::ir::tree::{Bounds, Cell, Operand, Row, Statement};
use sim_physics::lane::Table;

/// Where a value, variable, list, index or row was made: a block of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Home {
    /// 0: a constant made while nothing was recorded, good everywhere.
    pub(crate) recording: u32,
    pub(crate) block: u32,
}

/// The home of constants that were made outside of any recording.
pub(crate) const NOWHERE: Home = Home {
    recording: 0,
    block: 0,
};

/// A scalar of a world, recorded instead of computed.
///
/// It may be used while the block in which it was made is open, on the thread that records.
#[derive(Clone, Copy, Debug)]
pub struct Recorded {
    pub(crate) operand: Operand,
    pub(crate) home: Home,
}

/// A mask of a world, recorded instead of computed.
#[derive(Clone, Copy, Debug)]
pub struct RecordedMask(pub(crate) Recorded);

/// A variable of a recording.
#[derive(Clone, Copy, Debug)]
pub struct RecordedVariable {
    pub(crate) name: u32,
    pub(crate) home: Home,
}

/// Whose rows a table holds, or a loop runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// The list with this name.
    List(u32),
    /// The lists whose lengths this table keeps: which of them is known only at run time.
    Kept(Table),
}

/// A constant index, one read from a table, or the index of an open loop.
#[derive(Clone, Copy, Debug)]
pub struct RecordedIndex {
    pub(crate) row: Row,
    /// Largest value.
    pub(crate) max: usize,
    /// Whose rows the loop runs over.
    pub(crate) owner: Option<Owner>,
    pub(crate) home: Home,
}

/// A fresh row of a list.
#[derive(Clone, Copy, Debug)]
pub struct RecordedRow {
    pub(crate) row: Row,
    /// Past the largest value.
    pub(crate) end: usize,
    /// Name of the list's handle.
    pub(crate) list: u32,
    pub(crate) owner: Owner,
    pub(crate) home: Home,
}

/// A list of rows.
#[derive(Debug)]
pub struct RecordedList {
    pub(crate) name: u32,
    pub(crate) extent: Extent,
    pub(crate) home: Home,
}

/// Where the rows of a list lie, and its length.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Extent {
    /// From row 0 on; the length goes by the list's name.
    Own {
        capacity: usize,
    },
    Kept(Kept),
}

/// A list in scratch memory: rows `first..first + capacity`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kept {
    pub count: Cell,
    pub first: Row,
    pub capacity: Row,
    /// Largest capacity.
    pub capacity_max: usize,
    /// Past the largest row.
    pub end: usize,
}

/// An open block, to be closed by [`sim_physics::lane::Cx::leave`]; nothing if the body is skipped.
#[derive(Debug)]
pub struct RecordedBlock(pub(crate) Option<OpenBlock>);

#[derive(Debug)]
pub(crate) struct OpenBlock {
    pub mask: Operand,
    pub depth: usize,
    pub opened: Opened,
}

/// What opened a block.
#[derive(Debug)]
pub(crate) enum Opened {
    When,
    /// A push to a list that counts by its name.
    Push {
        list: u32,
        capacity: usize,
        row: u32,
    },
    /// A push to a kept list; inside its block is another for the worlds where the row fits, if there can be any.
    Kept {
        fits: Option<Operand>,
    },
}

/// An open loop; nothing once it has ended.
#[derive(Debug)]
pub struct RecordedLoop(pub(crate) Option<OpenLoop>);

/// How many values and names there were at some point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counters {
    pub values: u32,
    pub names: u32,
}

/// A loop that is being recorded.
#[derive(Debug)]
pub(crate) struct OpenLoop {
    pub block: &'static str,
    pub index: u32,
    pub bounds: Bounds,
    /// Past the largest index.
    pub end: usize,
    /// Whose rows the loop runs over.
    pub owner: Option<Owner>,
    pub depth: usize,
    pub opened: Place,
    pub progress: Progress,
}

/// Iterations of a loop that were recorded.
#[derive(Debug)]
pub(crate) enum Progress {
    Start,
    First {
        before: Counters,
    },
    Second {
        before: Counters,
        first: Vec<Statement>,
        between: Counters,
    },
}

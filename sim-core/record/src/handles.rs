//! What the recording machine hands to a text: variables, indices, rows, lists, blocks and loops.

use super::loops::OpenLoop;
use super::state::Home;
use super::tree::{Cell, Operand, Row};
use sim_physics::lane::Table;

/// A variable of a recording.
#[derive(Clone, Copy, Debug)]
pub struct RecordedVariable {
    pub(super) name: u32,
    pub(super) home: Home,
}

/// Whose rows a table holds, or a loop runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// The list with this name.
    List(u32),
    /// The lists whose lengths this table keeps: which of them is known only at run time.
    Kept(Table),
}

/// A constant index, one read from a table, or the index of an open loop.
#[derive(Clone, Copy, Debug)]
pub struct RecordedIndex {
    pub(super) row: Row,
    /// Largest value.
    pub(super) max: usize,
    /// Whose rows the loop runs over.
    pub(super) owner: Option<Owner>,
    pub(super) home: Home,
}

/// A fresh row of a list.
#[derive(Clone, Copy, Debug)]
pub struct RecordedRow {
    pub(super) row: Row,
    /// Past the largest value.
    pub(super) end: usize,
    /// Name of the list's handle.
    pub(super) list: u32,
    pub(super) owner: Owner,
    pub(super) home: Home,
}

/// A list of rows.
#[derive(Debug)]
pub struct RecordedList {
    pub(super) name: u32,
    pub(super) extent: Extent,
    pub(super) home: Home,
}

/// Where the rows of a list lie, and its length.
#[derive(Clone, Copy, Debug)]
pub(super) enum Extent {
    /// From row 0 on; the length goes by the list's name.
    Own {
        capacity: usize,
    },
    Kept(Kept),
}

/// A list in scratch memory: rows `first..first + capacity`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept {
    pub count: Cell,
    pub first: Row,
    pub capacity: Row,
    /// Largest capacity.
    pub capacity_max: usize,
    /// Past the largest row.
    pub end: usize,
}

/// An open block, to be closed by [`sim_physics::lane::Cx::leave`]; nothing if the text skips its body.
#[derive(Debug)]
pub struct RecordedBlock(pub(super) Option<OpenBlock>);

#[derive(Debug)]
pub(super) struct OpenBlock {
    pub mask: Operand,
    pub depth: usize,
    pub opened: Opened,
}

/// What opened a block.
#[derive(Debug)]
pub(super) enum Opened {
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
pub struct RecordedLoop(pub(super) Option<OpenLoop>);

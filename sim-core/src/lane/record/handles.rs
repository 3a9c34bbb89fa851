//! What the recording machine hands to a text: variables, indices, rows, lists, blocks and loops.

use super::loops::OpenLoop;
use super::state::Home;
use super::tree::{Operand, Row};

/// A variable of a recording.
#[derive(Clone, Copy, Debug)]
pub struct RecordedVariable {
    pub(super) name: u32,
    pub(super) home: Home,
}

/// A constant index, or the index of an open loop.
#[derive(Clone, Copy, Debug)]
pub struct RecordedIndex {
    pub(super) row: Row,
    /// Largest value.
    pub(super) max: usize,
    /// The list that the loop runs over.
    pub(super) list: Option<u32>,
    pub(super) home: Home,
}

/// A fresh row of a list.
#[derive(Clone, Copy, Debug)]
pub struct RecordedRow {
    pub(super) name: u32,
    pub(super) list: u32,
    pub(super) capacity: usize,
    pub(super) home: Home,
}

/// A list of rows.
#[derive(Debug)]
pub struct RecordedList {
    pub(super) name: u32,
    pub(super) capacity: usize,
    pub(super) home: Home,
}

/// An open block, to be closed by [`crate::lane::Cx::leave`]; nothing if the text skips its body.
#[derive(Debug)]
pub struct RecordedBlock(pub(super) Option<OpenBlock>);

#[derive(Debug)]
pub(super) struct OpenBlock {
    pub mask: Operand,
    /// The fresh row, of a push.
    pub row: Option<RecordedRow>,
    pub depth: usize,
}

/// An open loop; nothing once it has ended.
#[derive(Debug)]
pub struct RecordedLoop(pub(super) Option<OpenLoop>);

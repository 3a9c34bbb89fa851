//! What physics code must not do if it is to be recorded.

use sim_physics::lane::{Fixed, Table};
use std::panic::Location;

/// The deepest nesting of loops: each body is recorded twice, so recording takes time in 2^depth.
pub const MAX_NESTING: usize = 5;

/// Location in the physics code.
pub(super) type Place = &'static Location<'static>;

/// Physics code that cannot be recorded, and the location of the first mistake.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}:{line}: {misuse}")]
pub struct RecordError {
    /// Source file.
    pub file: &'static str,
    /// Line in it, from 1.
    pub line: u32,
    /// The mistake.
    pub misuse: Misuse,
}

impl RecordError {
    pub(super) fn new(misuse: Misuse, place: Place) -> RecordError {
        RecordError {
            file: place.file(),
            line: place.line(),
            misuse,
        }
    }
}

/// Ways to write physics code that would mean something else on a GPU.
///
/// `block` is the macro that opened the block in question.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Misuse {
    /// A value is used after the block in which it was made.
    #[error(
        "a value made inside a `{block}` is used after it; carry it out in a variable: \
         `cx.var` before, `cx.set` inside, `cx.get` after"
    )]
    ValueLeaves {
        /// The block that it left.
        block: &'static str,
    },
    /// A value is used in the iteration after the one in which it was made.
    #[error(
        "a value made in one iteration of a `{block}` is used in the next; carry it over in a \
         variable: `cx.var` before the loop, `cx.set` and `cx.get` inside"
    )]
    NextIteration {
        /// The loop.
        block: &'static str,
    },
    /// A constant differs between the first two iterations of a loop.
    #[error(
        "a constant changes from one iteration of a `{block}` to the next: {first:?}, then {second:?}; \
         make it a variable: `cx.var` before the loop, `cx.set` and `cx.get` inside"
    )]
    ConstantChanges {
        /// The loop.
        block: &'static str,
        /// The constant in the first iteration.
        first: f32,
        /// The constant in the second iteration.
        second: f32,
    },
    /// The first two iterations of a loop do different things.
    #[error(
        "the first two iterations of a `{block}` do different things; no native variable that changes \
         from one to the next may decide or enter what its body does"
    )]
    IterationsDiffer {
        /// The loop.
        block: &'static str,
    },
    /// A block was left without reaching its end.
    #[error(
        "the `{block}` that starts here was left by `break`, `continue` or `return`; end a loop \
         with `break_if!`, and let the other blocks reach their end"
    )]
    LeftOpen {
        /// The block that was left.
        block: &'static str,
    },
    /// `break_if!` somewhere else than directly in the body of a loop.
    #[error(
        "`break_if!` inside a `{block}`; it works only at the level of a loop's body: keep the \
         mask in a variable, close the block, then break"
    )]
    BreakInBlock {
        /// The block that is open.
        block: &'static str,
    },
    /// A row of one list is used as if it were one of another.
    #[error(
        "a row of one list is used under another; use a row only in its own list's `push!` and a \
         table only in loops over the list that filled it"
    )]
    RowOfAnotherList,
    /// A fresh row is used after the block that was opened for it.
    #[error("a row is used after its `push!` block closed; fill it inside the block")]
    RowAfterBlock,
    /// A variable, list or index is used after the block in which it was made.
    #[error("a {what} made inside a `{block}` is used after it; make it before the block")]
    Closed {
        /// Variable, list or index.
        what: &'static str,
        /// The block that has closed.
        block: &'static str,
    },
    /// Too many loops inside one another.
    #[error(
        "loops are nested deeper than {}, the limit, since every body is recorded twice; \
         unroll one or split the code into two stages",
        MAX_NESTING
    )]
    TooDeep,
    /// A cell outside of its table.
    #[error("row {row}, number {number} lies outside of {table:?}; enlarge the table")]
    OutsideTable {
        /// The table.
        table: Table,
        /// The largest row reached.
        row: usize,
        /// Column.
        number: usize,
    },
    /// An entry outside of its table of the model.
    #[error("row {row}, number {number} lies outside of {table:?} of the model")]
    OutsideFixed {
        /// The table.
        table: Fixed,
        /// The largest row reached.
        row: usize,
        /// Column.
        number: usize,
    },
    /// A constant that a program cannot hold.
    #[error("a constant here is not a number (0/0, ∞ - ∞ or the like); mend the model's constants")]
    NotANumber,
    /// A value, variable, list or row of another recording.
    #[error("a {what} of another recording is used; make it inside the code that uses it")]
    OtherRecording {
        /// Value, variable, list, index or row.
        what: &'static str,
    },
}

//! The intermediate representation: values in the order of computation, and statements in blocks.

use sim_physics::lane::{Fixed, Table};

/// What an operation reads: a constant, or a value computed before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operand {
    /// Bits of an `f32`, so that it can be compared and hashed.
    Constant(u32),
    Truth(bool),
    /// Number of the value in [`crate::Recording::values`].
    Value(u32),
}

impl Operand {
    /// A constant. Negative zero becomes zero, so that equal constants are the same constant.
    pub(crate) fn number(x: f32) -> Operand {
        Operand::Constant((x + 0.0).to_bits())
    }

    /// The constant that this is, if it is one.
    pub(crate) fn constant(self) -> Option<f32> {
        match self {
            Operand::Constant(bits) => Some(f32::from_bits(bits)),
            _ => None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Unary {
    Neg,
    Sqrt,
    Abs,
    Round,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Min,
    Max,
    Lt,
    And,
    Or,
}

/// How a value was computed. Variables, lists, loop indices and rows share one numbering: `name`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Op {
    Input(u32),
    /// A variable's value at this point.
    Get(u32),
    /// A scalar in scratch memory at this point.
    Load(Cell),
    /// Rows pushed to a list up to this point.
    Count(u32),
    /// A scalar in scratch memory at this point, in a column behind the cell's: an integer.
    LoadAt(Cell, Operand),
    /// Number of this lane of the world.
    Lane,
    /// The value of a given lane.
    FromLane(Operand, usize),
    /// The value of the lane whose number differs in one bit.
    AcrossLanes(Operand, usize),
    /// A value that is the same in all lanes, of operations in which each had another.
    Alike(Operand),
    Unary(Unary, Operand),
    Binary(Binary, Operand, Operand),
    /// `a * b + c`, rounded once.
    Fma(Operand, Operand, Operand),
    /// Mask, value where it holds, value where it does not.
    Select(Operand, Operand, Operand),
    /// An index as a scalar.
    Number(Row),
    /// An entry of a table of the model.
    Constant(Entry),
    /// An entry of a table of the model, in a row that is an integer and in range.
    Pick {
        table: Fixed,
        row: Operand,
        number: usize,
    },
    /// An index of an index table of the model, below `end`. The value is an index.
    Index {
        entry: Entry,
        end: usize,
    },
    /// An index plus an integer. The value is an index.
    After(Row, Operand),
    /// Four scalars in scratch memory at this point. The value is a vector.
    Quad(Quad),
    /// A component of a vector.
    Part(u32, usize),
}

impl Op {
    /// Calls `f` with every operand.
    pub(crate) fn each_operand(&self, mut f: impl FnMut(Operand)) {
        match *self {
            Op::Input(_) | Op::Get(_) | Op::Count(_) | Op::Lane => {}
            Op::Load(cell) => cell.row.each_operand(f),
            Op::LoadAt(cell, column) => {
                cell.row.each_operand(&mut f);
                f(column);
            }
            Op::FromLane(a, _) | Op::AcrossLanes(a, _) | Op::Alike(a) => f(a),
            Op::Quad(quad) => quad.row.each_operand(f),
            Op::Part(four, _) => f(Operand::Value(four)),
            Op::Number(row) => row.each_operand(f),
            Op::Constant(entry) | Op::Index { entry, .. } => entry.row.each_operand(f),
            Op::Unary(_, a) | Op::Pick { row: a, .. } => f(a),
            Op::After(row, a) => {
                row.each_operand(&mut f);
                f(a);
            }
            Op::Binary(_, a, b) => {
                f(a);
                f(b);
            }
            Op::Fma(a, b, c) | Op::Select(a, b, c) => {
                f(a);
                f(b);
                f(c);
            }
        }
    }

    /// Is it written where it is used, instead of in a statement of its own?
    pub(crate) fn is_inline(&self) -> bool {
        matches!(
            self,
            Op::Unary(Unary::Neg | Unary::Not, _) | Op::Input(_) | Op::Part(..) | Op::Alike(_)
        )
    }
}

/// An index: of a row of a table, or of an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Row {
    At(usize),
    /// The index of an open loop, or the fresh row of an open push.
    Name(u32),
    /// An index that was computed: [`Op::Index`] or [`Op::After`].
    Value(u32),
}

impl Row {
    /// Calls `f` with the value that it is, if it is one.
    pub(crate) fn each_operand(self, mut f: impl FnMut(Operand)) {
        if let Row::Value(number) = self {
            f(Operand::Value(number));
        }
    }
}

/// Column `number` of a row of a table of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Entry {
    pub table: Fixed,
    pub row: Row,
    pub number: usize,
}

/// Column `number` of a row of a table in scratch memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Cell {
    pub table: Table,
    pub row: Row,
    pub number: usize,
}

/// Four neighbouring scalars in scratch memory: vector `row * stride + first`, counted in vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Quad {
    pub row: Row,
    pub stride: usize,
    pub first: usize,
}

/// Which bounds a loop runs, at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bounds {
    /// From the first index to before the end.
    Span { first: Row, end: Row },
    /// The rows that a list holds when the loop starts.
    Rows { list: u32, capacity: usize },
    /// As `Span`, shared among the lanes of a world.
    Shared { first: Row, end: Row },
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    /// Computes a value.
    Let(u32),
    Var {
        name: u32,
        value: Operand,
    },
    Set {
        name: u32,
        value: Operand,
    },
    Store {
        cell: Cell,
        value: Operand,
    },
    /// Writes the given components of a vector.
    StoreQuad {
        quad: Quad,
        numbers: [Option<Operand>; 4],
    },
    /// A list of so many rows: none, unless it goes on from another program.
    List {
        name: u32,
        rows: Operand,
    },
    When {
        mask: Operand,
        body: Vec<Statement>,
    },
    /// Counts a row where the mask holds; the body runs where the row fits.
    Push {
        list: u32,
        capacity: usize,
        row: u32,
        mask: Operand,
        body: Vec<Statement>,
    },
    Loop {
        index: u32,
        bounds: Bounds,
        body: Vec<Statement>,
    },
    /// Leaves the innermost loop where the mask holds.
    Stop(Operand),
}

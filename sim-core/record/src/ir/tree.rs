//! The intermediate representation: values in the order of computation, and statements in blocks.

use sim_physics::lane::{Fixed, Table};

/// What an operation reads: a constant, or a value computed before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operand {
    /// Bits of an `f32`, so that it can be compared and hashed.
    Constant(u32),
    /// A mask that is the same in all worlds.
    Truth(bool),
    /// Number of the value in [`crate::Recording::values`].
    Value(u32),
}

impl Operand {
    /// A constant. Negative zero becomes zero, so that equal constants are the same constant.
    pub fn number(x: f32) -> Operand {
        Operand::Constant((x + 0.0).to_bits())
    }

    /// The constant that this is, if it is one.
    pub fn constant(self) -> Option<f32> {
        match self {
            Operand::Constant(bits) => Some(f32::from_bits(bits)),
            _ => None,
        }
    }
}

/// What is done to one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unary {
    /// `-a`
    Neg,
    /// Square root.
    Sqrt,
    /// Absolute value.
    Abs,
    /// Nearest integer, ties to even.
    Round,
    /// The mask that holds where `a` does not.
    Not,
}

/// What is done to two operands, `a` and `b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// `a + b`
    Add,
    /// `a - b`
    Sub,
    /// `a * b`
    Mul,
    /// `a / b`
    Div,
    /// The smaller; `b` where either is NaN.
    Min,
    /// The larger; `b` where either is NaN.
    Max,
    /// The mask of `a < b`, which is false where either is NaN.
    Lt,
    /// The mask that holds where both do.
    And,
    /// The mask that holds where one of them does.
    Or,
}

/// How a value was computed. Variables, lists, loop indices and rows share one numbering: `name`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A scalar from outside, by its place among the inputs.
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
    /// Arithmetic on one value, or on one mask.
    Unary(Unary, Operand),
    /// Arithmetic on two values or masks, or their comparison.
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
        /// Where the entry stands.
        table: Fixed,
        /// A value: each world may have another row.
        row: Operand,
        /// Column of the row.
        number: usize,
    },
    /// An index of an index table of the model, below `end`. The value is an index.
    Index {
        /// Where the index stands.
        entry: Entry,
        /// Every index of the table is below it.
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
    pub fn each_operand(&self, mut f: impl FnMut(Operand)) {
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
    pub fn is_inline(&self) -> bool {
        matches!(
            self,
            Op::Unary(Unary::Neg | Unary::Not, _) | Op::Input(_) | Op::Part(..) | Op::Alike(_)
        )
    }
}

/// An index: of a row of a table, or of an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Row {
    /// An index that is known when the code is recorded.
    At(usize),
    /// The index of an open loop, or the fresh row of an open push.
    Name(u32),
    /// An index that was computed: [`Op::Index`] or [`Op::After`].
    Value(u32),
}

impl Row {
    /// Calls `f` with the value that it is, if it is one.
    pub fn each_operand(self, mut f: impl FnMut(Operand)) {
        if let Row::Value(number) = self {
            f(Operand::Value(number));
        }
    }
}

/// Column `number` of a row of a table of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Entry {
    /// Rows of the model, which no program changes.
    pub table: Fixed,
    /// Which row.
    pub row: Row,
    /// Column of the row.
    pub number: usize,
}

/// Column `number` of a row of a table in scratch memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// Rows of a world, which stages read and write.
    pub table: Table,
    /// In a push, each world may have another row.
    pub row: Row,
    /// Column of the row.
    pub number: usize,
}

/// Four neighbouring scalars in scratch memory: vector `row * stride + first`, counted in vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Quad {
    /// Row of a table whose rows are whole vectors.
    pub row: Row,
    /// Vectors from a row to the next.
    pub stride: usize,
    /// The vector in row 0, counted from the beginning of scratch memory.
    pub first: usize,
}

/// Which bounds a loop runs, at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounds {
    /// From the first index to before the end.
    Span {
        /// Index of the first iteration.
        first: Row,
        /// Indices are below it.
        end: Row,
    },
    /// The rows that a list holds when the loop starts.
    Rows {
        /// Name of the list.
        list: u32,
        /// Rows that fit into it; what is pushed beyond is counted, not kept.
        capacity: usize,
    },
    /// As `Span`, shared among the lanes of a world.
    Shared {
        /// Index of the first iteration of lane 0.
        first: Row,
        /// Indices are below it.
        end: Row,
    },
}

/// What is done, in order. In a block, it is done where the world is active.
#[derive(Clone, Debug, PartialEq)]
pub enum Statement {
    /// Computes a value.
    Let(u32),
    /// A variable begins.
    Var {
        /// Its number.
        name: u32,
        /// What it begins with.
        value: Operand,
    },
    /// A variable that has begun changes.
    Set {
        /// Its number.
        name: u32,
        /// What it holds from now on.
        value: Operand,
    },
    /// Writes to scratch memory.
    Store {
        /// Where.
        cell: Cell,
        /// What.
        value: Operand,
    },
    /// Writes the given components of a vector.
    StoreQuad {
        /// Where.
        quad: Quad,
        /// What, by component; none keeps what is there.
        numbers: [Option<Operand>; 4],
    },
    /// A list of so many rows: none, unless it goes on from another program.
    List {
        /// Its number.
        name: u32,
        /// How many it has at first.
        rows: Operand,
    },
    /// A block that runs where its mask holds.
    When {
        /// Is the world active in it?
        mask: Operand,
        /// Its statements.
        body: Vec<Statement>,
    },
    /// Counts a row where the mask holds; the body runs where the row fits.
    Push {
        /// Name of the list.
        list: u32,
        /// Rows that fit into it.
        capacity: usize,
        /// Name of the fresh row's index, for the body.
        row: u32,
        /// Does the world push?
        mask: Operand,
        /// Statements that write the row.
        body: Vec<Statement>,
    },
    /// Iterations, one for each index, until the world leaves.
    Loop {
        /// Name of the index, for the body.
        index: u32,
        /// Its indices.
        bounds: Bounds,
        /// Statements of an iteration.
        body: Vec<Statement>,
    },
    /// Leaves the innermost loop where the mask holds.
    Stop(Operand),
}

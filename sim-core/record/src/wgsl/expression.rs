//! Expressions: operations and operands of a recording, in WGSL.

use crate::ir::recording::Recording;
use crate::ir::tree::{Binary, Cell, Entry, Op, Operand, Quad, Row, Unary};
use crate::passes::vectorize::WIDTH;
use crate::wgsl::corrections::Corrections;
use std::collections::HashMap;

/// Names of a vector's components.
pub(super) const COMPONENTS: [char; WIDTH] = ['x', 'y', 'z', 'w'];

/// Prints the values of a recording.
pub(super) struct Expressions<'a> {
    pub recording: &'a Recording,
    /// Vectors of which a single component is used, and which: only that is read.
    pub single: HashMap<u32, usize>,
    pub corrections: Corrections,
}

impl Expressions<'_> {
    pub fn op(&self, op: Op) -> String {
        let x = |a: Operand| self.operand(a);
        match op {
            Op::Input(i) => format!("x{i}"),
            Op::Get(name) => format!("v{name}"),
            Op::Load(cell) => scratch(&cell),
            Op::Quad(quad) => vector(&quad),
            Op::Part(four, _) if self.single.contains_key(&four) => format!("t{four}"),
            Op::Part(four, k) => format!("t{four}.{}", COMPONENTS[k]),
            Op::Count(list) => format!("f32(n{list})"),
            Op::LoadAt(cell, column) => scratch_at(&cell, &x(column)),
            Op::Lane => "f32(lane)".to_owned(),
            Op::Alike(a) => x(a),
            Op::FromLane(..) | Op::AcrossLanes(..) => unreachable!("a statement of its own"),
            Op::Unary(unary, a) => match unary {
                Unary::Neg => format!("(-{})", x(a)),
                Unary::Not => format!("(!{})", x(a)),
                Unary::Sqrt => format!("{}({})", self.corrections.root(), x(a)),
                Unary::Abs => format!("abs({})", x(a)),
                Unary::Round => format!("round({})", x(a)),
            },
            Op::Binary(binary, a, b) => {
                let (a, b) = (x(a), x(b));
                match binary {
                    Binary::Add => format!("{a} + {b}"),
                    Binary::Sub => format!("{a} - {b}"),
                    Binary::Mul => format!("{a} * {b}"),
                    Binary::Div => self.corrections.quotient(&a, &b),
                    Binary::Min => format!("min({a}, {b})"),
                    Binary::Max => format!("max({a}, {b})"),
                    Binary::Lt => format!("{a} < {b}"),
                    Binary::And => format!("{a} && {b}"),
                    Binary::Or => format!("{a} || {b}"),
                }
            }
            Op::Fma(a, b, c) => {
                let fma = self.corrections.fma();
                format!("{fma}({}, {}, {})", x(a), x(b), x(c))
            }
            // WGSL names the value of the false case first
            Op::Select(mask, a, b) => format!("select({}, {}, {})", x(b), x(a), x(mask)),
            Op::Number(row) => format!("f32({})", index(row)),
            Op::Constant(Entry { table, row, number }) => {
                format!("numbers[{}]", place(table.base + number, table.stride, row))
            }
            Op::Pick { table, row, number } => {
                let first = table.base + number;
                format!("numbers[u32({}) * {}u + {first}u]", x(row), table.stride)
            }
            Op::Index { entry, .. } => {
                let Entry { table, row, number } = entry;
                format!("indices[{}]", place(table.base + number, table.stride, row))
            }
            Op::After(row, n) => format!("{} + u32({})", index(row), x(n)),
        }
    }

    pub fn operand(&self, x: Operand) -> String {
        match x {
            Operand::Constant(bits) => literal(f32::from_bits(bits)),
            Operand::Truth(mask) => mask.to_string(),
            Operand::Value(number) => match self.recording.values[number as usize] {
                op if op.is_inline() => self.op(op),
                _ => format!("t{number}"),
            },
        }
    }
}

pub(super) fn index(row: Row) -> String {
    match row {
        Row::At(i) => format!("{i}u"),
        Row::Name(name) => format!("i{name}"),
        Row::Value(number) => format!("t{number}"),
    }
}

/// Index of a scalar in a row; it is `first` in row 0.
fn place(first: usize, stride: usize, row: Row) -> String {
    match row {
        Row::At(i) => format!("{}u", first + i * stride),
        _ => format!("{} * {stride}u + {first}u", index(row)),
    }
}

/// A scalar whose component is found at run time.
pub(super) fn scratch(cell: &Cell) -> String {
    let Cell { table, row, number } = cell;
    let place = place(table.base + number, table.stride, *row);
    format!("scratch[({place}) / 4u * worlds + world][({place}) % 4u]")
}

/// A scalar in a column that is found at run time.
fn scratch_at(cell: &Cell, column: &str) -> String {
    let Cell { table, row, number } = cell;
    let place = place(table.base + number, table.stride, *row);
    let place = format!("{place} + u32({column})");
    format!("scratch[({place}) / 4u * worlds + world][({place}) % 4u]")
}

pub(super) fn vector(quad: &Quad) -> String {
    let place = place(quad.first, quad.stride, quad.row);
    match quad.row {
        Row::At(_) => format!("scratch[{place} * worlds + world]"),
        _ => format!("scratch[({place}) * worlds + world]"),
    }
}

/// The shortest decimal that reads back as the same `f32`; infinities as the largest finite value.
fn literal(x: f32) -> String {
    assert!(
        !x.is_nan(),
        "the recorder refuses constants that are not numbers"
    );
    let x = x.clamp(f32::MIN, f32::MAX);
    if x < 0.0 {
        format!("({x:?}f)")
    } else {
        format!("{x:?}f")
    }
}

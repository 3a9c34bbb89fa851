//! Pieces of a recording: what stands between two cuts, and what it names and costs.

use super::cost::{self, Cost};
use super::order::Part;
use crate::ir::tree::{Binary, Op, Operand, Row, Statement, Unary};
use crate::ir::uses::{Use, of_op, of_statement};
use crate::passes::lanes;
use crate::passes::vectorize;

/// A loop or a block that is cut inside, so that several pieces lie in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    /// The loop's index and where it starts; none for a block.
    pub index: Option<(u32, usize)>,
    /// Most iterations.
    pub iterations: usize,
}

/// Fields per region: whether a world has left it, and its iteration. Those of the first region come first.
pub(super) const REGION_FIELDS: u32 = 4;

/// What a piece does, in order.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Run(Statement),
    /// A world enters a region; with a mask, only if it holds.
    Enter(usize, Option<Operand>),
    /// A world leaves a region where the mask holds.
    Leave(usize, Operand),
    /// Counts a region's index.
    Next(usize),
}

impl Item {
    /// Whether lanes of a world share its work.
    pub fn needs_lanes(&self, values: &[Op]) -> bool {
        match self {
            Item::Run(statement) => lanes::needs_lanes(statement, values),
            _ => false,
        }
    }
}

/// Statements between two cuts.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub items: Vec<Item>,
    /// The regions around it, the outermost first.
    pub regions: Vec<usize>,
}

/// A recording in pieces.
pub(super) struct Pieces {
    pub pieces: Vec<Piece>,
    pub regions: Vec<Region>,
    pub order: Vec<Part>,
}

/// Cost of a statement and of the statements inside it.
pub(super) fn cost_of(statement: &Statement, values: &[Op]) -> Cost {
    match statement {
        Statement::When { .. } | Statement::Push { .. } | Statement::Loop { .. } => {
            let (body, values) = vectorize::vectorize(std::slice::from_ref(statement), values);
            cost::of_vectorized(&body, &values)
        }
        _ => cost::of_simple(statement, values),
    }
}

/// Whether a value is the number of a lane, a comparison with it, or a choice by that: which of some values the lane has.
fn is_of_lane(op: &Op, values: &[Op]) -> bool {
    let is_mask = |op: &Op| match *op {
        Op::Binary(Binary::Lt, bound, Operand::Value(lane)) => {
            bound.constant().is_some() && values[lane as usize] == Op::Lane
        }
        _ => false,
    };
    match *op {
        Op::Lane => true,
        Op::Select(Operand::Value(mask), ..) => is_mask(&values[mask as usize]),
        _ => is_mask(op),
    }
}

/// Whether it is cheaper to compute a value again than to keep it. What differs between the lanes of a world cannot be kept.
pub(super) fn is_computed_again(op: &Op, values: &[Op]) -> bool {
    let is_given = |x: Operand| match x {
        Operand::Value(number) => matches!(values[number as usize], Op::Input(_)),
        _ => true,
    };
    match op {
        Op::Input(_) | Op::Unary(Unary::Neg | Unary::Not, _) => true,
        Op::Unary(_, x) => is_given(*x),
        Op::Binary(_, a, b) if !is_of_lane(op, values) => {
            let inputs = [a, b]
                .iter()
                .filter(|x| matches!(x, Operand::Value(_)))
                .count();
            is_given(*a) && is_given(*b) && inputs == 1
        }
        Op::Constant(entry) | Op::Index { entry, .. } => matches!(entry.row, Row::At(_)),
        Op::Number(Row::Value(index)) => match &values[*index as usize] {
            index @ Op::Index { .. } => is_computed_again(index, values),
            _ => false,
        },
        _ => is_of_lane(op, values),
    }
}

/// The values that a piece needs to compute a value, other than those that are computed again.
pub(super) fn bases(number: u32, values: &[Op], f: &mut impl FnMut(u32)) {
    let op = &values[number as usize];
    if matches!(op, Op::Input(_)) || !is_computed_again(op, values) {
        return f(number);
    }
    let mut operands = Vec::new();
    of_op(op, &mut |used| {
        if let Use::Value(x) = used {
            operands.push(x);
        }
    });
    operands.iter().for_each(|x| bases(*x, values, f));
}

/// Calls `f` with everything an item names.
pub(super) fn uses_of(item: &Item, values: &[Op], f: &mut impl FnMut(Use)) {
    match item {
        Item::Run(statement) => of_statement(statement, values, f),
        Item::Enter(_, mask) => {
            if let Some(Operand::Value(number)) = mask {
                f(Use::Value(*number));
            }
        }
        Item::Leave(_, mask) => {
            if let Operand::Value(number) = mask {
                f(Use::Value(*number));
            }
        }
        Item::Next(_) => {}
    }
}

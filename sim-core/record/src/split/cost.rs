//! How long a driver takes to compile statements: the unit is a simple statement.
//!
//! Measured on a software Vulkan (llvmpipe of Mesa 22.3), which makes a loop over the lanes with blocks of
//! its own of every access to memory.

use crate::Recording;
use crate::tree::{Op, Statement};

/// A vector of four that is read.
pub(super) const QUAD: usize = 52;
/// A number that is read by itself.
const NUMBER: usize = 26;
/// A vector that is written.
pub(super) const WRITTEN_QUAD: usize = 38;
/// A number that is written by itself.
const WRITTEN_NUMBER: usize = 22;
/// A loop, beside its statements.
const LOOP: usize = 120;

/// Of a kernel that was packed, with its inputs and outputs.
pub(super) fn of_kernel(packed: &Recording) -> usize {
    let fields = packed.live_inputs().len().div_ceil(4) * QUAD;
    let outputs = packed.outputs().div_ceil(4) * WRITTEN_QUAD;
    fields + outputs + of_packed(&packed.body, &packed.values)
}

/// Of statements that were packed.
pub(super) fn of_packed(body: &[Statement], values: &[Op]) -> usize {
    let cost = |statement: &Statement| match statement {
        Statement::Let(number) => of_op(&values[*number as usize]),
        Statement::StoreQuad { numbers, .. } => match numbers.iter().flatten().count() {
            4 => WRITTEN_QUAD,
            given => given * WRITTEN_NUMBER,
        },
        Statement::Store { .. } => WRITTEN_NUMBER,
        Statement::When { body, .. } | Statement::Push { body, .. } => 2 + of_packed(body, values),
        Statement::Loop { body, .. } => LOOP + of_packed(body, values),
        _ => 1,
    };
    body.iter().map(cost).sum()
}

fn of_op(op: &Op) -> usize {
    match op {
        Op::Quad(_) => QUAD,
        Op::Load(_) | Op::Constant(_) | Op::Pick { .. } | Op::Index { .. } => NUMBER,
        op if op.is_inline() => 0,
        _ => 1,
    }
}

/// Of a statement between cuts, before neighbours share accesses: a number is part of a vector.
pub(super) fn of_simple(statement: &Statement, values: &[Op]) -> usize {
    match statement {
        Statement::Let(number) => match &values[*number as usize] {
            Op::Load(_) => QUAD / 3,
            op => of_op(op),
        },
        Statement::Store { .. } => WRITTEN_QUAD / 3,
        _ => 1,
    }
}

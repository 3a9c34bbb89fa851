//! How long a driver takes to compile statements: the unit is a simple statement.
//!
//! Measured on a software Vulkan (llvmpipe of Mesa 22.3), which makes a loop over the lanes with blocks of
//! its own of every access to memory: a unit is 0.05 to 0.1 ms of a core, and the accesses of a kernel
//! cost as much again where there are eighty of them.

use crate::Recording;
use crate::tree::{Op, Statement};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul};

/// Of some statements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cost {
    pub work: usize,
    /// Accesses to memory, which cost the more the more there are.
    pub access: usize,
    /// Loops, which cost as their cube: one of them little, twenty half a second.
    pub loops: usize,
}

/// A vector of four that is read.
pub(super) const QUAD: Cost = access(16);
/// A number that is read by itself.
const NUMBER: Cost = access(12);
/// A vector that is written.
pub(super) const WRITTEN_QUAD: Cost = access(12);
/// A number that is written by itself.
const WRITTEN_NUMBER: Cost = access(10);
/// A loop, beside its statements.
const LOOP: Cost = Cost {
    work: 100,
    access: 0,
    loops: 1,
};
/// A kernel, beside its statements.
pub(super) const KERNEL: usize = 80;
/// Accesses that cost twice what they would by themselves.
const MANY: usize = 1300;

const fn work(work: usize) -> Cost {
    Cost {
        work,
        access: 0,
        loops: 0,
    }
}

const fn access(access: usize) -> Cost {
    Cost {
        work: 0,
        access,
        loops: 0,
    }
}

impl Cost {
    /// In one kernel, without the kernel's own.
    pub(super) fn total(self) -> usize {
        self.work + self.access + self.access * self.access / MANY + self.loops.pow(3)
    }

    /// Of numbers that share vectors, in the mean.
    pub(super) fn of_numbers(self, numbers: usize) -> Cost {
        Cost {
            work: self.work * numbers / 4,
            access: self.access * numbers / 4,
            loops: self.loops,
        }
    }
}

impl Add for Cost {
    type Output = Cost;
    fn add(self, other: Cost) -> Cost {
        Cost {
            work: self.work + other.work,
            access: self.access + other.access,
            loops: self.loops + other.loops,
        }
    }
}

impl AddAssign for Cost {
    fn add_assign(&mut self, other: Cost) {
        *self = *self + other;
    }
}

impl Mul<usize> for Cost {
    type Output = Cost;
    fn mul(self, times: usize) -> Cost {
        Cost {
            work: self.work * times,
            access: self.access * times,
            loops: self.loops * times,
        }
    }
}

impl Sum for Cost {
    fn sum<I: Iterator<Item = Cost>>(costs: I) -> Cost {
        costs.fold(Cost::default(), Add::add)
    }
}

/// Of a kernel that was packed, with its inputs and outputs.
pub(super) fn of_kernel(packed: &Recording) -> usize {
    let fields = QUAD.of_numbers(packed.live_inputs().len());
    let outputs = WRITTEN_QUAD.of_numbers(packed.outputs());
    let body = of_packed(&packed.body, &packed.values);
    KERNEL + (fields + outputs + body).total()
}

/// Of statements that were packed.
pub(super) fn of_packed(body: &[Statement], values: &[Op]) -> Cost {
    let cost = |statement: &Statement| match statement {
        Statement::Let(number) => of_op(&values[*number as usize]),
        Statement::StoreQuad { numbers, .. } => match numbers.iter().flatten().count() {
            4 => WRITTEN_QUAD,
            given => WRITTEN_NUMBER * given,
        },
        Statement::Store { .. } => WRITTEN_NUMBER,
        Statement::When { body, .. } | Statement::Push { body, .. } => {
            work(20) + of_packed(body, values)
        }
        Statement::Loop { body, .. } => LOOP + of_packed(body, values),
        _ => work(2),
    };
    body.iter().map(cost).sum()
}

fn of_op(op: &Op) -> Cost {
    match op {
        Op::Quad(_) => QUAD,
        Op::Load(_) | Op::Constant(_) | Op::Pick { .. } | Op::Index { .. } => NUMBER,
        op if op.is_inline() => Cost::default(),
        _ => work(1),
    }
}

/// Of a statement between cuts, before neighbours share accesses: a number is part of a vector.
pub(super) fn of_simple(statement: &Statement, values: &[Op]) -> Cost {
    match statement {
        Statement::Let(number) => match &values[*number as usize] {
            Op::Load(_) => QUAD.of_numbers(1),
            op => of_op(op),
        },
        Statement::Store { .. } => WRITTEN_QUAD.of_numbers(1),
        _ => work(1),
    }
}

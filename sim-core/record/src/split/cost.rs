//! Compile time of statements: the unit is a simple statement.
//!
//! Measured on the software driver (llvmpipe of Mesa 22.3), which compiles every memory access to a loop over the lanes: a unit is
//! 0.05 to 0.1 ms of a core, and eighty accesses in a kernel cost twice as much as alone.

use crate::recording::Recording;
use crate::tree::{Op, Statement};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul};

/// Cost of some statements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cost {
    pub work: usize,
    /// Accesses to memory; their cost grows with the square.
    pub access: usize,
    /// Loops, which cost as their cube: one of them little, twenty half a second.
    pub loops: usize,
}

/// A vector of four that is read.
pub(super) const QUAD: Cost = access(16);
/// A scalar that is read by itself.
const NUMBER: Cost = access(12);
/// A vector that is written.
pub(super) const WRITTEN_QUAD: Cost = access(12);
/// A scalar that is written by itself.
const WRITTEN_NUMBER: Cost = access(10);
/// A loop, without its statements.
const LOOP: Cost = Cost {
    work: 100,
    access: 0,
    loops: 1,
};
/// A kernel, without its statements.
pub(super) const KERNEL: usize = 80;
/// Accesses at which the cost per access has doubled.
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

    /// Cost of scalars that share vectors, on average.
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

/// Cost of a vectorized kernel, with its inputs and outputs.
pub(super) fn of_kernel(packed: &Recording) -> usize {
    let fields = QUAD.of_numbers(packed.live_inputs().len());
    let outputs = WRITTEN_QUAD.of_numbers(packed.outputs());
    let body = of_vectorized(&packed.body, &packed.values);
    KERNEL + (fields + outputs + body).total()
}

/// Cost of vectorized statements.
pub(super) fn of_vectorized(body: &[Statement], values: &[Op]) -> Cost {
    let cost = |statement: &Statement| match statement {
        Statement::Let(number) => of_op(&values[*number as usize]),
        Statement::StoreQuad { numbers, .. } => match numbers.iter().flatten().count() {
            4 => WRITTEN_QUAD,
            given => WRITTEN_NUMBER * given,
        },
        Statement::Store { .. } => WRITTEN_NUMBER,
        Statement::When { body, .. } | Statement::Push { body, .. } => {
            work(20) + of_vectorized(body, values)
        }
        Statement::Loop { body, .. } => LOOP + of_vectorized(body, values),
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

/// Cost of a statement between cuts, before accesses are vectorized: a scalar is part of a vector.
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

//! Cost of statements, as a driver's compiler has it: [`Prices`] of kinds of statements, which [`Cost`] counts.

use crate::ir::recording::Recording;
use crate::ir::tree::{Op, Statement};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul};

/// What kinds of statements cost. The unit is a simple statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Prices {
    /// A quarter of a vector that is read.
    read: usize,
    /// A scalar that is read by itself.
    read_alone: usize,
    /// A quarter of a vector that is written.
    written: usize,
    /// A scalar that is written by itself.
    written_alone: usize,
    /// A loop, without its statements.
    loops: usize,
    /// A kernel, without its statements.
    kernel: usize,
    /// Accesses at which the cost per access has doubled, if it grows. Then loops cost as their cube, too: one of them little,
    /// twenty half a second.
    many: Option<usize>,
}

impl Prices {
    /// Compile time of Mesa's software driver (llvmpipe 22.3): it compiles every access to memory to a loop over the lanes. A unit
    /// is 0.05 to 0.1 ms of a core, and eighty accesses in a kernel cost twice as much as alone.
    pub const SOFTWARE: Prices = Prices {
        read: 4,
        read_alone: 12,
        written: 3,
        written_alone: 10,
        loops: 100,
        kernel: 80,
        many: Some(1300),
    };
    /// Instructions of a hardware GPU, as NVIDIA's compiler writes them for sm_90: linear in the statements.
    pub const HARDWARE: Prices = Prices {
        read: 1,
        read_alone: 2,
        written: 1,
        written_alone: 2,
        loops: 6,
        kernel: 20,
        many: None,
    };
}

/// Statements of some kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cost {
    work: usize,
    /// Quarters of vectors.
    read: usize,
    read_alone: usize,
    written: usize,
    written_alone: usize,
    loops: usize,
}

impl Cost {
    const NONE: Cost = Cost {
        work: 0,
        read: 0,
        read_alone: 0,
        written: 0,
        written_alone: 0,
        loops: 0,
    };
    /// A vector of four that is read.
    const QUAD: Cost = Cost::read(4);
    /// A vector that is written.
    pub const WRITTEN_QUAD: Cost = Cost::written(4);
    const NUMBER: Cost = Cost {
        read_alone: 1,
        ..Cost::NONE
    };
    const WRITTEN_NUMBER: Cost = Cost {
        written_alone: 1,
        ..Cost::NONE
    };
    const LOOP: Cost = Cost {
        loops: 1,
        ..Cost::NONE
    };

    const fn work(work: usize) -> Cost {
        Cost { work, ..Cost::NONE }
    }

    /// Scalars that are read and share vectors.
    pub const fn read(numbers: usize) -> Cost {
        Cost {
            read: numbers,
            ..Cost::NONE
        }
    }

    /// Scalars that are written and share vectors.
    pub const fn written(numbers: usize) -> Cost {
        Cost {
            written: numbers,
            ..Cost::NONE
        }
    }

    /// In one kernel, with the kernel's own.
    pub fn of_kernel(self, prices: &Prices) -> usize {
        prices.kernel + self.total(prices)
    }

    /// In one kernel, without the kernel's own.
    pub fn total(self, prices: &Prices) -> usize {
        let access = self.read * prices.read
            + self.read_alone * prices.read_alone
            + self.written * prices.written
            + self.written_alone * prices.written_alone;
        let growth = prices
            .many
            .map_or(0, |many| access * access / many + self.loops.pow(3));
        self.work + self.loops * prices.loops + access + growth
    }
}

impl Add for Cost {
    type Output = Cost;
    fn add(self, other: Cost) -> Cost {
        Cost {
            work: self.work + other.work,
            read: self.read + other.read,
            read_alone: self.read_alone + other.read_alone,
            written: self.written + other.written,
            written_alone: self.written_alone + other.written_alone,
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
            read: self.read * times,
            read_alone: self.read_alone * times,
            written: self.written * times,
            written_alone: self.written_alone * times,
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
pub(super) fn of_kernel(packed: &Recording, prices: &Prices) -> usize {
    let fields = Cost::read(packed.live_inputs().len());
    let outputs = Cost::written(packed.outputs());
    let body = of_vectorized(&packed.body, &packed.values);
    (fields + outputs + body).of_kernel(prices)
}

/// Cost of vectorized statements.
pub(super) fn of_vectorized(body: &[Statement], values: &[Op]) -> Cost {
    let cost = |statement: &Statement| match statement {
        Statement::Let(number) => of_op(&values[*number as usize]),
        Statement::StoreQuad { numbers, .. } => match numbers.iter().flatten().count() {
            4 => Cost::WRITTEN_QUAD,
            given => Cost::WRITTEN_NUMBER * given,
        },
        Statement::Store { .. } => Cost::WRITTEN_NUMBER,
        Statement::When { body, .. } | Statement::Push { body, .. } => {
            Cost::work(20) + of_vectorized(body, values)
        }
        Statement::Loop { body, .. } => Cost::LOOP + of_vectorized(body, values),
        _ => Cost::work(2),
    };
    body.iter().map(cost).sum()
}

fn of_op(op: &Op) -> Cost {
    match op {
        Op::Quad(_) => Cost::QUAD,
        Op::Load(_) | Op::LoadAt(..) | Op::Constant(_) | Op::Pick { .. } | Op::Index { .. } => {
            Cost::NUMBER
        }
        op if op.is_inline() => Cost::NONE,
        _ => Cost::work(1),
    }
}

/// Cost of a statement between cuts, before accesses are vectorized: a scalar is part of a vector.
pub(super) fn of_simple(statement: &Statement, values: &[Op]) -> Cost {
    match statement {
        Statement::Let(number) => match &values[*number as usize] {
            Op::Load(_) => Cost::read(1),
            op => of_op(op),
        },
        Statement::Store { .. } => Cost::written(1),
        _ => Cost::work(1),
    }
}

//! Do the two recorded bounds of a loop's body do the same?

use crate::error::Place;
use crate::ir::tree::{Bounds, Cell, Entry, Op, Operand, Row, Statement};
use crate::recorder::handles::Counters;
use crate::recorder::state::Value;

/// The first difference found.
pub(super) struct Difference {
    /// The two constants, where it lies in constants alone.
    pub constants: Option<(f32, f32)>,
    /// Location in the code, if it lies in a value.
    pub place: Option<Place>,
}

const STRUCTURE: Difference = Difference {
    constants: None,
    place: None,
};

type Same = Result<(), Difference>;

fn same(equal: bool) -> Same {
    if equal { Ok(()) } else { Err(STRUCTURE) }
}

/// Two bounds: the first numbered its values and names from `before`, the second from `between`.
///
/// What is older than `before` must be the very same; what is new must have the same place in the
/// order, since both iterations number as they go.
pub(super) struct Pair<'a> {
    pub values: &'a [Value],
    pub before: Counters,
    pub between: Counters,
}

impl Pair<'_> {
    pub(super) fn compare(&self, first: &[Statement], second: &[Statement]) -> Same {
        for (a, b) in first.iter().zip(second) {
            self.statement(a, b)?;
        }
        same(first.len() == second.len())
    }

    fn statement(&self, a: &Statement, b: &Statement) -> Same {
        use Statement::*;
        match (a, b) {
            (Let(a), Let(b)) => {
                self.value(*a, *b)?;
                let value = &self.values[*b as usize];
                self.op(&self.values[*a as usize].op, &value.op)
                    .map_err(|d| Difference {
                        place: Some(value.place),
                        ..d
                    })
            }
            (Var { name: a, value: x }, Var { name: b, value: y })
            | (Set { name: a, value: x }, Set { name: b, value: y }) => {
                self.name(*a, *b)?;
                self.operand(*x, *y)
            }
            (Store { cell: a, value: x }, Store { cell: b, value: y }) => {
                self.cell(a, b)?;
                self.operand(*x, *y)
            }
            (List { name: a, .. }, List { name: b, .. }) => self.name(*a, *b),
            (When { mask: a, body: x }, When { mask: b, body: y }) => {
                self.operand(*a, *b)?;
                self.compare(x, y)
            }
            (
                Push {
                    list: a,
                    capacity: m,
                    row: r,
                    mask: p,
                    body: x,
                },
                Push {
                    list: b,
                    capacity: n,
                    row: s,
                    mask: q,
                    body: y,
                },
            ) => {
                same(m == n)?;
                self.name(*a, *b)?;
                self.name(*r, *s)?;
                self.operand(*p, *q)?;
                self.compare(x, y)
            }
            (
                Loop {
                    index: a,
                    bounds: m,
                    body: x,
                },
                Loop {
                    index: b,
                    bounds: n,
                    body: y,
                },
            ) => {
                self.name(*a, *b)?;
                self.bounds(*m, *n)?;
                self.compare(x, y)
            }
            (Stop(a), Stop(b)) => self.operand(*a, *b),
            _ => Err(STRUCTURE),
        }
    }

    fn op(&self, a: &Op, b: &Op) -> Same {
        match (a, b) {
            (Op::Input(a), Op::Input(b)) => same(a == b),
            (Op::Get(a), Op::Get(b)) | (Op::Count(a), Op::Count(b)) => self.name(*a, *b),
            (Op::Load(a), Op::Load(b)) => self.cell(a, b),
            (Op::LoadAt(a, x), Op::LoadAt(b, y)) => {
                self.cell(a, b)?;
                self.operand(*x, *y)
            }
            (Op::Lane, Op::Lane) => Ok(()),
            (Op::Alike(a), Op::Alike(b)) => self.operand(*a, *b),
            (Op::FromLane(a, m), Op::FromLane(b, n))
            | (Op::AcrossLanes(a, m), Op::AcrossLanes(b, n)) => {
                same(m == n)?;
                self.operand(*a, *b)
            }
            (Op::Unary(o, a), Op::Unary(p, b)) => {
                same(o == p)?;
                self.operand(*a, *b)
            }
            (Op::Binary(o, a1, a2), Op::Binary(p, b1, b2)) => {
                same(o == p)?;
                self.operand(*a1, *b1)?;
                self.operand(*a2, *b2)
            }
            (Op::Fma(a1, a2, a3), Op::Fma(b1, b2, b3))
            | (Op::Select(a1, a2, a3), Op::Select(b1, b2, b3)) => {
                self.operand(*a1, *b1)?;
                self.operand(*a2, *b2)?;
                self.operand(*a3, *b3)
            }
            (Op::Number(a), Op::Number(b)) => self.row(*a, *b),
            (Op::Constant(a), Op::Constant(b)) => self.entry(a, b),
            (
                Op::Pick {
                    table: t,
                    row: a,
                    number: m,
                },
                Op::Pick {
                    table: u,
                    row: b,
                    number: n,
                },
            ) => {
                same(t == u && m == n)?;
                self.operand(*a, *b)
            }
            (Op::Index { entry: a, end: m }, Op::Index { entry: b, end: n }) => {
                same(m == n)?;
                self.entry(a, b)
            }
            (Op::After(a, x), Op::After(b, y)) => {
                self.row(*a, *b)?;
                self.operand(*x, *y)
            }
            _ => Err(STRUCTURE),
        }
    }

    fn operand(&self, a: Operand, b: Operand) -> Same {
        match (a, b) {
            (Operand::Value(a), Operand::Value(b)) => self.value(a, b),
            _ if a == b => Ok(()),
            _ => Err(Difference {
                constants: a.constant().zip(b.constant()),
                place: None,
            }),
        }
    }

    fn value(&self, a: u32, b: u32) -> Same {
        same(moved(a, self.before.values, self.between.values) == b)
    }

    fn name(&self, a: u32, b: u32) -> Same {
        same(moved(a, self.before.names, self.between.names) == b)
    }

    fn cell(&self, a: &Cell, b: &Cell) -> Same {
        same(a.table == b.table && a.number == b.number)?;
        self.row(a.row, b.row)
    }

    fn entry(&self, a: &Entry, b: &Entry) -> Same {
        same(a.table == b.table && a.number == b.number)?;
        self.row(a.row, b.row)
    }

    fn row(&self, a: Row, b: Row) -> Same {
        match (a, b) {
            (Row::At(a), Row::At(b)) => same(a == b),
            (Row::Name(a), Row::Name(b)) => self.name(a, b),
            (Row::Value(a), Row::Value(b)) => self.value(a, b),
            _ => Err(STRUCTURE),
        }
    }

    fn bounds(&self, a: Bounds, b: Bounds) -> Same {
        match (a, b) {
            (Bounds::Span { first: a, end: m }, Bounds::Span { first: b, end: n }) => {
                self.row(a, b)?;
                self.row(m, n)
            }
            (
                Bounds::Rows {
                    list: a,
                    capacity: m,
                },
                Bounds::Rows {
                    list: b,
                    capacity: n,
                },
            ) => {
                same(m == n)?;
                self.name(a, b)
            }
            _ => Err(STRUCTURE),
        }
    }
}

/// The number in the second iteration of what has `number` in the first.
fn moved(number: u32, before: u32, between: u32) -> u32 {
    if number < before {
        number
    } else {
        number - before + between
    }
}

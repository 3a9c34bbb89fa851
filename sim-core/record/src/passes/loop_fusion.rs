//! Loop fusion: neighbouring loops with equal bodies become one loop.
//!
//! Physics code iterates natively over the classes of rows, and in the execution context over the rows of a class. Where the body does not
//! depend on the class, a program has the same loop many times, each over rows of its own:
//!
//! ```text
//! for i in 0..n₀ { body }  for i in 94..94+n₁ { body }    →    for j in 0..n₀+n₁ { i = j < n₀ ? j : j + 94 - n₀; body }
//! ```
//!
//! The rows keep their order, so the bits stay. One loop compiles faster, and neighbouring threads whose worlds have rows of
//! different classes run it together.

use crate::ir::tree::{Binary, Bounds, Op, Operand, Row, Statement};
use crate::ir::uses::Rename;
use sim_physics::lane::Fixed;
use std::collections::HashMap;

/// Fuses the loops of a recording. New values are appended; `names` counts the names of loops.
pub(crate) fn fuse(body: &mut Vec<Statement>, values: &mut Vec<Op>, names: &mut usize) {
    let mut fuser = Fuser { values, names };
    fuser.block(body);
}

struct Fuser<'a> {
    values: &'a mut Vec<Op>,
    names: &'a mut usize,
}

/// A loop over rows of which so many are in use.
struct Span {
    index: u32,
    first: Row,
    rows: Operand,
    /// Most rows that may be in use.
    capacity: Capacity,
    body: Vec<Statement>,
}

/// Rows that a loop has room for.
#[derive(Clone, Copy)]
enum Capacity {
    Fixed(usize),
    /// What a table has, in the entry of the loop's first row.
    Read,
}

/// An entry of a table of rooms.
#[derive(Clone, Copy)]
struct RoomEntry {
    table: Fixed,
    row: usize,
    number: usize,
}

impl RoomEntry {
    /// Are both of the same room?
    fn is_beside(self, other: RoomEntry) -> bool {
        (self.table, self.row) == (other.table, other.row)
    }

    /// Is this the same number of a room before the other?
    fn is_before(self, other: RoomEntry) -> bool {
        self.table == other.table && self.number == other.number && self.row < other.row
    }
}

/// Loops that may be joined, and what stands between them.
#[derive(Default)]
struct Run {
    spans: Vec<(Span, Statement)>,
    /// What may stand before the first of them.
    before: Vec<Statement>,
    /// What stands behind the last.
    behind: Vec<Statement>,
}

impl Fuser<'_> {
    fn block(&mut self, body: &mut Vec<Statement>) {
        let mut done = Vec::with_capacity(body.len());
        let mut run = Run::default();
        for mut statement in std::mem::take(body) {
            if let Statement::When { body, .. }
            | Statement::Push { body, .. }
            | Statement::Loop { body, .. } = &mut statement
            {
                self.block(body);
            }
            if let Some(span) = self.span(&statement) {
                let fits = (run.spans.last()).is_some_and(|(last, _)| self.fit(last, &span, &run));
                if !fits {
                    self.end(&mut run, &mut done);
                }
                let between = std::mem::take(&mut run.behind);
                run.before.extend(between);
                run.spans.push((span, statement));
            } else if !run.spans.is_empty() && self.may_come_before(&statement, &run) {
                run.behind.push(statement);
            } else {
                self.end(&mut run, &mut done);
                done.push(statement);
            }
        }
        self.end(&mut run, &mut done);
        *body = done;
    }

    /// A loop that may be joined to others.
    fn span(&self, statement: &Statement) -> Option<Span> {
        let Statement::Loop {
            index,
            bounds:
                Bounds::Span {
                    first,
                    end: Row::Value(end),
                },
            body,
        } = statement
        else {
            return None;
        };
        let Op::After(from, rows) = self.values[*end as usize] else {
            return None;
        };
        let Operand::Value(number) = rows else {
            return None;
        };
        let Op::Binary(Binary::Min, a, b) = self.values[number as usize] else {
            return None;
        };
        let capacity = match (*first, a.constant().or(b.constant())) {
            (Row::At(_), Some(capacity)) => Capacity::Fixed(capacity as usize),
            (Row::Value(first), None) => {
                let room = self.room(first)?;
                let is_of_room = |x| self.read_number(x).is_some_and(|y| room.is_beside(y));
                (is_of_room(a) || is_of_room(b)).then_some(Capacity::Read)?
            }
            _ => return None,
        };
        (from == *first && is_plain(body)).then(|| Span {
            index: *index,
            first: *first,
            rows,
            capacity,
            body: body.clone(),
        })
    }

    /// The entry of a table that an index is read from.
    fn room(&self, index: u32) -> Option<RoomEntry> {
        match self.values[index as usize] {
            Op::Index { entry, .. } => match entry.row {
                Row::At(row) => Some(RoomEntry {
                    table: entry.table,
                    row,
                    number: entry.number,
                }),
                _ => None,
            },
            _ => None,
        }
    }

    /// The entry that a scalar is read from as an index.
    fn read_number(&self, x: Operand) -> Option<RoomEntry> {
        let Operand::Value(number) = x else {
            return None;
        };
        match self.values[number as usize] {
            Op::Number(Row::Value(index)) => self.room(index),
            _ => None,
        }
    }

    /// Is the body of the loop that of those before it, and do its rows come behind theirs?
    fn fit(&self, last: &Span, next: &Span, run: &Run) -> bool {
        self.comes_behind(last, next, run) && self.renamed(last, 0) == self.renamed(next, 0)
    }

    fn comes_behind(&self, last: &Span, next: &Span, run: &Run) -> bool {
        match (last.first, next.first) {
            (Row::At(_), Row::At(first)) => {
                let before = run.spans.iter().map(|(span, _)| match span.capacity {
                    Capacity::Fixed(rows) => rows,
                    Capacity::Read => unreachable!("its first row is read, too"),
                });
                first >= before.sum::<usize>()
            }
            // the rooms of a table follow each other ([`sim_physics::lane::Cx::kept`])
            (Row::Value(last), Row::Value(next)) => {
                let rooms = self.room(last).zip(self.room(next));
                rooms.is_some_and(|(last, next)| last.is_before(next))
            }
            _ => false,
        }
    }

    /// The body with an index that is value `row`, and its operations, which are numbered after it.
    fn renamed(&self, span: &Span, row: u32) -> (Vec<Statement>, Vec<Op>) {
        let mut fresh = Fresh {
            values: self.values,
            index: span.index,
            row,
            ops: Vec::new(),
            known: HashMap::new(),
        };
        (fresh.body(&span.body), fresh.ops)
    }

    /// A value that is the same whether the loops of a run come first or not.
    fn may_come_before(&self, statement: &Statement, run: &Run) -> bool {
        let Statement::Let(number) = statement else {
            return false;
        };
        match &self.values[*number as usize] {
            Op::Get(_) | Op::Count(_) => false,
            Op::Load(cell) | Op::LoadAt(cell, _) => {
                let from = cell.table.base;
                let end = from + cell.table.rows * cell.table.stride;
                let mut meets = false;
                run.spans.iter().for_each(|(span, _)| {
                    each_store(&span.body, &mut |base, last| {
                        meets |= base < end && from < last;
                    });
                });
                !meets
            }
            _ => true,
        }
    }

    fn compute(&mut self, op: Op, to: &mut Vec<Statement>) -> Operand {
        let number = self.values.len() as u32;
        self.values.push(op);
        to.push(Statement::Let(number));
        Operand::Value(number)
    }

    fn end(&mut self, run: &mut Run, done: &mut Vec<Statement>) {
        let Run {
            mut spans,
            before,
            behind,
        } = std::mem::take(run);
        match spans.len() {
            0 => {}
            1 => done.extend(spans.pop().map(|(_, statement)| statement)),
            _ => {
                done.extend(before);
                let spans: Vec<Span> = spans.into_iter().map(|(span, _)| span).collect();
                self.joined(&spans, done);
            }
        }
        done.extend(behind);
    }

    fn joined(&mut self, spans: &[Span], done: &mut Vec<Statement>) {
        // rows of the spans before each one, and the offset from the index of the loop to the row
        let (mut ends, mut shifts): (Vec<Operand>, Vec<Operand>) = (Vec::new(), Vec::new());
        for span in spans {
            let first = match span.first {
                Row::At(row) => Operand::number(row as f32),
                row => self.compute(Op::Number(row), done),
            };
            let (end, shift) = match ends.last() {
                None => (span.rows, first),
                Some(before) => {
                    let before = *before;
                    (
                        self.compute(Op::Binary(Binary::Add, before, span.rows), done),
                        self.compute(Op::Binary(Binary::Sub, first, before), done),
                    )
                }
            };
            ends.push(end);
            shifts.push(shift);
        }
        let total = ends.pop().expect("some spans");
        let Operand::Value(end) = self.compute(Op::After(Row::At(0), total), done) else {
            unreachable!("it was computed")
        };
        let name = *self.names as u32;
        *self.names += 1;
        let mut body = Vec::new();
        let number = self.compute(Op::Number(Row::Name(name)), &mut body);
        let mut shift = shifts.pop().expect("some spans");
        for (end, before) in ends.into_iter().zip(shifts).rev() {
            let mask = self.compute(Op::Binary(Binary::Lt, number, end), &mut body);
            shift = self.compute(Op::Select(mask, before, shift), &mut body);
        }
        let Operand::Value(row) = self.compute(Op::After(Row::Name(name), shift), &mut body) else {
            unreachable!("it was computed")
        };
        let (statements, ops) = self.renamed(&spans[0], row);
        self.values.extend(ops);
        body.extend(statements);
        done.push(Statement::Loop {
            index: name,
            bounds: Bounds::Span {
                first: Row::At(0),
                end: Row::Value(end),
            },
            body,
        });
    }
}

/// Does a body only compute, assign and store?
fn is_plain(body: &[Statement]) -> bool {
    body.iter().all(|statement| match statement {
        Statement::Let(_) | Statement::Set { .. } | Statement::Store { .. } => true,
        Statement::When { body, .. } => is_plain(body),
        _ => false,
    })
}

/// Calls `f` with the first scalar of every table that is written, and the end of the table.
fn each_store(body: &[Statement], f: &mut impl FnMut(usize, usize)) {
    for statement in body {
        match statement {
            Statement::Store { cell, .. } => {
                let table = cell.table;
                f(table.base, table.base + table.rows * table.stride);
            }
            Statement::When { body, .. } => each_store(body, f),
            _ => {}
        }
    }
}

/// Writes a body with values and an index of its own.
struct Fresh<'a> {
    values: &'a [Op],
    index: u32,
    row: u32,
    ops: Vec<Op>,
    known: HashMap<u32, u32>,
}

impl Rename for Fresh<'_> {
    fn value(&mut self, number: u32) -> Operand {
        Operand::Value(self.known.get(&number).copied().unwrap_or(number))
    }

    fn index(&mut self, name: u32) -> Option<u32> {
        (name == self.index).then_some(self.row)
    }

    fn compute(&mut self, number: u32) -> u32 {
        let op = self.op(self.values[number as usize]);
        let new = (self.values.len() + self.ops.len()) as u32;
        self.ops.push(op);
        self.known.insert(number, new);
        new
    }
}

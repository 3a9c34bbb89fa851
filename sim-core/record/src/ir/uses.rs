//! Uses: the values, variables, lists and indices that a statement names, and renaming them.

use crate::ir::tree::{Bounds, Cell, Entry, Op, Operand, Quad, Row, Statement};

/// A thing that a statement reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    Value(u32),
    /// The index of a loop, or a fresh row.
    Index(u32),
    /// A variable or a list is read.
    Read(u32),
    /// A variable or a list is changed, and what it was may matter.
    Change(u32),
    /// A variable or a list starts.
    Start(u32),
}

/// Calls `f` with everything that an operation reads.
pub(crate) fn of_op(op: &Op, f: &mut impl FnMut(Use)) {
    match *op {
        Op::Get(name) | Op::Count(name) => f(Use::Read(name)),
        Op::Load(Cell { row, .. }) | Op::Quad(Quad { row, .. }) | Op::Number(row) => of_row(row, f),
        Op::LoadAt(Cell { row, .. }, column) => {
            of_row(row, f);
            of_operand(column, f);
        }
        Op::Constant(entry) | Op::Index { entry, .. } => of_row(entry.row, f),
        Op::After(row, x) => {
            of_row(row, f);
            of_operand(x, f);
        }
        _ => op.each_operand(|x| of_operand(x, f)),
    }
}

/// Calls `f` with everything that a statement, and those inside it, read, change and start.
pub(crate) fn of_statement(statement: &Statement, values: &[Op], f: &mut impl FnMut(Use)) {
    match statement {
        Statement::Let(number) => of_op(&values[*number as usize], f),
        Statement::Var { name, value } => {
            of_operand(*value, f);
            f(Use::Start(*name));
        }
        Statement::Set { name, value } => {
            of_operand(*value, f);
            f(Use::Change(*name));
        }
        Statement::Store { cell, value } => {
            of_row(cell.row, f);
            of_operand(*value, f);
        }
        Statement::StoreQuad { quad, numbers } => {
            of_row(quad.row, f);
            numbers.iter().flatten().for_each(|x| of_operand(*x, f));
        }
        Statement::List { name, rows } => {
            of_operand(*rows, f);
            f(Use::Start(*name));
        }
        Statement::When { mask, body } => {
            of_operand(*mask, f);
            body.iter().for_each(|s| of_statement(s, values, f));
        }
        Statement::Push {
            list, mask, body, ..
        } => {
            of_operand(*mask, f);
            f(Use::Change(*list));
            body.iter().for_each(|s| of_statement(s, values, f));
        }
        Statement::Loop { bounds, body, .. } => {
            match *bounds {
                Bounds::Span { first, end } | Bounds::Shared { first, end } => {
                    of_row(first, f);
                    of_row(end, f);
                }
                Bounds::Rows { list, .. } => f(Use::Read(list)),
            }
            body.iter().for_each(|s| of_statement(s, values, f));
        }
        Statement::Stop(mask) => of_operand(*mask, f),
    }
}

fn of_operand(x: Operand, f: &mut impl FnMut(Use)) {
    if let Operand::Value(number) = x {
        f(Use::Value(number));
    }
}

fn of_row(row: Row, f: &mut impl FnMut(Use)) {
    match row {
        Row::At(_) => {}
        Row::Name(name) => f(Use::Index(name)),
        Row::Value(number) => f(Use::Value(number)),
    }
}

/// Values that the statements compute, those inside blocks too.
pub(crate) fn computed(body: &[Statement], f: &mut impl FnMut(u32)) {
    for statement in body {
        match statement {
            Statement::Let(number) => f(*number),
            Statement::When { body, .. }
            | Statement::Push { body, .. }
            | Statement::Loop { body, .. } => computed(body, f),
            _ => {}
        }
    }
}

/// Writes statements again with other values and indices.
pub(crate) trait Rename {
    fn value(&mut self, number: u32) -> Operand;
    /// The value that stands for an index, if one does.
    fn index(&mut self, name: u32) -> Option<u32>;
    /// The new number of a value.
    fn compute(&mut self, number: u32) -> u32;

    fn operand(&mut self, x: Operand) -> Operand {
        match x {
            Operand::Value(number) => self.value(number),
            constant => constant,
        }
    }

    fn row(&mut self, row: Row) -> Row {
        match row {
            Row::At(_) => row,
            Row::Name(name) => self.index(name).map_or(row, Row::Value),
            Row::Value(number) => match self.value(number) {
                Operand::Value(number) => Row::Value(number),
                _ => unreachable!("an index is not a constant number"),
            },
        }
    }

    fn cell(&mut self, cell: Cell) -> Cell {
        Cell {
            row: self.row(cell.row),
            ..cell
        }
    }

    fn entry(&mut self, entry: Entry) -> Entry {
        Entry {
            row: self.row(entry.row),
            ..entry
        }
    }

    fn op(&mut self, op: Op) -> Op {
        match op {
            Op::Input(_) | Op::Get(_) | Op::Count(_) | Op::Lane => op,
            Op::LoadAt(cell, column) => Op::LoadAt(self.cell(cell), self.operand(column)),
            Op::FromLane(a, lane) => Op::FromLane(self.operand(a), lane),
            Op::AcrossLanes(a, apart) => Op::AcrossLanes(self.operand(a), apart),
            Op::Alike(a) => Op::Alike(self.operand(a)),
            Op::Load(cell) => Op::Load(self.cell(cell)),
            Op::Unary(unary, a) => Op::Unary(unary, self.operand(a)),
            Op::Binary(binary, a, b) => Op::Binary(binary, self.operand(a), self.operand(b)),
            Op::Fma(a, b, c) => Op::Fma(self.operand(a), self.operand(b), self.operand(c)),
            Op::Select(a, b, c) => Op::Select(self.operand(a), self.operand(b), self.operand(c)),
            Op::Number(row) => Op::Number(self.row(row)),
            Op::Constant(entry) => Op::Constant(self.entry(entry)),
            Op::Pick { table, row, number } => Op::Pick {
                table,
                row: self.operand(row),
                number,
            },
            Op::Index { entry, end } => Op::Index {
                entry: self.entry(entry),
                end,
            },
            Op::After(row, x) => Op::After(self.row(row), self.operand(x)),
            Op::Quad(_) | Op::Part(..) => unreachable!("a recording is split before it is packed"),
        }
    }

    fn body(&mut self, body: &[Statement]) -> Vec<Statement> {
        body.iter().map(|s| self.statement(s)).collect()
    }

    fn statement(&mut self, statement: &Statement) -> Statement {
        match statement {
            Statement::Let(number) => Statement::Let(self.compute(*number)),
            Statement::Var { name, value } => Statement::Var {
                name: *name,
                value: self.operand(*value),
            },
            Statement::Set { name, value } => Statement::Set {
                name: *name,
                value: self.operand(*value),
            },
            Statement::Store { cell, value } => Statement::Store {
                cell: self.cell(*cell),
                value: self.operand(*value),
            },
            Statement::StoreQuad { .. } => unreachable!("a recording is split before it is packed"),
            Statement::List { name, rows } => Statement::List {
                name: *name,
                rows: self.operand(*rows),
            },
            Statement::When { mask, body } => Statement::When {
                mask: self.operand(*mask),
                body: self.body(body),
            },
            Statement::Push {
                list,
                capacity,
                row,
                mask,
                body,
            } => Statement::Push {
                list: *list,
                capacity: *capacity,
                row: *row,
                mask: self.operand(*mask),
                body: self.body(body),
            },
            Statement::Loop {
                index,
                bounds,
                body,
            } => Statement::Loop {
                index: *index,
                bounds: match *bounds {
                    Bounds::Span { first, end } => Bounds::Span {
                        first: self.row(first),
                        end: self.row(end),
                    },
                    rows => rows,
                },
                body: self.body(body),
            },
            Statement::Stop(mask) => Statement::Stop(self.operand(*mask)),
        }
    }
}

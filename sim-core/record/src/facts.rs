//! Variables, lists and scratch memory: what is known of them at a point of the text.
//!
//! A lane is a thread is a world: inside a block the thread is active, so what it stored last is
//! what it loads next, whatever the mask was on the CPU.

use super::error::Misuse;
use super::handles::{Owner, RecordedIndex};
use super::state::{Kind, State};
use super::tree::{Cell, Entry, Op, Operand, Row, Statement};
use sim_physics::lane::{Fixed, Real, Table};
use std::collections::HashMap;

/// Values known in one open block.
#[derive(Default)]
pub(super) struct Facts {
    /// Variables and lengths of lists, by name.
    names: HashMap<u32, Operand>,
    cells: HashMap<(Table, usize), Vec<(Row, Operand)>>,
}

impl Facts {
    pub(super) fn name(&self, name: u32) -> Option<Operand> {
        self.names.get(&name).copied()
    }

    pub(super) fn cell(&self, cell: Cell) -> Option<Operand> {
        let rows = self.cells.get(&(cell.table, cell.number))?;
        rows.iter()
            .find(|(row, _)| *row == cell.row)
            .map(|(_, value)| *value)
    }

    pub(super) fn learn_name(&mut self, name: u32, value: Operand) {
        self.names.insert(name, value);
    }

    pub(super) fn learn_cell(&mut self, cell: Cell, value: Operand) {
        let rows = self.cells.entry((cell.table, cell.number)).or_default();
        rows.retain(|(row, _)| *row != cell.row);
        rows.push((cell.row, value));
    }

    pub(super) fn forget_name(&mut self, name: u32) {
        self.names.remove(&name);
    }

    /// Forgets what a store to `cell` may change.
    pub(super) fn forget_cell(&mut self, cell: Cell) {
        if let Some(rows) = self.cells.get_mut(&(cell.table, cell.number)) {
            rows.retain(|(row, _)| differ(*row, cell.row));
        }
    }

    /// Forgets everything about a table.
    pub(super) fn forget_table(&mut self, table: Table) {
        self.cells.retain(|(t, _), _| *t != table);
    }
}

impl State {
    /// The cell that an index names, checked; none after a misuse.
    pub(super) fn cell(&mut self, table: Table, row: RecordedIndex, number: usize) -> Option<Cell> {
        self.check(row.home, "index");
        if let (Some(list), Some(owner)) = (row.owner, self.owner(table))
            && list != owner
        {
            self.refuse(Misuse::RowOfAnotherList);
        }
        self.is_inside(table, row.max, number).then_some(Cell {
            table,
            row: row.row,
            number,
        })
    }

    /// Is there such a row and number in the table?
    pub(super) fn is_inside(&mut self, table: Table, row: usize, number: usize) -> bool {
        if row >= table.rows || number >= table.stride {
            self.refuse(Misuse::OutsideTable { table, row, number });
        }
        !self.failed()
    }

    /// The number of a table of the model that an index names, checked; none after a misuse.
    pub(super) fn entry(
        &mut self,
        table: Fixed,
        row: RecordedIndex,
        number: usize,
    ) -> Option<Entry> {
        self.check(row.home, "index");
        self.is_inside_fixed(table, row.max, number)
            .then_some(Entry {
                table,
                row: row.row,
                number,
            })
    }

    /// Is there such a row and number in the table of the model?
    pub(super) fn is_inside_fixed(&mut self, table: Fixed, row: usize, number: usize) -> bool {
        if row >= table.rows || number >= table.stride {
            self.refuse(Misuse::OutsideFixed { table, row, number });
        }
        !self.failed()
    }

    /// Number `number` of the row of a table of the model that is nearest to `row`.
    pub(super) fn pick(&mut self, table: Fixed, row: Operand, number: usize) -> Operand {
        let row = self.max(row, Operand::number(0.0));
        let row = self.min(row, Operand::number(table.rows as f32 - 1.0));
        match row.constant() {
            Some(row) => self.value(Op::Constant(Entry {
                table,
                row: Row::At(row.to_usize()),
                number,
            })),
            None => self.value(Op::Pick { table, row, number }),
        }
    }

    /// A fact that was learnt inside the present round of the innermost loop, or outside of all
    /// loops: what a body has yet to change is not known when it starts.
    fn fact(&self, look: impl Fn(&Facts) -> Option<Operand>) -> Option<Operand> {
        for block in self.open.iter().rev() {
            if let Some(known) = look(&block.facts) {
                return Some(known);
            }
            if matches!(block.kind, Kind::Round { .. }) {
                return None;
            }
        }
        None
    }

    /// The present value of a variable or the present length of a list.
    pub(super) fn get(&mut self, name: u32, op: Op) -> Operand {
        if let Some(known) = self.fact(|f| f.name(name)) {
            return known;
        }
        let value = self.fresh(op);
        self.innermost_mut().facts.learn_name(name, value);
        value
    }

    pub(super) fn known(&self, name: u32) -> Option<Operand> {
        self.fact(|f| f.name(name))
    }

    pub(super) fn assign(&mut self, name: u32, value: Operand) {
        self.forget(name);
        self.innermost_mut().facts.learn_name(name, value);
    }

    pub(super) fn forget(&mut self, name: u32) {
        for block in &mut self.open {
            block.facts.forget_name(name);
        }
    }

    pub(super) fn load(&mut self, cell: Cell) -> Operand {
        self.meet_table(cell.table);
        if let Some(known) = self.fact(|f| f.cell(cell)) {
            return known;
        }
        let value = self.fresh(Op::Load(cell));
        self.innermost_mut().facts.learn_cell(cell, value);
        value
    }

    pub(super) fn store(&mut self, cell: Cell, value: Operand) {
        self.meet_table(cell.table);
        for i in 0..self.tables.len() {
            let table = self.tables[i];
            if overlap(table, cell.table) {
                self.open
                    .iter_mut()
                    .for_each(|b| b.facts.forget_table(table));
            }
        }
        self.open.iter_mut().for_each(|b| b.facts.forget_cell(cell));
        self.innermost_mut().facts.learn_cell(cell, value);
        self.emit(Statement::Store { cell, value });
    }

    fn meet_table(&mut self, table: Table) {
        if !self.tables.contains(&table) {
            self.tables.push(table);
        }
    }

    /// Notes whose rows a table holds from now on; none: rows chosen by number.
    pub(super) fn own(&mut self, table: Table, list: Option<Owner>) {
        match list {
            Some(list) => self.owners.insert(table, list),
            None => self.owners.remove(&table),
        };
    }

    pub(super) fn owner(&self, table: Table) -> Option<Owner> {
        self.owners.get(&table).copied()
    }
}

/// Are these two rows certainly not the same? An index may meet any row.
fn differ(a: Row, b: Row) -> bool {
    matches!((a, b), (Row::At(i), Row::At(j)) if i != j)
}

/// Do two different tables share memory?
fn overlap(a: Table, b: Table) -> bool {
    a != b && a.base < b.base + b.rows * b.stride && b.base < a.base + a.rows * a.stride
}

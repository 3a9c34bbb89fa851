//! Variables, lists and scratch memory of a recording: reads, writes, and what is known after them.
//!
//! A lane is a thread is a world: inside a block the thread is active, so it loads what it stored last, whatever the mask was on the
//! CPU.

use crate::error::Misuse;
use crate::ir::tree::{Cell, Entry, Op, Operand, Row, Statement};
use crate::recorder::handles::{Owner, RecordedIndex};
use crate::recorder::known_values::KnownValues;
use crate::recorder::state::{Kind, State};
use sim_physics::lane::{Fixed, Real, Table};

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

    /// Whether the table has the row and the column.
    pub(super) fn is_inside(&mut self, table: Table, row: usize, number: usize) -> bool {
        if row >= table.rows || number >= table.stride {
            self.refuse(Misuse::OutsideTable { table, row, number });
        }
        !self.failed()
    }

    /// The entry of a table of the model that an index names, checked; none after a misuse.
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

    /// Whether the table of the model has the row and the column.
    pub(super) fn is_inside_fixed(&mut self, table: Fixed, row: usize, number: usize) -> bool {
        if row >= table.rows || number >= table.stride {
            self.refuse(Misuse::OutsideFixed { table, row, number });
        }
        !self.failed()
    }

    /// Column `number` of the row of a table of the model that is nearest to `row`.
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

    /// A fact that was learnt inside the present iteration of the innermost loop, or outside of all
    /// loops: what a body has yet to change is not known when it starts.
    fn fact(&self, look: impl Fn(&KnownValues) -> Option<Operand>) -> Option<Operand> {
        for block in self.open.iter().rev() {
            if let Some(known) = look(&block.known) {
                return Some(known);
            }
            if matches!(block.kind, Kind::Iteration { .. }) {
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
        self.innermost_mut().known.learn_name(name, value);
        value
    }

    pub(super) fn known(&self, name: u32) -> Option<Operand> {
        self.fact(|f| f.name(name))
    }

    pub(super) fn assign(&mut self, name: u32, value: Operand) {
        self.forget(name);
        self.innermost_mut().known.learn_name(name, value);
    }

    pub(super) fn forget(&mut self, name: u32) {
        for block in &mut self.open {
            block.known.forget_name(name);
        }
    }

    pub(super) fn load(&mut self, cell: Cell) -> Operand {
        self.meet_table(cell.table);
        if let Some(known) = self.fact(|f| f.cell(cell)) {
            return known;
        }
        let value = self.fresh(Op::Load(cell));
        self.innermost_mut().known.learn_cell(cell, value);
        value
    }

    pub(super) fn store(&mut self, cell: Cell, value: Operand) {
        self.meet_table(cell.table);
        for i in 0..self.tables.len() {
            let table = self.tables[i];
            if overlap(table, cell.table) {
                self.open
                    .iter_mut()
                    .for_each(|b| b.known.forget_table(table));
            }
        }
        self.open.iter_mut().for_each(|b| b.known.forget_cell(cell));
        self.innermost_mut().known.learn_cell(cell, value);
        self.emit(Statement::Store { cell, value });
    }

    fn meet_table(&mut self, table: Table) {
        if !self.tables.contains(&table) {
            self.tables.push(table);
        }
    }

    /// Sets whose rows a table holds from now on; none: rows chosen by index.
    pub(super) fn set_owner(&mut self, table: Table, list: Option<Owner>) {
        match list {
            Some(list) => self.owners.insert(table, list),
            None => self.owners.remove(&table),
        };
    }

    pub(super) fn owner(&self, table: Table) -> Option<Owner> {
        self.owners.get(&table).copied()
    }
}

/// Do two different tables share memory?
fn overlap(a: Table, b: Table) -> bool {
    a != b && a.base < b.base + b.rows * b.stride && b.base < a.base + a.rows * a.stride
}

//! Values that are known at a point of a recording: variables, lengths of lists, and cells of scratch memory.

use crate::ir::tree::{Cell, Operand, Row};
use sim_physics::lane::Table;
use std::collections::HashMap;

/// Values known in one open block.
#[derive(Default)]
pub(crate) struct KnownValues {
    /// Variables and lengths of lists, by name.
    names: HashMap<u32, Operand>,
    cells: HashMap<(Table, usize), Vec<(Row, Operand)>>,
}

impl KnownValues {
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

/// Are these two rows certainly not the same? An index may meet any row.
fn differ(a: Row, b: Row) -> bool {
    matches!((a, b), (Row::At(i), Row::At(j)) if i != j)
}

//! Lists of rows. An ordinary list is counted in a variable. A kept list is counted in scratch memory, which is read at every use, so
//! that two handles on one list agree.

use crate::ir::tree::{Bounds, Op, Operand, Row, Statement};
use crate::recorder::handles::{Extent, Kept, OpenBlock, Opened, Owner, RecordedLoop};
use crate::recorder::handles::{RecordedBlock, RecordedIndex, RecordedList, RecordedRow};
use crate::recorder::state::{Kind, State};
use sim_physics::lane::{Real, Table};

impl State {
    pub(super) fn list(&mut self, capacity: usize) -> RecordedList {
        let name = self.name();
        self.emit(Statement::List {
            name,
            rows: Operand::number(0.0),
        });
        self.assign(name, Operand::number(0.0));
        self.list_of(name, Extent::Own { capacity })
    }

    pub(super) fn kept(
        &mut self,
        counts: Table,
        at: RecordedIndex,
        first: RecordedIndex,
        capacity: RecordedIndex,
    ) -> RecordedList {
        self.check(first.home, "index");
        self.check(capacity.home, "index");
        let name = self.name();
        let extent = match self.cell(counts, at, 0) {
            Some(count) => Extent::Kept(Kept {
                count,
                first: first.row,
                capacity: capacity.row,
                capacity_max: capacity.max,
                end: first.max + capacity.max,
            }),
            None => Extent::Own { capacity: 0 },
        };
        self.list_of(name, extent)
    }

    fn list_of(&self, name: u32, extent: Extent) -> RecordedList {
        RecordedList {
            name,
            extent,
            home: self.here(),
        }
    }

    pub(super) fn pushed(&mut self, list: &RecordedList) -> Operand {
        match list.extent {
            Extent::Own { .. } => self.get(list.name, Op::Count(list.name)),
            Extent::Kept(kept) => self.load(kept.count),
        }
    }

    /// Opens the block of a push, whose mask may hold.
    pub(super) fn push(
        &mut self,
        list: &RecordedList,
        mask: Operand,
    ) -> (RecordedBlock, Option<RecordedRow>) {
        let depth = self.depth();
        let (opened, row) = match list.extent {
            Extent::Own { capacity } => {
                self.forget(list.name);
                let row = self.name();
                self.enter(Kind::Push { list: list.name });
                let opened = Opened::Push {
                    list: list.name,
                    capacity,
                    row,
                };
                let owner = Owner::List(list.name);
                (opened, Some((Row::Name(row), capacity, owner)))
            }
            Extent::Kept(kept) => {
                self.enter(Kind::Push { list: list.name });
                let count = self.load(kept.count);
                let more = self.add(count, Operand::number(1.0));
                self.store(kept.count, more);
                let capacity = self.number(kept.capacity);
                let fits = match kept.capacity_max {
                    0 => Operand::Truth(false),
                    _ => self.lt(count, capacity),
                };
                if fits == Operand::Truth(false) {
                    (Opened::Kept { fits: None }, None)
                } else {
                    self.enter(Kind::Push { list: list.name });
                    let row = self.after(kept.first, count);
                    let owner = Owner::Kept(kept.count.table);
                    let opened = Opened::Kept { fits: Some(fits) };
                    (opened, Some((row, kept.end, owner)))
                }
            }
        };
        let home = self.here();
        let row = row.map(|(row, end, owner)| RecordedRow {
            row,
            end,
            list: list.name,
            owner,
            home,
        });
        let block = OpenBlock {
            mask,
            depth,
            opened,
        };
        (RecordedBlock(Some(block)), row)
    }

    /// Closes the block of a `when!` or a push.
    pub(super) fn close(&mut self, block: OpenBlock) {
        if let Opened::Kept { fits: Some(fits) } = block.opened {
            let body = self.leave(block.depth + 1);
            if !self.failed() {
                self.emit_when(fits, body);
            }
        }
        let body = self.leave(block.depth);
        if self.failed() {
            return;
        }
        let mask = block.mask;
        match block.opened {
            Opened::Push {
                list,
                capacity,
                row,
            } => self.emit(Statement::Push {
                list,
                capacity,
                row,
                mask,
                body,
            }),
            Opened::When | Opened::Kept { .. } => self.emit_when(mask, body),
        }
    }

    pub(super) fn rows(&mut self, list: &RecordedList) -> RecordedLoop {
        match list.extent {
            Extent::Own { capacity } => {
                let bounds = Bounds::Rows {
                    list: list.name,
                    capacity,
                };
                self.open_loop("each!", bounds, capacity, Some(Owner::List(list.name)))
            }
            Extent::Kept(Kept {
                capacity_max: 0, ..
            }) => RecordedLoop(None),
            Extent::Kept(kept) => {
                let count = self.load(kept.count);
                let capacity = self.number(kept.capacity);
                let held = self.min(count, capacity);
                let bounds = Bounds::Span {
                    first: kept.first,
                    end: self.after(kept.first, held),
                };
                let owner = Owner::Kept(kept.count.table);
                self.open_loop("each!", bounds, kept.end, Some(owner))
            }
        }
    }

    /// An index as a scalar.
    pub(super) fn number(&mut self, row: Row) -> Operand {
        match row {
            Row::At(i) => Operand::number(i as f32),
            _ => self.value(Op::Number(row)),
        }
    }

    /// The index that lies `n` after `row`.
    fn after(&mut self, row: Row, n: Operand) -> Row {
        match (row, n.constant()) {
            (Row::At(i), Some(n)) => Row::At(i + n.to_usize()),
            (_, Some(0.0)) => row,
            _ => match self.value(Op::After(row, n)) {
                Operand::Value(number) => Row::Value(number),
                _ => unreachable!("a computed index is a value"),
            },
        }
    }
}

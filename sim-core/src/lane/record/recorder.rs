//! The recording machine: blocks and loops of the text become statements.

use super::error::Misuse;
use super::handles::{
    OpenBlock, RecordedBlock, RecordedIndex, RecordedList, RecordedLoop, RecordedRow,
    RecordedVariable,
};
use super::state::{Kind, NOWHERE, with};
use super::tree::{Cell, Op, Operand, Rounds, Row, Statement};
use super::{Recorded, RecordedMask};
use crate::lane::{Cx, Fixed, Table};
use std::marker::PhantomData;
use std::panic::Location;

/// The machine that [`super::record`] hands to a text. It stays on its thread.
pub struct Recorder {
    thread: PhantomData<*const ()>,
}

impl Recorder {
    pub(super) fn new() -> Recorder {
        Recorder {
            thread: PhantomData,
        }
    }
}

impl Cx for Recorder {
    type F = Recorded;
    type V = RecordedVariable;
    type I = RecordedIndex;
    type Row = RecordedRow;
    type Loop = RecordedLoop;
    type Block = RecordedBlock;
    type List = RecordedList;

    #[track_caller]
    fn var(&mut self, x: Recorded) -> RecordedVariable {
        with(Location::caller(), |s| {
            let value = s.see(x);
            let name = s.name();
            s.emit(Statement::Var { name, value });
            s.assign(name, value);
            RecordedVariable {
                name,
                home: s.here(),
            }
        })
    }

    #[track_caller]
    fn get(&self, v: &RecordedVariable) -> Recorded {
        with(Location::caller(), |s| {
            s.check(v.home, "variable");
            let value = s.get(v.name, Op::Get(v.name));
            s.handle(value)
        })
    }

    #[track_caller]
    fn set(&mut self, v: &mut RecordedVariable, x: Recorded) {
        with(Location::caller(), |s| {
            s.check(v.home, "variable");
            let value = s.see(x);
            if s.known(v.name) != Some(value) {
                s.emit(Statement::Set {
                    name: v.name,
                    value,
                });
                s.assign(v.name, value);
            }
        });
    }

    fn at(&self, i: usize) -> RecordedIndex {
        RecordedIndex {
            row: Row::At(i),
            max: i,
            list: None,
            home: NOWHERE,
        }
    }

    fn put(&mut self, _v: &mut RecordedVariable, _x: Recorded) {
        unimplemented!()
    }
    fn only(&mut self, _x: Recorded) -> Recorded {
        unimplemented!()
    }
    fn number(&mut self, _i: RecordedIndex) -> Recorded {
        unimplemented!()
    }
    fn constant(&mut self, _t: Fixed, _row: RecordedIndex, _k: usize) -> Recorded {
        unimplemented!()
    }
    fn pick(&mut self, _t: Fixed, _row: Recorded, _k: usize) -> Recorded {
        unimplemented!()
    }
    fn index(&mut self, _t: Fixed, _row: RecordedIndex, _k: usize, _end: usize) -> RecordedIndex {
        unimplemented!()
    }
    fn kept(
        &mut self,
        _counts: Table,
        _at: RecordedIndex,
        _first: RecordedIndex,
        _capacity: RecordedIndex,
    ) -> RecordedList {
        unimplemented!()
    }
    fn span(&mut self, _first: RecordedIndex, _end: RecordedIndex) -> RecordedLoop {
        unimplemented!()
    }

    #[track_caller]
    fn load(&mut self, t: Table, row: RecordedIndex, k: usize) -> Recorded {
        with(Location::caller(), |s| {
            let value = match s.cell(t, row, k) {
                Some(cell) => s.load(cell),
                None => Operand::number(0.0),
            };
            s.handle(value)
        })
    }

    #[track_caller]
    fn store(&mut self, t: Table, row: RecordedIndex, k: usize, x: Recorded) {
        with(Location::caller(), |s| {
            let value = s.see(x);
            if let Some(cell) = s.cell(t, row, k) {
                if row.list.is_none() {
                    s.own(t, None);
                }
                s.store(cell, value);
            }
        });
    }

    #[track_caller]
    fn fill(&mut self, t: Table, row: RecordedIndex, k: usize, x: Recorded) {
        self.store(t, row, k, x);
    }

    #[track_caller]
    fn init(&mut self, t: Table, row: RecordedRow, k: usize, x: Recorded) {
        with(Location::caller(), |s| {
            let value = s.see(x);
            s.check(row.home, "row");
            if s.failed() {
                return;
            }
            if s.pushing() != Some(row.list) {
                return s.refuse(Misuse::RowOfAnotherList);
            }
            if s.is_inside(t, row.capacity.saturating_sub(1), k) {
                s.own(t, Some(row.list));
                s.store(
                    Cell {
                        table: t,
                        row: Row::Name(row.name),
                        number: k,
                    },
                    value,
                );
            }
        });
    }

    #[track_caller]
    fn list(&mut self, capacity: usize) -> RecordedList {
        with(Location::caller(), |s| {
            let name = s.name();
            s.emit(Statement::List { name });
            s.assign(name, Operand::number(0.0));
            RecordedList {
                name,
                capacity,
                home: s.here(),
            }
        })
    }

    #[track_caller]
    fn push(
        &mut self,
        list: &mut RecordedList,
        mask: RecordedMask,
    ) -> (RecordedBlock, Option<RecordedRow>) {
        with(Location::caller(), |s| {
            s.check(list.home, "list");
            let mask = s.see(mask.0);
            if mask == Operand::Truth(false) || s.failed() {
                return (RecordedBlock(None), None);
            }
            s.forget(list.name);
            let (name, depth) = (s.name(), s.depth());
            s.enter(Kind::Push { list: list.name });
            let row = RecordedRow {
                name,
                list: list.name,
                capacity: list.capacity,
                home: s.here(),
            };
            let block = OpenBlock {
                mask,
                row: Some(row),
                depth,
            };
            (RecordedBlock(Some(block)), Some(row))
        })
    }

    #[track_caller]
    fn pushed(&mut self, list: &RecordedList) -> Recorded {
        with(Location::caller(), |s| {
            s.check(list.home, "list");
            let count = s.get(list.name, Op::Count(list.name));
            s.handle(count)
        })
    }

    #[track_caller]
    fn enter(&mut self, mask: RecordedMask) -> (RecordedBlock, bool) {
        with(Location::caller(), |s| {
            let mask = s.see(mask.0);
            if mask == Operand::Truth(false) || s.failed() {
                return (RecordedBlock(None), false);
            }
            let depth = s.depth();
            s.enter(Kind::When);
            (
                RecordedBlock(Some(OpenBlock {
                    mask,
                    row: None,
                    depth,
                })),
                true,
            )
        })
    }

    #[track_caller]
    fn leave(&mut self, block: RecordedBlock) {
        let Some(block) = block.0 else { return };
        with(Location::caller(), |s| {
            let body = s.leave(block.depth);
            if s.failed() {
                return;
            }
            match block.row {
                Some(row) => s.emit(Statement::Push {
                    list: row.list,
                    capacity: row.capacity,
                    row: row.name,
                    mask: block.mask,
                    body,
                }),
                None if block.mask == Operand::Truth(true) => {
                    body.into_iter().for_each(|statement| s.emit(statement));
                }
                None => s.emit(Statement::When {
                    mask: block.mask,
                    body,
                }),
            }
        });
    }

    #[track_caller]
    fn rows(&mut self, list: &RecordedList) -> RecordedLoop {
        with(Location::caller(), |s| {
            s.check(list.home, "list");
            s.open_loop(
                "each!",
                Rounds::Rows {
                    list: list.name,
                    capacity: list.capacity,
                },
            )
        })
    }

    #[track_caller]
    fn times(&mut self, n: usize) -> RecordedLoop {
        with(Location::caller(), |s| {
            s.open_loop("times!", Rounds::Times(n))
        })
    }

    #[track_caller]
    fn next(&mut self, l: &mut RecordedLoop) -> Option<RecordedIndex> {
        with(Location::caller(), |s| {
            let open = l.0.as_mut()?;
            let goes_on = !s.failed() && s.next_round(open);
            if !goes_on || s.failed() {
                l.0 = None;
                return None;
            }
            let list = match open.rounds {
                Rounds::Times(_) => None,
                Rounds::Rows { list, .. } => Some(list),
            };
            let row = Row::Name(open.index);
            Some(RecordedIndex {
                row,
                max: open.rounds.max() - 1,
                list,
                home: s.here(),
            })
        })
    }

    #[track_caller]
    fn stop(&mut self, mask: RecordedMask) -> bool {
        with(Location::caller(), |s| {
            let mask = s.see(mask.0);
            match s.kind_here() {
                Kind::Round { .. } if mask == Operand::Truth(false) => {}
                Kind::Round { .. } => s.emit(Statement::Stop(mask)),
                kind => s.refuse(Misuse::BreakInBlock { block: kind.name() }),
            }
        });
        false
    }
}

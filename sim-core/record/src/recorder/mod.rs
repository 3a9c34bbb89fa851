//! The recorder: blocks and loops of physics code become statements.

mod fold;
pub(crate) mod handles;
mod iterations;
mod known_values;
mod lists;
mod loops;
mod memory;
mod options;
mod scalar;
pub(crate) mod state;

use crate::error::Misuse;
use crate::ir::tree::{Binary, Bounds, Cell, Op, Operand, Row, Statement};
use crate::recorder::handles::{
    NOWHERE, OpenBlock, Opened, Recorded, RecordedBlock, RecordedIndex, RecordedList, RecordedLoop,
    RecordedMask, RecordedRow, RecordedVariable,
};
use crate::recorder::state::{Kind, with};
use sim_physics::lane::{Cx, Fixed, Table};
use std::marker::PhantomData;
use std::panic::Location;

/// The execution context that [`crate::record`] gives to physics code. It stays on its thread.
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

    const GATHERS_LOADS: bool = true;
    const TAKES_HEAPS: bool = true;

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

    #[track_caller]
    fn anywhere(&mut self, mask: RecordedMask) -> bool {
        with(Location::caller(), |s| {
            if !s.assumes || s.kind_here() != Kind::Whole {
                return true;
            }
            let mask = s.see(mask.0);
            s.assumed = Some(match s.assumed {
                Some(before) => s.or(before, mask),
                None => mask,
            });
            false
        })
    }

    #[track_caller]
    fn updates_factors(&self) -> bool {
        with(Location::caller(), |s| s.updates_factors)
    }

    #[track_caller]
    fn lanes(&self) -> usize {
        with(Location::caller(), |s| s.lanes)
    }

    #[track_caller]
    fn own(&mut self, values: &[Recorded]) -> Recorded {
        with(Location::caller(), |s| {
            let lanes = s.lanes;
            let zero = Operand::number(0.0);
            let values: Vec<Operand> = values.iter().map(|x| s.see(*x)).collect();
            let value = |lane: usize| values.get(lane).copied().unwrap_or(zero);
            let mut selected = value(0);
            for lane in (1..lanes).filter(|&lane| value(lane) != value(lane - 1)) {
                let number = s.value(Op::Lane);
                let mask = s.value(Op::Binary(
                    Binary::Lt,
                    Operand::number(lane as f32 - 0.5),
                    number,
                ));
                selected = s.value(Op::Select(mask, value(lane), selected));
            }
            s.handle(selected)
        })
    }

    #[track_caller]
    fn of_lane(&mut self, x: Recorded, lane: usize) -> Recorded {
        with(Location::caller(), |s| {
            let x = s.see(x);
            let value = match x {
                Operand::Value(_) if s.lanes > 1 => s.value(Op::FromLane(x, lane)),
                x => x,
            };
            s.handle(value)
        })
    }

    #[track_caller]
    fn sum_lanes(&mut self, x: Recorded) -> Recorded {
        with(Location::caller(), |s| {
            let x = s.see(x);
            let sum = s.over_lanes(x, Binary::Add);
            s.handle(sum)
        })
    }

    #[track_caller]
    fn max_lanes(&mut self, x: Recorded) -> Recorded {
        with(Location::caller(), |s| {
            let x = s.see(x);
            let most = s.over_lanes(x, Binary::Max);
            s.handle(most)
        })
    }

    #[track_caller]
    fn load_at(&mut self, t: Table, row: RecordedIndex, k: usize, column: Recorded) -> Recorded {
        with(Location::caller(), |s| {
            let column = s.see(column);
            let value = match s.cell(t, row, k) {
                // what a store may change is never shared
                Some(cell) => s.fresh(Op::LoadAt(cell, column)),
                None => Operand::number(0.0),
            };
            s.handle(value)
        })
    }

    fn at(&self, i: usize) -> RecordedIndex {
        RecordedIndex {
            row: Row::At(i),
            max: i,
            owner: None,
            home: NOWHERE,
        }
    }

    #[track_caller]
    fn put(&mut self, v: &mut RecordedVariable, x: Recorded) {
        self.set(v, x);
    }

    #[track_caller]
    fn only(&mut self, x: Recorded) -> Recorded {
        with(Location::caller(), |s| {
            // a program runs where the world is active
            let x = s.see(x);
            s.handle(x)
        })
    }

    #[track_caller]
    fn number(&mut self, i: RecordedIndex) -> Recorded {
        with(Location::caller(), |s| {
            s.check(i.home, "index");
            let x = match s.failed() {
                true => Operand::number(0.0),
                false => s.number(i.row),
            };
            s.handle(x)
        })
    }

    #[track_caller]
    fn constant(&mut self, t: Fixed, row: RecordedIndex, k: usize) -> Recorded {
        with(Location::caller(), |s| {
            let x = match s.entry(t, row, k) {
                Some(entry) => s.value(Op::Constant(entry)),
                None => Operand::number(0.0),
            };
            s.handle(x)
        })
    }

    #[track_caller]
    fn pick(&mut self, t: Fixed, row: Recorded, k: usize) -> Recorded {
        with(Location::caller(), |s| {
            let row = s.see(row);
            let x = match s.is_inside_fixed(t, 0, k) {
                true => s.pick(t, row, k),
                false => Operand::number(0.0),
            };
            s.handle(x)
        })
    }

    #[track_caller]
    fn index(&mut self, t: Fixed, row: RecordedIndex, k: usize, end: usize) -> RecordedIndex {
        with(Location::caller(), |s| {
            let entry = s.entry(t, row, k);
            let row = match entry.map(|entry| s.value(Op::Index { entry, end })) {
                Some(Operand::Value(number)) => Row::Value(number),
                _ => Row::At(0),
            };
            RecordedIndex {
                row,
                max: end.saturating_sub(1),
                owner: None,
                home: s.here(),
            }
        })
    }

    #[track_caller]
    fn kept(
        &mut self,
        counts: Table,
        at: RecordedIndex,
        first: RecordedIndex,
        capacity: RecordedIndex,
    ) -> RecordedList {
        with(Location::caller(), |s| s.kept(counts, at, first, capacity))
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
                if row.owner.is_none() {
                    s.set_owner(t, None);
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
            if s.is_inside(t, row.end.saturating_sub(1), k) {
                s.set_owner(t, Some(row.owner));
                s.store(
                    Cell {
                        table: t,
                        row: row.row,
                        number: k,
                    },
                    value,
                );
            }
        });
    }

    #[track_caller]
    fn list(&mut self, capacity: usize) -> RecordedList {
        with(Location::caller(), |s| s.list(capacity))
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
            s.push(list, mask)
        })
    }

    #[track_caller]
    fn pushed(&mut self, list: &RecordedList) -> Recorded {
        with(Location::caller(), |s| {
            s.check(list.home, "list");
            let count = match s.failed() {
                true => Operand::number(0.0),
                false => s.pushed(list),
            };
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
                    depth,
                    opened: Opened::When,
                })),
                true,
            )
        })
    }

    #[track_caller]
    fn leave(&mut self, block: RecordedBlock) {
        let Some(block) = block.0 else { return };
        with(Location::caller(), |s| s.close(block));
    }

    #[track_caller]
    fn rows(&mut self, list: &RecordedList) -> RecordedLoop {
        with(Location::caller(), |s| {
            s.check(list.home, "list");
            match s.failed() {
                true => RecordedLoop(None),
                false => s.rows(list),
            }
        })
    }

    #[track_caller]
    fn times(&mut self, n: usize) -> RecordedLoop {
        with(Location::caller(), |s| {
            let bounds = Bounds::Span {
                first: Row::At(0),
                end: Row::At(n),
            };
            s.open_loop("times!", bounds, n, None)
        })
    }

    #[track_caller]
    fn span(&mut self, first: RecordedIndex, end: RecordedIndex) -> RecordedLoop {
        with(Location::caller(), |s| {
            s.check(first.home, "index");
            s.check(end.home, "index");
            let bounds = Bounds::Span {
                first: first.row,
                end: end.row,
            };
            s.open_loop("span!", bounds, end.max, None)
        })
    }

    #[track_caller]
    fn next(&mut self, l: &mut RecordedLoop) -> Option<RecordedIndex> {
        with(Location::caller(), |s| {
            let open = l.0.as_mut()?;
            let goes_on = !s.failed() && s.next_iteration(open);
            if !goes_on || s.failed() {
                l.0 = None;
                return None;
            }
            Some(RecordedIndex {
                row: Row::Name(open.index),
                max: open.end - 1,
                owner: open.owner,
                home: s.here(),
            })
        })
    }

    #[track_caller]
    fn stop(&mut self, mask: RecordedMask) -> bool {
        with(Location::caller(), |s| {
            let mask = s.see(mask.0);
            match s.kind_here() {
                Kind::Iteration { .. } if mask == Operand::Truth(false) => {}
                Kind::Iteration { .. } => s.emit(Statement::Stop(mask)),
                kind => s.refuse(Misuse::BreakInBlock { block: kind.name() }),
            }
        });
        false
    }
}

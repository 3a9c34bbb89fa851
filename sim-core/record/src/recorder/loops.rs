//! Loops of a recording.
//!
//! A loop's body is recorded twice. Values of the first iteration are closed when the second begins, so that using one is detected. If
//! the two iterations differ in anything but the numbering of their values, a native variable was carried from one to the next. The
//! second recording is kept.

use crate::error::{MAX_NESTING, Misuse};
use crate::ir::tree::{Bounds, Row, Statement};
use crate::recorder::handles::{OpenLoop, Owner, Progress, RecordedLoop};
use crate::recorder::iterations::{Difference, Pair};
use crate::recorder::state::{Kind, State};

impl State {
    /// Opens a loop whose indices lie below `end`; it has not started.
    pub(super) fn open_loop(
        &mut self,
        block: &'static str,
        bounds: Bounds,
        end: usize,
        owner: Option<Owner>,
    ) -> RecordedLoop {
        if self.loops_open() >= MAX_NESTING {
            self.refuse(Misuse::TooDeep);
        }
        let is_empty = match bounds {
            Bounds::Span { first, end } if first == end => true,
            Bounds::Span {
                first: Row::At(first),
                ..
            } => first >= end,
            _ => end == 0,
        };
        if is_empty {
            return RecordedLoop(None);
        }
        RecordedLoop(Some(OpenLoop {
            block,
            index: self.name(),
            bounds,
            end,
            owner,
            depth: self.depth(),
            opened: self.place(),
            progress: Progress::Start,
        }))
    }

    /// Starts the first or the second iteration, or closes the loop; true while there is an iteration.
    pub(super) fn next_iteration(&mut self, l: &mut OpenLoop) -> bool {
        let kind = Kind::Iteration {
            name: l.block,
            index: l.index,
        };
        match std::mem::replace(&mut l.progress, Progress::Start) {
            Progress::Start => {
                l.progress = Progress::First {
                    before: self.counters(),
                };
                self.enter(kind);
                true
            }
            Progress::First { before } => {
                let first = self.leave(l.depth);
                l.progress = Progress::Second {
                    before,
                    first,
                    between: self.counters(),
                };
                self.enter(kind);
                true
            }
            Progress::Second {
                before,
                first,
                between,
            } => {
                let body = self.leave(l.depth);
                let pair = Pair {
                    values: &self.values,
                    before,
                    between,
                };
                match pair.compare(&first, &body) {
                    Ok(()) => {
                        let (index, bounds) = (l.index, l.bounds);
                        self.emit(Statement::Loop {
                            index,
                            bounds,
                            body,
                        });
                    }
                    Err(Difference { constants, place }) => {
                        let block = l.block;
                        let misuse = match constants {
                            Some((first, second)) => Misuse::ConstantChanges {
                                block,
                                first,
                                second,
                            },
                            None => Misuse::IterationsDiffer { block },
                        };
                        self.refuse_at(misuse, place.unwrap_or(l.opened));
                    }
                }
                false
            }
        }
    }
}

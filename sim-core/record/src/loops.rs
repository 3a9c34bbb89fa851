//! Loops of a recording.
//!
//! A loop's body is recorded twice. The first round shows what the second may not rely on: a value
//! of the first is closed by then, and if the two rounds differ in anything but the numbers of
//! their values, something native went from one to the next. The second is kept.

use super::MAX_NESTING;
use super::error::{Misuse, Place};
use super::handles::{Owner, RecordedLoop};
use super::rounds::{Difference, Pair};
use super::state::{Counters, Kind, State};
use super::tree::{Rounds, Row, Statement};

#[derive(Debug)]
pub(super) struct OpenLoop {
    block: &'static str,
    pub index: u32,
    rounds: Rounds,
    /// Past the largest index.
    pub end: usize,
    /// Whose rows the loop runs over.
    pub owner: Option<Owner>,
    depth: usize,
    opened: Place,
    progress: Progress,
}

#[derive(Debug)]
enum Progress {
    Start,
    First {
        before: Counters,
    },
    Second {
        before: Counters,
        first: Vec<Statement>,
        between: Counters,
    },
}

impl State {
    /// Opens a loop whose indices lie below `end`; it has not started.
    pub(super) fn open_loop(
        &mut self,
        block: &'static str,
        rounds: Rounds,
        end: usize,
        owner: Option<Owner>,
    ) -> RecordedLoop {
        if self.loops_open() >= MAX_NESTING {
            self.refuse(Misuse::TooDeep);
        }
        let is_empty = match rounds {
            Rounds::Span { first, end } if first == end => true,
            Rounds::Span {
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
            rounds,
            end,
            owner,
            depth: self.depth(),
            opened: self.place(),
            progress: Progress::Start,
        }))
    }

    /// Starts the first or the second round, or closes the loop; true while there is a round.
    pub(super) fn next_round(&mut self, l: &mut OpenLoop) -> bool {
        let kind = Kind::Round {
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
                        let (index, rounds) = (l.index, l.rounds);
                        self.emit(Statement::Loop {
                            index,
                            rounds,
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
                            None => Misuse::RoundsDiffer { block },
                        };
                        self.refuse_at(misuse, place.unwrap_or(l.opened));
                    }
                }
                false
            }
        }
    }
}

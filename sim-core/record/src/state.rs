//! The recording under way on this thread: open blocks, values, and the first misuse.
//!
//! A misuse does not panic. It is kept, loops then end at once, and [`super::record`] returns it:
//! no native loop of a text waits for a recorded value, so the text still comes to its end.

use super::Recorded;
use super::error::{Misuse, Place, RecordError};
use super::facts::Facts;
use super::handles::Owner;
use super::tree::{Op, Operand, Statement};
use sim_physics::lane::Table;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// Where a value, variable, list, index or row was made: a block of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Home {
    /// 0: a constant made while nothing was recorded, good everywhere.
    recording: u32,
    block: u32,
}

/// The home of constants that were made outside of any recording.
pub(super) const NOWHERE: Home = Home {
    recording: 0,
    block: 0,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    /// One round of the loop with this index.
    Round {
        name: &'static str,
        index: u32,
    },
    When,
    /// Of the list handle with this name.
    Push {
        list: u32,
    },
}

impl Kind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::Text => "record",
            Kind::Round { name, .. } => name,
            Kind::When => "when!",
            Kind::Push { .. } => "push!",
        }
    }
}

pub(super) struct Block {
    number: u32,
    pub kind: Kind,
    opened: Place,
    statements: Vec<Statement>,
    values: HashMap<Op, u32>,
    pub facts: Facts,
}

pub(super) struct Value {
    pub op: Op,
    pub place: Place,
}

/// How many values and names there were at some point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counters {
    pub values: u32,
    pub names: u32,
}

pub(super) struct State {
    recording: u32,
    pub values: Vec<Value>,
    names: u32,
    pub open: Vec<Block>,
    /// Of every block ever opened, by number.
    kinds: Vec<Kind>,
    pub tables: Vec<Table>,
    /// Whose rows a table holds.
    pub owners: HashMap<Table, Owner>,
    error: Option<RecordError>,
    /// Where in the text the present operation is.
    place: Place,
}

thread_local! {
    static STATE: RefCell<Option<State>> = const { RefCell::new(None) };
}

/// Starts a recording; dropped, it restores what was under way before, even if the text panics.
pub(super) struct Session(Option<State>);

impl Session {
    pub(super) fn start(place: Place) -> Session {
        static RECORDINGS: AtomicU32 = AtomicU32::new(1);
        let mut state = State {
            recording: RECORDINGS.fetch_add(1, Ordering::Relaxed),
            values: Vec::new(),
            names: 0,
            open: Vec::new(),
            kinds: Vec::new(),
            tables: Vec::new(),
            owners: HashMap::new(),
            error: None,
            place,
        };
        state.enter(Kind::Text);
        Session(STATE.with(|s| s.replace(Some(state))))
    }

    /// Ends the recording.
    pub(super) fn finish(self) -> State {
        STATE
            .with(|s| s.take())
            .expect("a session is under way until it is finished")
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        STATE.with(|s| s.replace(self.0.take()));
    }
}

/// Works on the recording under way, for the operation of the text at `place`.
pub(super) fn with<R>(place: Place, f: impl FnOnce(&mut State) -> R) -> R {
    STATE.with(|s| {
        let mut state = s.borrow_mut();
        let state = state.as_mut().unwrap_or_else(|| {
            panic!("{place}: recorded numbers can be used only inside `sim_record::record`")
        });
        state.place = place;
        f(state)
    })
}

/// The block that is open now, if anything is recorded.
pub(super) fn here() -> Home {
    STATE.with(|s| s.borrow().as_ref().map_or(NOWHERE, State::here))
}

impl State {
    pub(super) fn here(&self) -> Home {
        Home {
            recording: self.recording,
            block: self.innermost().number,
        }
    }

    pub(super) fn kind_here(&self) -> Kind {
        self.innermost().kind
    }

    fn innermost(&self) -> &Block {
        self.open
            .last()
            .expect("the text's own block is open while it is recorded")
    }

    pub(super) fn innermost_mut(&mut self) -> &mut Block {
        self.open
            .last_mut()
            .expect("the text's own block is open while it is recorded")
    }

    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// Keeps the first misuse.
    pub(super) fn refuse(&mut self, misuse: Misuse) {
        self.refuse_at(misuse, self.place);
    }

    pub(super) fn refuse_at(&mut self, misuse: Misuse, place: Place) {
        self.error
            .get_or_insert_with(|| RecordError::new(misuse, place));
    }

    pub(super) fn failed(&self) -> bool {
        self.error.is_some()
    }

    pub(super) fn take_error(&mut self) -> Option<RecordError> {
        self.error.take()
    }

    /// Checks that what was made at `home` may be used here.
    pub(super) fn check(&mut self, home: Home, what: &'static str) {
        if home == NOWHERE {
            return;
        }
        if home.recording != self.recording {
            self.refuse(Misuse::OtherRecording { what });
        } else if !self.is_open(home) {
            let kind = self.kinds[home.block as usize];
            let block = kind.name();
            let is_next_round =
                matches!(kind, Kind::Round { .. }) && self.open.iter().any(|b| b.kind == kind);
            self.refuse(match what {
                "value" if is_next_round => Misuse::NextRound { block },
                "value" => Misuse::ValueLeaves { block },
                "row" => Misuse::RowAfterBlock,
                _ => Misuse::Closed { what, block },
            });
        }
    }

    fn is_open(&self, home: Home) -> bool {
        self.open.iter().any(|b| b.number == home.block)
    }

    /// What a recorded number or mask stands for. After a misuse 0 does for everything: its
    /// operand may be of another recording.
    pub(super) fn see(&mut self, x: Recorded) -> Operand {
        self.check(x.home, "value");
        if self.failed() {
            Operand::number(0.0)
        } else {
            x.operand
        }
    }

    /// A handle on an operand, to be used while the present block is open.
    pub(super) fn handle(&self, operand: Operand) -> Recorded {
        Recorded {
            operand,
            home: self.here(),
        }
    }

    pub(super) fn counters(&self) -> Counters {
        Counters {
            values: self.values.len() as u32,
            names: self.names,
        }
    }

    pub(super) fn name(&mut self) -> u32 {
        self.names += 1;
        self.names - 1
    }

    /// Input `i`, of which nothing has to be computed.
    pub(super) fn input(&mut self, i: u32) -> Operand {
        self.values.push(Value {
            op: Op::Input(i),
            place: self.place,
        });
        Operand::Value(self.values.len() as u32 - 1)
    }

    pub(super) fn emit(&mut self, statement: Statement) {
        self.innermost_mut().statements.push(statement);
    }

    /// The value of an operation that depends on nothing but its operands.
    pub(super) fn value(&mut self, op: Op) -> Operand {
        if let Some(known) = self.open.iter().rev().find_map(|b| b.values.get(&op)) {
            return Operand::Value(*known);
        }
        let value = self.fresh(op);
        if let Operand::Value(number) = value {
            self.innermost_mut().values.insert(op, number);
        }
        value
    }

    /// A new value, never shared.
    pub(super) fn fresh(&mut self, op: Op) -> Operand {
        let number = self.values.len() as u32;
        self.values.push(Value {
            op,
            place: self.place,
        });
        self.emit(Statement::Let(number));
        Operand::Value(number)
    }

    /// What stands in a block: where its mask always holds, without one.
    pub(super) fn emit_when(&mut self, mask: Operand, body: Vec<Statement>) {
        if mask == Operand::Truth(true) {
            self.innermost_mut().statements.extend(body);
        } else {
            self.emit(Statement::When { mask, body });
        }
    }

    pub(super) fn depth(&self) -> usize {
        self.open.len()
    }

    pub(super) fn loops_open(&self) -> usize {
        self.open
            .iter()
            .filter(|b| matches!(b.kind, Kind::Round { .. }))
            .count()
    }

    /// The list of the innermost open push.
    pub(super) fn pushing(&self) -> Option<u32> {
        self.open.iter().rev().find_map(|b| match b.kind {
            Kind::Push { list } => Some(list),
            _ => None,
        })
    }

    pub(super) fn enter(&mut self, kind: Kind) {
        let number = self.kinds.len() as u32;
        self.kinds.push(kind);
        self.open.push(Block {
            number,
            kind,
            opened: self.place,
            statements: Vec::new(),
            values: HashMap::new(),
            facts: Facts::default(),
        });
    }

    /// Closes the block at `depth`, which must be the innermost, and returns its statements.
    pub(super) fn leave(&mut self, depth: usize) -> Vec<Statement> {
        if let Some(left) = self.open.get(depth + 1) {
            let (kind, opened) = (left.kind, left.opened);
            self.refuse_at(Misuse::LeftOpen { block: kind.name() }, opened);
            self.open.truncate(depth + 1);
        }
        if self.open.len() != depth + 1 {
            assert!(self.failed(), "a block is closed once");
            return Vec::new();
        }
        self.open.pop().map(|b| b.statements).unwrap_or_default()
    }
}

//! The recording in progress on this thread: open blocks, values, and the first misuse.
//!
//! A misuse does not panic. It is stored, loops end at once, and [`crate::record`] returns it. No native loop waits for a recorded
//! value, so the code still reaches its end.

use crate::error::{Misuse, Place, RecordError};
use crate::ir::tree::{Binary, Op, Operand, Statement};
use crate::recorder::handles::{Counters, Home, NOWHERE, Owner, Recorded};
use crate::recorder::known_values::KnownValues;
use sim_physics::lane::Table;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The whole recording.
    Whole,
    /// One iteration of the loop with this index.
    Iteration {
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
    pub(crate) fn name(self) -> &'static str {
        match self {
            Kind::Whole => "record",
            Kind::Iteration { name, .. } => name,
            Kind::When => "when!",
            Kind::Push { .. } => "push!",
        }
    }
}

pub(crate) struct Scope {
    number: u32,
    pub kind: Kind,
    opened: Place,
    statements: Vec<Statement>,
    values: HashMap<Op, u32>,
    pub known: KnownValues,
}

pub(crate) struct Value {
    pub op: Op,
    pub place: Place,
    /// The part of the code that it belongs to.
    pub part: &'static str,
}

pub(crate) struct State {
    recording: u32,
    /// Threads per world.
    pub lanes: usize,
    /// Whether stiff contacts are added to factors.
    pub updates_factors: bool,
    /// Is what the code asks about some world taken to hold in none?
    pub assumes: bool,
    /// The mask that must hold nowhere, so far.
    pub assumed: Option<Operand>,
    pub values: Vec<Value>,
    names: u32,
    pub open: Vec<Scope>,
    /// Kinds of all blocks ever opened, by number.
    kinds: Vec<Kind>,
    pub tables: Vec<Table>,
    /// Whose rows a table holds.
    pub owners: HashMap<Table, Owner>,
    error: Option<RecordError>,
    /// Location of the present operation in the code.
    place: Place,
    /// The part of the code that is recorded now.
    pub part: &'static str,
}

thread_local! {
    static STATE: RefCell<Option<State>> = const { RefCell::new(None) };
}

/// A recording in progress. Dropping it restores the one before, even if the code panics.
pub(crate) struct Session(Option<State>);

impl Session {
    pub(crate) fn start(place: Place) -> Session {
        static RECORDINGS: AtomicU32 = AtomicU32::new(1);
        let mut state = State {
            recording: RECORDINGS.fetch_add(1, Ordering::Relaxed),
            lanes: 1,
            updates_factors: false,
            assumes: false,
            assumed: None,
            values: Vec::new(),
            names: 0,
            open: Vec::new(),
            kinds: Vec::new(),
            tables: Vec::new(),
            owners: HashMap::new(),
            error: None,
            place,
            part: "",
        };
        state.enter(Kind::Whole);
        Session(STATE.with(|s| s.replace(Some(state))))
    }

    /// Ends the recording.
    pub(crate) fn finish(self) -> State {
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

/// Calls `f` with the recording in progress, for the operation at `place` in the code.
pub(crate) fn with<R>(place: Place, f: impl FnOnce(&mut State) -> R) -> R {
    STATE.with(|s| {
        let mut state = s.borrow_mut();
        let state = state.as_mut().unwrap_or_else(|| {
            panic!("{place}: recorded scalars can be used only inside `sim_record::record`")
        });
        state.place = place;
        f(state)
    })
}

/// The block that is open now, if anything is recorded.
pub(crate) fn here() -> Home {
    STATE.with(|s| s.borrow().as_ref().map_or(NOWHERE, State::here))
}

impl State {
    pub(crate) fn here(&self) -> Home {
        Home {
            recording: self.recording,
            block: self.innermost().number,
        }
    }

    pub(crate) fn kind_here(&self) -> Kind {
        self.innermost().kind
    }

    fn innermost(&self) -> &Scope {
        self.open
            .last()
            .expect("the outermost block is open during a recording")
    }

    pub(crate) fn innermost_mut(&mut self) -> &mut Scope {
        self.open
            .last_mut()
            .expect("the outermost block is open during a recording")
    }

    pub(crate) fn place(&self) -> Place {
        self.place
    }

    /// Keeps the first misuse.
    pub(crate) fn refuse(&mut self, misuse: Misuse) {
        self.refuse_at(misuse, self.place);
    }

    pub(crate) fn refuse_at(&mut self, misuse: Misuse, place: Place) {
        self.error
            .get_or_insert_with(|| RecordError::new(misuse, place));
    }

    pub(crate) fn failed(&self) -> bool {
        self.error.is_some()
    }

    pub(crate) fn take_error(&mut self) -> Option<RecordError> {
        self.error.take()
    }

    /// Checks that what was made at `home` may be used here.
    pub(crate) fn check(&mut self, home: Home, what: &'static str) {
        if home == NOWHERE {
            return;
        }
        if home.recording != self.recording {
            self.refuse(Misuse::OtherRecording { what });
        } else if !self.is_open(home) {
            let kind = self.kinds[home.block as usize];
            let block = kind.name();
            let is_next_iteration =
                matches!(kind, Kind::Iteration { .. }) && self.open.iter().any(|b| b.kind == kind);
            self.refuse(match what {
                "value" if is_next_iteration => Misuse::NextIteration { block },
                "value" => Misuse::ValueLeaves { block },
                "row" => Misuse::RowAfterBlock,
                _ => Misuse::Closed { what, block },
            });
        }
    }

    fn is_open(&self, home: Home) -> bool {
        self.open.iter().any(|b| b.number == home.block)
    }

    /// The operand of a recorded scalar or mask. After a misuse it is always 0: its
    /// operand may be of another recording.
    pub(crate) fn see(&mut self, x: Recorded) -> Operand {
        self.check(x.home, "value");
        if self.failed() {
            Operand::number(0.0)
        } else {
            x.operand
        }
    }

    /// A handle on an operand, to be used while the present block is open.
    pub(crate) fn handle(&self, operand: Operand) -> Recorded {
        Recorded {
            operand,
            home: self.here(),
        }
    }

    pub(crate) fn counters(&self) -> Counters {
        Counters {
            values: self.values.len() as u32,
            names: self.names,
        }
    }

    pub(crate) fn name(&mut self) -> u32 {
        self.names += 1;
        self.names - 1
    }

    /// Input `i`, of which nothing has to be computed.
    pub(crate) fn input(&mut self, i: u32) -> Operand {
        self.values.push(Value {
            op: Op::Input(i),
            place: self.place,
            part: self.part,
        });
        Operand::Value(self.values.len() as u32 - 1)
    }

    pub(crate) fn emit(&mut self, statement: Statement) {
        self.innermost_mut().statements.push(statement);
    }

    /// The value of an operation that depends on nothing but its operands.
    pub(crate) fn value(&mut self, op: Op) -> Operand {
        if let Some(known) = self.open.iter().rev().find_map(|b| b.values.get(&op)) {
            return Operand::Value(*known);
        }
        let value = self.fresh(op);
        if let Operand::Value(number) = value {
            self.innermost_mut().values.insert(op, number);
        }
        value
    }

    /// An operation over the values of all lanes: of neighbours, then of pairs, and so on.
    pub(crate) fn over_lanes(&mut self, x: Operand, binary: Binary) -> Operand {
        let mut x = x;
        let mut apart = 1;
        while apart < self.lanes {
            let other = self.value(Op::AcrossLanes(x, apart));
            x = self.value(Op::Binary(binary, x, other));
            apart *= 2;
        }
        self.value(Op::Alike(x))
    }

    /// A new value, never shared.
    pub(crate) fn fresh(&mut self, op: Op) -> Operand {
        let number = self.values.len() as u32;
        self.values.push(Value {
            op,
            place: self.place,
            part: self.part,
        });
        self.emit(Statement::Let(number));
        Operand::Value(number)
    }

    /// What stands in a block: where its mask always holds, without one.
    pub(crate) fn emit_when(&mut self, mask: Operand, body: Vec<Statement>) {
        if mask == Operand::Truth(true) {
            self.innermost_mut().statements.extend(body);
        } else {
            self.emit(Statement::When { mask, body });
        }
    }

    pub(crate) fn depth(&self) -> usize {
        self.open.len()
    }

    pub(crate) fn loops_open(&self) -> usize {
        self.open
            .iter()
            .filter(|b| matches!(b.kind, Kind::Iteration { .. }))
            .count()
    }

    /// The list of the innermost open push.
    pub(crate) fn pushing(&self) -> Option<u32> {
        self.open.iter().rev().find_map(|b| match b.kind {
            Kind::Push { list } => Some(list),
            _ => None,
        })
    }

    pub(crate) fn enter(&mut self, kind: Kind) {
        let number = self.kinds.len() as u32;
        self.kinds.push(kind);
        self.open.push(Scope {
            number,
            kind,
            opened: self.place,
            statements: Vec::new(),
            values: HashMap::new(),
            known: KnownValues::default(),
        });
    }

    /// Closes the block at `depth`, which must be the innermost, and returns its statements.
    pub(crate) fn leave(&mut self, depth: usize) -> Vec<Statement> {
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

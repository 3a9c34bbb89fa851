//! The third machine: the text is not run but written down, as a tree that becomes a program.
//!
//! [`record`] hands a text a [`Recorder`] and its inputs as [`Recorded`] numbers, and returns what
//! was computed as a [`Recording`]. [`wgsl`] prints that as a program, [`split`] as several;
//! [`Recording::evaluate`] runs it on the CPU. Native loops are unrolled by it, constants folded in
//! `f32`, equal values shared within a block and the blocks around it, and what no output or store
//! depends on is left out.
//!
//! ```
//! use sim_physics::lane::{Cx, Num, Tables};
//! use sim_record::record;
//! use sim_physics::times;
//!
//! let doubled_thrice = record(1, |cx, x| {
//!     let mut sum = cx.var(x[0]);
//!     times!(cx, 3, {
//!         let twice = cx.get(&sum) * Num::c(2.0);
//!         cx.set(&mut sum, twice);
//!     });
//!     vec![cx.get(&sum)]
//! })
//! .unwrap();
//! assert_eq!(doubled_thrice.evaluate(&[5.0], &mut [], &Tables::default()), [40.0]);
//! ```
//!
//! What means one thing on this machine and another on a CPU lane is refused ([`Misuse`]): above
//! all a native `let mut` that goes through a loop or out of a block. Two things pass unseen, so a
//! stage is also compared with its scalar run: a native variable that is given, inside a block, a
//! value from before the block without any arithmetic; and one that takes two rounds to arrive.

mod error;
mod evaluate;
mod facts;
mod fold;
mod handles;
mod join;
mod lists;
mod live;
mod loops;
mod number;
mod pack;
mod recorder;
mod rounds;
pub mod split;
mod state;
pub(crate) mod tree;
pub mod wgsl;

pub use error::{Misuse, RecordError};
pub use handles::{
    RecordedBlock, RecordedIndex, RecordedList, RecordedLoop, RecordedRow, RecordedVariable,
};
pub use number::{Recorded, RecordedMask};
pub use recorder::Recorder;

use std::panic::Location;
use tree::{Cell, Op, Operand, Row, Statement};

/// Loops inside one another, at most: bodies are recorded twice, so a text takes 2^depth times.
pub const MAX_NESTING: usize = 4;

/// What a text computes, written down.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub(crate) inputs: usize,
    pub(crate) outputs: Vec<Operand>,
    /// How each value is computed, those of the inputs first; dead ones are in no statement.
    pub(crate) values: Vec<Op>,
    /// Variables, lists, indices and rows are numbered below this.
    pub(crate) names: usize,
    /// Numbers of scratch memory that the tables reach.
    pub(crate) scratch: usize,
    pub(crate) body: Vec<Statement>,
}

/// Statements of a recording by kind, as they will stand in its program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statements {
    /// Values computed; a mere sign or negation is not a statement.
    pub lets: usize,
    /// Variables and lists.
    pub variables: usize,
    /// Assignments.
    pub sets: usize,
    /// Numbers read: inputs, scratch memory, and tables of the model.
    pub loads: usize,
    /// Numbers written: outputs and scratch memory.
    pub stores: usize,
    /// Blocks of `when!` and `push!`.
    pub blocks: usize,
    /// Loops.
    pub loops: usize,
    /// `break_if!`s.
    pub stops: usize,
}

impl Statements {
    /// All of them.
    pub fn total(&self) -> usize {
        let Statements {
            lets,
            variables,
            sets,
            loads,
            stores,
            blocks,
            loops,
            stops,
        } = *self;
        lets + variables + sets + loads + stores + blocks + loops + stops
    }
}

/// Records a text of `inputs` numbers; what it returns are the outputs, in order.
///
/// # Errors
/// The first [`Misuse`], with its place in the text.
#[track_caller]
pub fn record(
    inputs: usize,
    text: impl FnOnce(&mut Recorder, &[Recorded]) -> Vec<Recorded>,
) -> Result<Recording, RecordError> {
    let place = Location::caller();
    let session = state::Session::start(place);
    let given: Vec<Recorded> = state::with(place, |s| {
        (0..inputs)
            .map(|i| {
                let input = s.input(i as u32);
                s.handle(input)
            })
            .collect()
    });
    let results = text(&mut Recorder::new(), &given);
    let (outputs, mut body) = state::with(place, |s| {
        let outputs: Vec<Operand> = results.iter().map(|x| s.see(*x)).collect();
        (outputs, s.leave(0))
    });
    let mut state = session.finish();
    if let Some(error) = state.take_error() {
        return Err(error);
    }
    live::prune(&state.values, &mut body, &outputs, place)?;
    let mut values = state.values.iter().map(|v| v.op).collect();
    let mut names = state.counters().names as usize;
    join::join(&mut body, &mut values, &mut names);
    let mut recording = Recording {
        inputs,
        outputs,
        names,
        values,
        scratch: 0,
        body,
    };
    recording.scratch = recording.reach();
    Ok(recording)
}

impl Recording {
    /// Numbers that the text reads.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Numbers that the text returns.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Numbers of scratch memory that the tables reach, per world.
    pub fn scratch(&self) -> usize {
        self.scratch
    }

    fn reach(&self) -> usize {
        let mut end = 0;
        let mut reach = |cell: &Cell| {
            let rows = match cell.row {
                Row::At(i) => i + 1,
                Row::Name(_) | Row::Value(_) => cell.table.rows,
            };
            end = end.max(cell.table.base + rows * cell.table.stride);
        };
        self.each_statement(&mut |statement| match statement {
            Statement::Store { cell, .. } => reach(cell),
            Statement::Let(number) => {
                if let Op::Load(cell) = &self.values[*number as usize] {
                    reach(cell);
                }
            }
            _ => {}
        });
        end
    }

    /// Is anything written?
    pub(crate) fn has_effect(&self) -> bool {
        let mut stores = false;
        self.each_statement(&mut |statement| {
            stores |= matches!(statement, Statement::Store { .. });
        });
        stores || !self.outputs.is_empty()
    }

    /// Does the text read numbers, and does it read indices, of the tables of the model?
    #[cfg_attr(test, allow(dead_code))] // the tests inside this crate leave the GPU out
    pub(crate) fn reads_tables(&self) -> (bool, bool) {
        let (mut numbers, mut indices) = (false, false);
        self.each_statement(&mut |statement| {
            if let Statement::Let(number) = statement {
                match self.values[*number as usize] {
                    Op::Constant(_) | Op::Pick { .. } => numbers = true,
                    Op::Index { .. } => indices = true,
                    _ => {}
                }
            }
        });
        (numbers, indices)
    }

    /// How many statements the program will have.
    pub fn statements(&self) -> Statements {
        let mut n = Statements {
            loads: self.live_inputs().len(),
            stores: self.outputs.len(),
            ..Statements::default()
        };
        self.each_statement(&mut |statement| match statement {
            Statement::Let(number) => match self.values[*number as usize] {
                Op::Load(_)
                | Op::Quad(_)
                | Op::Constant(_)
                | Op::Pick { .. }
                | Op::Index { .. } => n.loads += 1,
                op if op.is_inline() => {}
                _ => n.lets += 1,
            },
            Statement::Var { .. } | Statement::List { .. } => n.variables += 1,
            Statement::Set { .. } => n.sets += 1,
            Statement::Store { .. } => n.stores += 1,
            Statement::StoreQuad { numbers, .. } => {
                let given = numbers.iter().flatten().count();
                n.stores += if given == numbers.len() { 1 } else { given };
            }
            Statement::When { .. } | Statement::Push { .. } => n.blocks += 1,
            Statement::Loop { .. } => n.loops += 1,
            Statement::Stop(_) => n.stops += 1,
        });
        n
    }

    /// Inputs that anything depends on, in order.
    pub(crate) fn live_inputs(&self) -> Vec<u32> {
        let mut used = vec![false; self.inputs];
        self.each_operand(&mut |x| {
            if let Operand::Value(number) = x
                && (number as usize) < self.inputs
            {
                used[number as usize] = true;
            }
        });
        (0..self.inputs as u32)
            .filter(|i| used[*i as usize])
            .collect()
    }

    /// Calls `f` with what each statement reads, and with the outputs.
    pub(crate) fn each_operand(&self, mark: &mut impl FnMut(Operand)) {
        self.outputs.iter().for_each(|x| mark(*x));
        self.each_statement(&mut |statement| match statement {
            Statement::Let(number) => self.values[*number as usize].each_operand(&mut *mark),
            Statement::Var { value, .. }
            | Statement::Set { value, .. }
            | Statement::Store { value, .. }
            | Statement::Stop(value) => mark(*value),
            Statement::StoreQuad { numbers, .. } => {
                numbers.iter().flatten().for_each(|x| mark(*x));
            }
            Statement::When { mask, .. } | Statement::Push { mask, .. } => mark(*mask),
            Statement::List { rows, .. } => mark(*rows),
            Statement::Loop { .. } => {}
        });
    }

    fn each_statement(&self, f: &mut impl FnMut(&Statement)) {
        fn walk(body: &[Statement], f: &mut impl FnMut(&Statement)) {
            for statement in body {
                f(statement);
                match statement {
                    Statement::When { body, .. }
                    | Statement::Push { body, .. }
                    | Statement::Loop { body, .. } => walk(body, f),
                    _ => {}
                }
            }
        }
        walk(&self.body, f);
    }
}

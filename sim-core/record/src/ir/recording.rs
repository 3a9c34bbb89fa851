//! A recording: what physics code computes, as statements over values.

use crate::ir::tree::{Cell, Op, Operand, Row, Statement};
use std::panic::Location;

/// Where in the code a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// The part of the code that it belongs to, see [`Recorder::begin_part`](crate::Recorder::begin_part).
    pub part: &'static str,
    /// The operation that computes it.
    pub place: &'static Location<'static>,
}

/// What physics code computes, as statements.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub(crate) inputs: usize,
    pub(crate) outputs: Vec<Operand>,
    /// How each value is computed, inputs first. Dead values are in no statement.
    pub(crate) values: Vec<Op>,
    /// Where each comes from; those that passes added have none.
    pub(crate) origins: Vec<Origin>,
    /// Variables, lists, indices and rows are numbered below this.
    pub(crate) names: usize,
    /// Scalars of scratch memory that the tables reach.
    pub(crate) scratch: usize,
    /// Threads per world, a power of two.
    pub(crate) lanes: usize,
    pub(crate) assumed: Option<Operand>,
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
    /// Reads: inputs, scratch memory, and tables of the model.
    pub loads: usize,
    /// Writes: outputs and scratch memory.
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

impl Recording {
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The statements, in order.
    pub fn body(&self) -> &[Statement] {
        &self.body
    }

    /// How a value is computed.
    pub fn value(&self, number: u32) -> Op {
        self.values[number as usize]
    }

    /// Where a value comes from, if the code computes it.
    pub fn origin(&self, number: u32) -> Option<Origin> {
        self.origins.get(number as usize).copied()
    }

    /// Values are numbered below this.
    pub fn values(&self) -> usize {
        self.values.len()
    }

    /// Variables, lists and indices are numbered below this.
    pub fn names(&self) -> usize {
        self.names
    }

    /// What each output is, in order.
    pub fn results(&self) -> &[Operand] {
        &self.outputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// The mask that must hold in no world, if the code was recorded on assumptions ([`Recorder::assume_nowhere`]). It is
    /// computed outside of all blocks.
    ///
    /// [`Recorder::assume_nowhere`]: crate::Recorder::assume_nowhere
    pub fn assumed(&self) -> Option<Operand> {
        self.assumed
    }

    /// Threads per world.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Scalars of scratch memory per world that the tables reach.
    pub fn scratch(&self) -> usize {
        self.scratch
    }

    pub(crate) fn reach(&self) -> usize {
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
                if let Op::Load(cell) | Op::LoadAt(cell, _) = &self.values[*number as usize] {
                    reach(cell);
                }
            }
            _ => {}
        });
        end
    }

    /// Whether anything is written.
    pub(crate) fn has_effect(&self) -> bool {
        let mut stores = false;
        self.each_statement(&mut |statement| {
            stores |= matches!(statement, Statement::Store { .. });
        });
        stores || !self.outputs.is_empty()
    }

    /// Whether it reads scalars, and whether it reads indices, of the tables of the model.
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

    /// Statements that the program will have, by kind.
    pub fn statements(&self) -> Statements {
        let mut n = Statements {
            loads: self.live_inputs().len(),
            stores: self.outputs.len(),
            ..Statements::default()
        };
        self.each_statement(&mut |statement| match statement {
            Statement::Let(number) => match self.values[*number as usize] {
                Op::Load(_)
                | Op::LoadAt(..)
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
        self.assumed.iter().for_each(|x| mark(*x));
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

    pub(crate) fn each_statement(&self, f: &mut impl FnMut(&Statement)) {
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

//! Dead-code elimination: keeps what an output, or a store to scratch memory, depends on.

use crate::error::{Misuse, Place, RecordError};
use crate::ir::tree::{Bounds, Op, Operand, Statement};
use crate::recorder::state::Value;
use std::collections::HashSet;

/// Removes what nothing depends on. Stores stay: another program may read them.
///
/// # Errors
/// A live statement that reads a NaN constant.
pub(crate) fn prune(
    values: &[Value],
    body: &mut Vec<Statement>,
    outputs: &[Operand],
    text: Place,
) -> Result<(), RecordError> {
    let mut live = Live {
        values,
        alive: vec![false; values.len()],
        names: HashSet::new(),
        text,
        not_a_number: None,
    };
    outputs.iter().for_each(|x| live.mark(*x));
    loop {
        // a variable found to be read makes its assignments live, and they make others so
        let before = live.size();
        live.walk(body);
        if live.size() == before {
            break;
        }
    }
    live.keep(body);
    match live.not_a_number {
        Some(place) => Err(RecordError::new(Misuse::NotANumber, place)),
        None => Ok(()),
    }
}

struct Live<'a> {
    values: &'a [Value],
    alive: Vec<bool>,
    /// Variables and lists that are read.
    names: HashSet<u32>,
    /// Where the recording began: the location of statements without one of their own.
    text: Place,
    not_a_number: Option<Place>,
}

impl Live<'_> {
    fn size(&self) -> usize {
        self.names.len() + self.alive.iter().filter(|alive| **alive).count()
    }

    fn mark(&mut self, x: Operand) {
        let mut waiting = vec![(x, self.text)];
        while let Some((x, place)) = waiting.pop() {
            let Operand::Value(number) = x else {
                if x.constant().is_some_and(f32::is_nan) {
                    self.not_a_number.get_or_insert(place);
                }
                continue;
            };
            if std::mem::replace(&mut self.alive[number as usize], true) {
                continue;
            }
            let Value { op, place, .. } = &self.values[number as usize];
            if let Op::Get(name) | Op::Count(name) = op {
                self.names.insert(*name);
            }
            op.each_operand(|x| waiting.push((x, place)));
        }
    }

    /// Marks what the live statements of a block need; true if there are any.
    fn walk(&mut self, body: &[Statement]) -> bool {
        let mut any = false;
        for statement in body {
            match statement {
                Statement::Let(_) | Statement::List { .. } | Statement::Stop(_) => {}
                Statement::Var { name, value } | Statement::Set { name, value } => {
                    if self.names.contains(name) {
                        self.mark(*value);
                        any = true;
                    }
                }
                Statement::Store { cell, value } => {
                    cell.row.each_operand(|x| self.mark(x));
                    self.mark(*value);
                    any = true;
                }
                Statement::StoreQuad { quad, numbers } => {
                    quad.row.each_operand(|x| self.mark(x));
                    numbers.iter().flatten().for_each(|x| self.mark(*x));
                    any = true;
                }
                Statement::When { mask, body } => {
                    if self.walk(body) {
                        self.mark(*mask);
                        any = true;
                    }
                }
                Statement::Push {
                    list, mask, body, ..
                } => {
                    if self.walk(body) | self.names.contains(list) {
                        self.names.insert(*list);
                        self.mark(*mask);
                        any = true;
                    }
                }
                Statement::Loop { bounds, body, .. } => {
                    if self.walk(body) {
                        match bounds {
                            Bounds::Rows { list, .. } => {
                                self.names.insert(*list);
                            }
                            Bounds::Span { first, end } | Bounds::Shared { first, end } => {
                                first.each_operand(|x| self.mark(x));
                                end.each_operand(|x| self.mark(x));
                            }
                        }
                        // what ends a live loop is live too
                        for statement in body {
                            if let Statement::Stop(mask) = statement {
                                self.mark(*mask);
                            }
                        }
                        any = true;
                    }
                }
            }
        }
        any
    }

    /// Drops the dead statements of a block; true if any with an effect is left.
    fn keep(&self, body: &mut Vec<Statement>) -> bool {
        let mut any = false;
        body.retain_mut(|statement| {
            let keeps = match statement {
                Statement::Let(number) => return self.alive[*number as usize],
                Statement::Stop(_) => return true,
                Statement::Var { name, .. }
                | Statement::Set { name, .. }
                | Statement::List { name, .. } => self.names.contains(name),
                Statement::Store { .. } | Statement::StoreQuad { .. } => true,
                Statement::When { body, .. } => self.keep(body),
                Statement::Push { list, body, .. } => self.keep(body) | self.names.contains(list),
                Statement::Loop { body, .. } => self.keep(body),
            };
            any |= keeps;
            keeps
        });
        any
    }
}

//! The statements of a kernel: those of its piece, between what it is given and what it leaves.

use super::cut::{Item, uses_of};
use super::kernel::Plan;
use super::uses::{Rename, Use, computed};
use crate::tree::{Binary, Op, Operand, Row, Statement, Unary};
use std::collections::{BTreeMap, HashMap, HashSet};

pub(super) struct Writer<'a> {
    pub plan: &'a Plan<'a>,
    pub values: Vec<Op>,
    pub body: Vec<Statement>,
    /// What a value of the text is here.
    pub known: HashMap<u32, Operand>,
    /// Inputs that are rounds of frames.
    pub rounds: HashMap<usize, u32>,
    pub indices: HashMap<usize, u32>,
}

impl Writer<'_> {
    fn compute_now(&mut self, op: Op) -> Operand {
        let number = self.values.len() as u32;
        self.values.push(op);
        self.body.push(Statement::Let(number));
        Operand::Value(number)
    }

    /// A value of the text from the number it crossed as.
    pub fn given(&mut self, number: u32, input: u32) {
        let input = Operand::Value(input);
        let value = match self.plan.recording.values[number as usize] {
            op if is_mask(&op) => {
                self.compute_now(Op::Binary(Binary::Lt, Operand::number(0.5), input))
            }
            Op::Index { .. } | Op::After(..) => self.compute_now(Op::After(Row::At(0), input)),
            _ => input,
        };
        self.known.insert(number, value);
    }

    /// The number as which a value of the text crosses.
    fn crossing(&mut self, number: u32) -> Operand {
        let value = self.value(number);
        match (self.plan.recording.values[number as usize], value) {
            (op, mask) if is_mask(&op) => self.truth(mask),
            (Op::Index { .. } | Op::After(..), Operand::Value(index)) => {
                self.compute_now(Op::Number(Row::Value(index)))
            }
            _ => value,
        }
    }

    fn truth(&mut self, mask: Operand) -> Operand {
        let (one, zero) = (Operand::number(1.0), Operand::number(0.0));
        self.compute_now(Op::Select(mask, one, zero))
    }

    /// Writes the piece; returns what it leaves in fields.
    pub fn run(&mut self, p: usize) -> Vec<(Operand, u32)> {
        let plan = self.plan;
        let (piece, needs) = (&plan.pieces.pieces[p], &plan.needs[p]);
        let mut assigned = needs.assigned.clone();
        let mut results = Vec::new();
        let mut leaving: BTreeMap<usize, Operand> = BTreeMap::new();
        for item in &piece.items {
            match item {
                Item::Run(statement) => {
                    self.ready(item);
                    let mut statement = self.statement(statement);
                    if let Statement::Set { name, value } = statement
                        && assigned.remove(&name)
                    {
                        statement = Statement::Var { name, value };
                    }
                    self.body.push(statement);
                }
                Item::Enter(frame, mask) => {
                    let outside = match mask {
                        None => Operand::number(0.0),
                        Some(mask) => {
                            let mask = self.operand(*mask);
                            let (one, zero) = (Operand::number(1.0), Operand::number(0.0));
                            self.compute_now(Op::Select(mask, zero, one))
                        }
                    };
                    let index = plan.pieces.frames[*frame].index;
                    let first = index.map_or(0, |(_, first)| first);
                    let zero = Operand::number(0.0);
                    let numbers = [outside, Operand::number(first as f32), zero, zero];
                    let field = plan.frame_fields[*frame];
                    results.extend(numbers.into_iter().zip(field..));
                }
                Item::Leave(frame, mask) => {
                    let mask = self.operand(*mask);
                    let so_far = leaving.get(frame).copied();
                    let mask = match so_far {
                        None => mask,
                        Some(before) => self.compute_now(Op::Binary(Binary::Or, before, mask)),
                    };
                    leaving.insert(*frame, mask);
                }
                Item::Next(frame) => {
                    let round = Operand::Value(self.rounds[frame]);
                    let one = Operand::number(1.0);
                    let next = self.compute_now(Op::Binary(Binary::Add, round, one));
                    results.push((next, plan.frame_fields[*frame] + 1));
                }
            }
        }
        for (frame, mask) in leaving {
            results.push((self.truth(mask), plan.frame_fields[frame]));
        }
        for (x, field) in &plan.outputs[p] {
            results.push((self.operand(*x), *field));
        }
        let mut crossing: Vec<(u32, u32)> = needs
            .made
            .iter()
            .filter_map(|x| Some((*plan.value_fields.get(x)?, *x)))
            .collect();
        crossing.sort_unstable();
        let written: HashSet<u32> = results.iter().map(|(_, field)| *field).collect();
        for (field, x) in crossing {
            if !written.contains(&field) {
                results.push((self.crossing(x), field));
            }
        }
        for name in &plan.kept[p] {
            let op = match plan.lists.contains(name) {
                true => Op::Count(*name),
                false => Op::Get(*name),
            };
            results.push((self.compute_now(op), plan.name_fields[name]));
        }
        let padding = plan.padding[p].iter();
        results.extend(padding.map(|field| (Operand::number(0.0), *field)));
        results
    }

    /// Computes again, outside of the item's blocks, what it uses of other pieces.
    fn ready(&mut self, item: &Item) {
        let plan = self.plan;
        let mut used = Vec::new();
        uses_of(item, &plan.recording.values, &mut |name| match name {
            Use::Value(number) => used.push(number),
            Use::Index(name) => {
                if let Some(frame) = plan.indices.get(&name)
                    && self.rounds.contains_key(frame)
                    && !self.indices.contains_key(frame)
                {
                    let round = Operand::Value(self.rounds[frame]);
                    let index = self.values.len() as u32;
                    self.values.push(Op::After(Row::At(0), round));
                    self.body.push(Statement::Let(index));
                    self.indices.insert(*frame, index);
                }
            }
            _ => {}
        });
        let Item::Run(statement) = item else { return };
        let mut inside = HashSet::new();
        computed(std::slice::from_ref(statement), &mut |x| {
            inside.insert(x);
        });
        for number in used {
            if !inside.contains(&number) {
                self.value(number);
            }
        }
    }
}

impl Rename for Writer<'_> {
    fn value(&mut self, number: u32) -> Operand {
        if let Some(known) = self.known.get(&number) {
            return *known;
        }
        let op = self.op(self.plan.recording.values[number as usize]);
        let value = self.compute_now(op);
        self.known.insert(number, value);
        value
    }

    fn index(&mut self, name: u32) -> Option<u32> {
        let frame = self.plan.indices.get(&name)?;
        self.indices.get(frame).copied()
    }

    fn compute(&mut self, number: u32) -> u32 {
        let op = self.op(self.plan.recording.values[number as usize]);
        let new = self.values.len() as u32;
        self.values.push(op);
        self.known.insert(number, Operand::Value(new));
        new
    }
}

/// Is the value true or false?
fn is_mask(op: &Op) -> bool {
    matches!(
        op,
        Op::Binary(Binary::Lt | Binary::And | Binary::Or, ..) | Op::Unary(Unary::Not, _)
    )
}

//! Emits kernels: the statements of a piece, between the fields that it reads and those that it writes.

use super::items::{Item, Pieces, uses_of};
use super::kernel::Kernel;
use super::plan::Plan;
use crate::ir::recording::Recording;
use crate::ir::tree::{Binary, Op, Operand, Row, Statement, Unary};
use crate::ir::uses::{Rename, Use, computed};
use crate::passes::lanes;
use crate::wgsl::ProgramOptions;
use std::collections::{BTreeMap, HashMap, HashSet};

pub(super) struct Writer<'a> {
    pub plan: &'a Plan<'a>,
    pub values: Vec<Op>,
    pub body: Vec<Statement>,
    /// Values of the recording, as operands of this kernel.
    pub known: HashMap<u32, Operand>,
    /// Inputs that hold the iteration of a region.
    pub iterations: HashMap<usize, u32>,
    pub indices: HashMap<usize, u32>,
}

impl Writer<'_> {
    fn compute_now(&mut self, op: Op) -> Operand {
        let number = self.values.len() as u32;
        self.values.push(op);
        self.body.push(Statement::Let(number));
        Operand::Value(number)
    }

    /// A value of the recording, from the scalar as which it crossed.
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

    /// The scalar as which a value of the recording crosses.
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
                Item::Enter(region, mask) => {
                    let outside = match mask {
                        None => Operand::number(0.0),
                        Some(mask) => {
                            let mask = self.operand(*mask);
                            let (one, zero) = (Operand::number(1.0), Operand::number(0.0));
                            self.compute_now(Op::Select(mask, zero, one))
                        }
                    };
                    let index = plan.pieces.regions[*region].index;
                    let first = index.map_or(0, |(_, first)| first);
                    let zero = Operand::number(0.0);
                    let numbers = [outside, Operand::number(first as f32), zero, zero];
                    let field = plan.region_fields[*region];
                    results.extend(numbers.into_iter().zip(field..));
                }
                Item::Leave(region, mask) => {
                    let mask = self.operand(*mask);
                    let so_far = leaving.get(region).copied();
                    let mask = match so_far {
                        None => mask,
                        Some(before) => self.compute_now(Op::Binary(Binary::Or, before, mask)),
                    };
                    leaving.insert(*region, mask);
                }
                Item::Next(region) => {
                    let iteration = Operand::Value(self.iterations[region]);
                    let one = Operand::number(1.0);
                    let next = self.compute_now(Op::Binary(Binary::Add, iteration, one));
                    results.push((next, plan.region_fields[*region] + 1));
                }
            }
        }
        for (region, mask) in leaving {
            results.push((self.truth(mask), plan.region_fields[region]));
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
        for name in &plan.live_out[p] {
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
                if let Some(region) = plan.indices.get(&name)
                    && self.iterations.contains_key(region)
                    && !self.indices.contains_key(region)
                {
                    let iteration = Operand::Value(self.iterations[region]);
                    let index = self.values.len() as u32;
                    self.values.push(Op::After(Row::At(0), iteration));
                    self.body.push(Statement::Let(index));
                    self.indices.insert(*region, index);
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
        let region = self.plan.indices.get(&name)?;
        self.indices.get(region).copied()
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

/// The kernels, and the number of fields that they use from `spare` on.
pub(super) fn kernels(
    recording: &Recording,
    options: &ProgramOptions,
    pieces: &Pieces,
    spare: u32,
) -> (Vec<Kernel>, usize) {
    let (inputs, outputs) = options.fields(recording);
    let mut plan = Plan::new(recording, pieces, &inputs, &outputs);
    plan.place(spare);
    let kernels = (0..pieces.pieces.len())
        .map(|p| kernel(&plan, p, options))
        .collect();
    (kernels, (plan.end - spare) as usize)
}

/// The kernel of a piece.
fn kernel(plan: &Plan<'_>, p: usize, options: &ProgramOptions) -> Kernel {
    let (piece, needs) = (&plan.pieces.pieces[p], &plan.needs[p]);
    let mut inputs = Vec::new();
    // in order: equal recordings give equal kernel source, which is the key of caches
    let mut given: BTreeMap<u32, u32> = BTreeMap::new();
    for x in &needs.values {
        given.insert(*x, inputs.len() as u32);
        inputs.push(match plan.inputs.get(*x as usize) {
            Some(field) => *field,
            None => plan.value_fields[x],
        });
    }
    let mut names = Vec::new();
    for name in &needs.loaded {
        names.push((*name, inputs.len() as u32));
        inputs.push(plan.name_fields[name]);
    }
    let mut iterations = HashMap::new();
    let counts = |item: &Item| matches!(item, Item::Next(_));
    if needs.counts || piece.items.iter().any(counts) {
        for region in &piece.regions {
            iterations.insert(*region, inputs.len() as u32);
            inputs.push(plan.region_fields[*region] + 1);
        }
    }
    let mut writer = Writer {
        plan,
        values: (0..inputs.len() as u32).map(Op::Input).collect(),
        body: Vec::new(),
        known: HashMap::new(),
        iterations,
        indices: HashMap::new(),
    };
    for (x, input) in given {
        writer.given(x, input);
    }
    for (name, input) in names {
        let value = Operand::Value(input);
        writer.body.push(match plan.lists.contains(&name) {
            true => Statement::List { name, rows: value },
            false => Statement::Var { name, value },
        });
    }
    for name in &needs.private {
        let value = Operand::number(0.0);
        writer.body.push(Statement::Var { name: *name, value });
    }
    let (results, fields): (Vec<Operand>, Vec<u32>) = writer.run(p).into_iter().unzip();
    let recording = Recording {
        inputs: inputs.len(),
        outputs: results,
        values: writer.values,
        origins: Vec::new(),
        names: plan.recording.names,
        scratch: 0,
        lanes: 1,
        assumed: None,
        body: writer.body,
    };
    let mut recording = Recording {
        scratch: recording.reach(),
        ..recording
    };
    let values = &plan.recording.values;
    let shares = piece.items.iter().any(|item| item.needs_lanes(values));
    // what a lane has may be computed again here
    if plan.recording.lanes > 1 && (shares || recording.values.contains(&Op::Lane)) {
        recording.lanes = plan.recording.lanes;
        lanes::share(&mut recording);
    }
    let unless = piece
        .regions
        .iter()
        .map(|region| plan.region_fields[*region]);
    let options = ProgramOptions {
        inputs: Some(inputs),
        outputs: Some(fields),
        unless: options.unless.iter().copied().chain(unless).collect(),
        is_listed: piece
            .regions
            .iter()
            .any(|region| plan.pieces.regions[*region].iterations > 1),
        ..options.clone()
    };
    Kernel { recording, options }
}

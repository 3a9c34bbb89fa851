//! Plans kernels: which values each piece reads, which it leaves for others, and in which fields.

use super::items::{Item, Piece, Pieces, REGION_FIELDS, bases, is_computed_again, uses_of};
use super::live_out::{Names, live_out};
use super::private::private;
use crate::ir::recording::Recording;
use crate::ir::tree::{Op, Operand, Statement};
use crate::ir::uses::{Use, computed, of_op};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// What a piece is given and what it changes.
#[derive(Default)]
pub(super) struct Needs {
    /// Inputs of the recording, and values that earlier pieces computed.
    pub values: BTreeSet<u32>,
    /// Variables and lists that go on.
    pub loaded: BTreeSet<u32>,
    changed: BTreeSet<u32>,
    /// Variables that start anew by an assignment.
    pub assigned: HashSet<u32>,
    pub made: HashSet<u32>,
    pub counts: bool,
    /// Variables that start anew, whatever they held.
    pub private: BTreeSet<u32>,
}

impl Needs {
    fn names(&self) -> Names<'_> {
        Names {
            loaded: &self.loaded,
            changed: &self.changed,
        }
    }
}

pub(super) struct Plan<'a> {
    pub recording: &'a Recording,
    pub pieces: &'a Pieces,
    pub inputs: &'a [u32],
    pub needs: Vec<Needs>,
    pub lists: HashSet<u32>,
    /// Indices of regions that are cut inside, and which.
    pub indices: HashMap<u32, usize>,
    /// Outputs that each piece writes, with their fields.
    pub outputs: Vec<Vec<(Operand, u32)>>,
    pub value_fields: HashMap<u32, u32>,
    pub name_fields: HashMap<u32, u32>,
    /// Variables and lists that each piece leaves for others.
    pub live_out: Vec<BTreeSet<u32>>,
    /// Fields that complete a vector which each piece writes.
    pub padding: Vec<Vec<u32>>,
    pub region_fields: Vec<u32>,
    pub end: u32,
}

impl<'a> Plan<'a> {
    pub fn new(
        recording: &'a Recording,
        pieces: &'a Pieces,
        inputs: &'a [u32],
        outputs: &[u32],
    ) -> Plan<'a> {
        let mut lists = HashSet::new();
        recording.each_statement(&mut |statement| {
            if let Statement::List { name, .. } = statement {
                lists.insert(*name);
            }
        });
        let regions = pieces.regions.iter().enumerate();
        let indices: HashMap<u32, usize> = regions
            .filter_map(|(k, region)| region.index.map(|(name, _)| (name, k)))
            .collect();
        let mut plan = Plan {
            recording,
            pieces,
            inputs,
            needs: Vec::new(),
            lists,
            indices,
            outputs: vec![Vec::new(); pieces.pieces.len()],
            value_fields: HashMap::new(),
            name_fields: HashMap::new(),
            live_out: Vec::new(),
            padding: vec![Vec::new(); pieces.pieces.len()],
            region_fields: Vec::new(),
            end: 0,
        };
        plan.needs = pieces
            .pieces
            .iter()
            .zip(private(&pieces.pieces, &recording.values))
            .map(|(piece, private)| plan.needs_of(piece, private))
            .collect();
        plan.place_outputs(outputs);
        let names: Vec<Names> = plan.needs.iter().map(Needs::names).collect();
        plan.live_out = live_out(pieces, &names);
        plan
    }

    fn needs_of(&self, piece: &Piece, private: BTreeSet<u32>) -> Needs {
        let values = &self.recording.values;
        let mut needs = Needs::default();
        let mut met: HashSet<u32> = HashSet::new();
        for item in &piece.items {
            if let Item::Run(statement) = item {
                computed(std::slice::from_ref(statement), &mut |x| {
                    needs.made.insert(x);
                });
            }
        }
        for item in &piece.items {
            if let Item::Run(Statement::Set { name, .. }) = item
                && met.insert(*name)
            {
                needs.assigned.insert(*name);
            }
            uses_of(item, values, &mut |used| match used {
                Use::Value(number) => self.need(number, &mut needs),
                Use::Read(name) => {
                    if met.insert(name) {
                        needs.loaded.insert(name);
                    }
                }
                Use::Change(name) => {
                    if met.insert(name) {
                        needs.loaded.insert(name);
                    }
                    needs.changed.insert(name);
                }
                Use::Start(name) => {
                    met.insert(name);
                    needs.changed.insert(name);
                }
                Use::Index(name) => needs.counts |= self.indices.contains_key(&name),
            });
        }
        needs.loaded = &needs.loaded - &private;
        needs.changed = &needs.changed - &private;
        needs.private = private;
        needs
    }

    fn need(&self, number: u32, needs: &mut Needs) {
        if needs.made.contains(&number) {
            return;
        }
        let values = &self.recording.values;
        // operands of a value that is computed again may be computed here
        if is_computed_again(&values[number as usize], values)
            && !matches!(values[number as usize], Op::Input(_))
        {
            let mut operands = Vec::new();
            of_op(&values[number as usize], &mut |used| {
                if let Use::Value(x) = used {
                    operands.push(x);
                }
            });
            return operands.iter().for_each(|x| self.need(*x, needs));
        }
        needs.values.insert(number);
    }

    /// An output is written where it is computed, unless an input is still to be read from its field.
    fn place_outputs(&mut self, fields: &[u32]) {
        let last = self.outputs.len() - 1;
        let mut home = HashMap::new();
        for (p, needs) in self.needs.iter().enumerate() {
            if self.pieces.pieces[p].regions.is_empty() {
                home.extend(needs.made.iter().map(|x| (*x, p)));
            }
        }
        let mut late = Vec::new();
        let mut read_by: HashMap<u32, usize> = HashMap::new();
        let values = &self.recording.values;
        for (p, needs) in self.needs.iter().enumerate() {
            for x in &needs.values {
                if (*x as usize) < self.recording.inputs {
                    read_by.insert(self.inputs[*x as usize], p);
                }
            }
        }
        for (x, field) in self.recording.outputs.iter().zip(fields) {
            let Operand::Value(number) = *x else {
                late.push((*x, *field));
                continue;
            };
            if self.inputs.get(number as usize) == Some(field) {
                continue;
            }
            match home.get(&number) {
                Some(p) if read_by.get(field).is_none_or(|q| q <= p) => {
                    self.outputs[*p].push((*x, *field));
                    self.value_fields.entry(number).or_insert(*field);
                }
                _ => {
                    bases(number, values, &mut |base| {
                        if (base as usize) < self.recording.inputs {
                            read_by.insert(self.inputs[base as usize], last);
                        }
                    });
                    late.push((*x, *field));
                }
            }
        }
        for (x, field) in late {
            if let Operand::Value(number) = x {
                let mut needs = std::mem::take(&mut self.needs[last]);
                self.need(number, &mut needs);
                self.needs[last] = needs;
            }
            self.outputs[last].push((x, field));
        }
    }

    /// Gives a field to all that crosses a cut: what the same pieces write lies side by side.
    pub fn place(&mut self, spare: u32) {
        self.end = spare;
        for _ in &self.pieces.regions {
            self.region_fields.push(self.end);
            self.end += REGION_FIELDS;
        }
        let mut readers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (p, needs) in self.needs.iter().enumerate() {
            for x in &needs.values {
                if *x as usize >= self.recording.inputs && !self.value_fields.contains_key(x) {
                    readers.entry(*x).or_default().push(p);
                }
            }
        }
        for p in 0..self.needs.len() {
            let made = &self.needs[p].made;
            let mut crossing: Vec<(&Vec<usize>, u32)> = readers
                .iter()
                .filter(|(x, _)| made.contains(x))
                .map(|(x, readers)| (readers, *x))
                .collect();
            // what is read together lies together
            crossing.sort();
            let crossing: Vec<u32> = crossing.into_iter().map(|(_, x)| x).collect();
            for x in crossing {
                self.value_fields.insert(x, self.end);
                self.end += 1;
            }
            self.pad(&[p]);
        }
        let mut writers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (p, names) in self.live_out.iter().enumerate() {
            for name in names {
                writers.entry(*name).or_default().push(p);
            }
        }
        let mut groups: BTreeMap<Vec<usize>, Vec<u32>> = BTreeMap::new();
        for (name, pieces) in writers {
            groups.entry(pieces).or_default().push(name);
        }
        for (pieces, names) in groups {
            for name in names {
                self.name_fields.insert(name, self.end);
                self.end += 1;
            }
            self.pad(&pieces);
        }
    }

    /// Ends a vector: the pieces that write in it write all of it.
    fn pad(&mut self, pieces: &[usize]) {
        while !self.end.is_multiple_of(4) {
            for p in pieces {
                self.padding[*p].push(self.end);
            }
            self.end += 1;
        }
    }
}

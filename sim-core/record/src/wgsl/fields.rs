//! Where a program reads its inputs, and where it writes its outputs.
//!
//! A vector of inputs is read before the first statement that uses one of them, and again behind a long block that uses none, so that
//! few values wait in registers. A vector of outputs is written behind the last statement that computes one of them. What has to wait
//! is written at the end: a vector of which the program also reads something, and everything where several lanes share a world.

use super::Printer;
use super::expression::COMPONENTS;
use crate::ir::recording::Recording;
use crate::ir::tree::{Operand, Statement};
use crate::ir::uses::{Use, of_statement};
use crate::passes::vectorize::WIDTH;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::{self, Write};

/// Statements of a block, at least, behind which inputs are read again.
const LONG: usize = 500;

/// The components of a vector that are written.
type Numbers = [Option<Operand>; WIDTH];

/// A vector of inputs.
struct Read {
    quad: u32,
    inputs: Vec<u32>,
    is_again: bool,
}

/// Vectors by the number of the statement before which they are read or written.
pub(super) struct Fields {
    reads: BTreeMap<usize, Vec<Read>>,
    writes: BTreeMap<usize, Vec<(u32, Numbers)>>,
    /// Component of each input.
    parts: HashMap<u32, char>,
    /// Vectors that are read whole.
    whole: BTreeSet<u32>,
    /// Vectors that are read more than once.
    again: BTreeSet<u32>,
}

impl Fields {
    /// Statement `k` of `n` is number k. Number n + 1 is what reads before the writes at the end, n + 2 these writes.
    pub fn new(recording: &Recording, inputs: &[u32], outputs: &[u32]) -> Fields {
        let end = recording.body.len() + 1;
        let mut fields = Fields {
            reads: BTreeMap::new(),
            writes: BTreeMap::new(),
            parts: HashMap::new(),
            whole: BTreeSet::new(),
            again: BTreeSet::new(),
        };
        fields.place_reads(recording, inputs, end);
        fields.place_writes(recording, inputs, outputs, end);
        fields
    }

    fn place_reads(&mut self, recording: &Recording, inputs: &[u32], end: usize) {
        let body = &recording.body;
        let mut uses: HashMap<u32, BTreeSet<usize>> = HashMap::new();
        let mut long_before = vec![0];
        for (k, statement) in body.iter().enumerate() {
            of_statement(statement, &recording.values, &mut |used| {
                if let Use::Value(number) = used {
                    uses.entry(number).or_default().insert(k);
                }
            });
            long_before.push(long_before[k] + usize::from(length(statement) >= LONG));
        }
        long_before.resize(end + 1, long_before[body.len()]);
        let mut quads: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for i in recording.live_inputs() {
            let (quad, part) = place_of_field(inputs[i as usize]);
            self.parts.insert(i, part);
            quads.entry(quad).or_default().push(i);
        }
        for (quad, inputs) in quads {
            if inputs.len() > 1 {
                self.whole.insert(quad);
            }
            let mut used: BTreeSet<usize> = inputs
                .iter()
                .filter_map(|i| uses.get(i))
                .flatten()
                .copied()
                .collect();
            if used.is_empty() {
                used.insert(end);
            }
            let mut last = None;
            for at in used {
                let is_again = last.is_some();
                if last.is_none_or(|last: usize| long_before[at] > long_before[last + 1]) {
                    let inputs = inputs.clone();
                    let read = Read {
                        quad,
                        inputs,
                        is_again,
                    };
                    self.reads.entry(at).or_default().push(read);
                    if is_again {
                        self.again.insert(quad);
                    }
                }
                last = Some(at);
            }
        }
    }

    fn place_writes(&mut self, recording: &Recording, inputs: &[u32], outputs: &[u32], end: usize) {
        let computed = |(k, statement): (usize, &Statement)| match statement {
            Statement::Let(number) => Some((*number, k + 1)),
            _ => None,
        };
        let made: HashMap<u32, usize> = recording
            .body
            .iter()
            .enumerate()
            .filter_map(computed)
            .collect();
        for (quad, vector) in written(recording, inputs, outputs) {
            let numbers = vector.outputs.map(|k| k.map(|k| recording.outputs[k]));
            let ready = |x: &Operand| match x {
                Operand::Value(number) => made.get(number).copied(),
                _ => Some(0),
            };
            let ready = numbers.iter().flatten().map(ready);
            let at = ready
                .collect::<Option<Vec<_>>>()
                .and_then(|all| all.into_iter().max());
            let at = at.filter(|at| *at > 0 && !vector.waits).unwrap_or(end + 1);
            self.writes.entry(at).or_default().push((quad, numbers));
        }
    }
}

/// Statements, those inside it counted.
fn length(statement: &Statement) -> usize {
    match statement {
        Statement::When { body, .. }
        | Statement::Push { body, .. }
        | Statement::Loop { body, .. } => 1 + body.iter().map(length).sum::<usize>(),
        _ => 1,
    }
}

/// The outputs that are written as soon as they are computed, vector by vector, by number.
pub(super) fn written_early(
    recording: &Recording,
    inputs: &[u32],
    outputs: &[u32],
) -> Vec<Vec<usize>> {
    let early = written(recording, inputs, outputs);
    let early = early.into_values().filter(|vector| !vector.waits);
    early
        .map(|vector| vector.outputs.into_iter().flatten().collect())
        .collect()
}

/// A vector of outputs.
#[derive(Default)]
struct Written {
    /// Number of the output in each component that is written.
    outputs: [Option<usize>; WIDTH],
    /// Whether it is written at the end.
    waits: bool,
}

/// The outputs, vector by vector; one that is an input in its own field is there already.
fn written(recording: &Recording, inputs: &[u32], outputs: &[u32]) -> BTreeMap<u32, Written> {
    let read = recording.live_inputs().into_iter();
    let is_read: BTreeSet<u32> = read.map(|i| place_of_field(inputs[i as usize]).0).collect();
    let mut quads: BTreeMap<u32, Written> = BTreeMap::new();
    for (k, (x, field)) in recording.outputs.iter().zip(outputs).enumerate() {
        let stays = match *x {
            Operand::Value(number) => inputs.get(number as usize) == Some(field),
            _ => false,
        };
        if !stays {
            let quad = field / WIDTH as u32;
            let vector = quads.entry(quad).or_default();
            vector.outputs[*field as usize % WIDTH] = Some(k);
            vector.waits = recording.lanes() > 1 || is_read.contains(&quad);
        }
    }
    quads
}

impl Printer<'_> {
    /// Reads the vectors that are read before a statement.
    pub(super) fn inputs(&mut self, fields: &Fields, at: usize) -> fmt::Result {
        for read in fields.reads.get(&at).into_iter().flatten() {
            let quad = read.quad;
            let begin = match (read.is_again, fields.again.contains(&quad)) {
                (true, _) => "",
                (false, true) => "var ",
                (false, false) => "let ",
            };
            let place = format!("fields[{quad}u * worlds + world]");
            if let [i] = read.inputs[..] {
                line!(self, "{begin}x{i} = {place}.{};", fields.parts[&i])?;
                continue;
            }
            line!(self, "{begin}q{quad} = {place};")?;
            for i in &read.inputs {
                line!(self, "{begin}x{i} = q{quad}.{};", fields.parts[i])?;
            }
        }
        Ok(())
    }

    /// Writes the vectors that are written before a statement.
    pub(super) fn outputs(&mut self, fields: &Fields, at: usize) -> fmt::Result {
        for (quad, numbers) in fields.writes.get(&at).into_iter().flatten() {
            let mut numbers = numbers.map(|x| x.map(|x| self.expressions.operand(x)));
            let place = format!("fields[{quad}u * worlds + world]");
            let count = numbers.iter().flatten().count();
            let mut is_read = fields.whole.contains(quad);
            if count + 1 == WIDTH && !is_read {
                line!(self, "let q{quad} = {place};")?;
                is_read = true;
            }
            if count > 1 && is_read {
                for (number, part) in numbers.iter_mut().zip(COMPONENTS) {
                    number.get_or_insert_with(|| format!("q{quad}.{part}"));
                }
            }
            self.write(&place, &numbers)?;
        }
        Ok(())
    }
}

/// The vector that a field lies in, and its component.
pub(super) fn place_of_field(field: u32) -> (u32, char) {
    let width = WIDTH as u32;
    (field / width, COMPONENTS[(field % width) as usize])
}

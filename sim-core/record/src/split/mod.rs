//! A recording as several kernels, none of which takes a driver long to compile.
//!
//! A driver's compile time grows faster than linearly with the length of a kernel. [`split`] cuts a text between
//! its statements; a loop or a block that is itself too long is cut inside, and then dispatched once a round
//! ([`Part::Repeat`]). What is used past a cut goes through fields that the caller sets aside, in vectors
//! of four; the cuts lie where little crosses them.

mod cost;
mod cut;
mod flow;
mod kernel;
mod lasting;
mod private;
mod tail;
mod uses;
mod write;

pub(crate) use uses::Rename;

use crate::Recording;
use crate::wgsl::{ProgramOptions, wgsl};
use sim_physics::lane::Tables;

/// Kernels that do what a recording does, and their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Each printed by itself, for all worlds.
    pub kernels: Vec<Kernel>,
    /// What is dispatched, one after another; each sees what those before it wrote.
    pub order: Vec<Part>,
    /// Fields used beyond the first that was spare, a multiple of four.
    pub spare: usize,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
}

/// What kernels may cost, in units of a simple statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A kernel is cut where it costs more, if its statements allow it.
    pub kernel: usize,
    /// A loop is cut inside where it costs more: each of its kernels is then dispatched in each of its rounds, for a list of
    /// the worlds that are left in the loop.
    pub repeated: usize,
    /// What a kernel more is worth inside such a loop, where it is dispatched so often.
    pub dispatch: usize,
}

/// One dispatch or several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// The kernel of this number.
    Kernel(usize),
    /// The parts, so many times. A world that left the loop does nothing in what is left of it.
    Repeat {
        /// How many times, at most.
        rounds: usize,
        /// What is dispatched in a round.
        parts: Vec<Part>,
        /// A field that is 0 in the worlds that are in the loop.
        out: Option<u32>,
    },
}

/// A part of a recording, between fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    recording: Recording,
    options: ProgramOptions,
}

impl Kernel {
    /// The kernel as WGSL.
    pub fn wgsl(&self) -> String {
        wgsl(&self.recording, &self.options)
    }

    /// What it computes, from the fields `options().inputs` to `options().outputs`.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Where it finds its numbers.
    pub fn options(&self) -> &ProgramOptions {
        &self.options
    }

    /// How long a driver will take to compile it, in units of a simple statement.
    pub fn cost(&self) -> usize {
        cost::of_kernel(&self.recording.packed())
    }

    fn run(&self, fields: &mut [f32], scratch: &mut [f32], tables: &Tables<f32>) {
        let options = &self.options;
        if options.unless.iter().any(|f| fields[*f as usize] != 0.0) {
            return;
        }
        let (Some(inputs), Some(outputs)) = (&options.inputs, &options.outputs) else {
            unreachable!("a kernel's fields are given");
        };
        let given: Vec<f32> = inputs.iter().map(|f| fields[*f as usize]).collect();
        let results = self.recording.evaluate(&given, scratch, tables);
        for (field, x) in outputs.iter().zip(results) {
            fields[*field as usize] = x;
        }
    }
}

/// Cuts a recording into kernels within limits, where its statements allow it. What crosses a cut stands in the fields from `spare` on, which no input or output
/// may have; it is rounded up to a whole vector.
///
/// # Panics
/// As [`wgsl`] does.
pub fn split(recording: &Recording, options: &ProgramOptions, limits: Limits, spare: u32) -> Split {
    let (inputs, outputs) = options.fields(recording);
    let spare = spare.next_multiple_of(4);
    let recording = &tail::with_stops_last(recording);
    let pieces = cut::pieces(recording, limits, spare);
    let (mut kernels, used) = kernel::kernels(recording, options, &pieces, spare);
    // what ends a text need not do anything
    let mut numbers = Vec::new();
    let mut kept = 0;
    for kernel in &kernels {
        numbers.push(kernel.recording.has_effect().then_some(kept));
        kept += usize::from(kernel.recording.has_effect());
    }
    kernels.retain(|kernel| kernel.recording.has_effect());
    Split {
        kernels,
        order: renumbered(&pieces.order, &numbers),
        spare: used,
        inputs,
        outputs,
    }
}

/// The order with other numbers of kernels, without those that have none.
fn renumbered(order: &[Part], numbers: &[Option<usize>]) -> Vec<Part> {
    let part = |part: &Part| match part {
        Part::Kernel(k) => numbers[*k].map(Part::Kernel),
        Part::Repeat { rounds, parts, out } => Some(Part::Repeat {
            rounds: *rounds,
            parts: renumbered(parts, numbers),
            out: *out,
        }),
    };
    order.iter().filter_map(part).collect()
}

impl Split {
    /// The outputs for these inputs, as [`Recording::evaluate`] gives them, bit for bit.
    ///
    /// # Panics
    /// As [`Recording::evaluate`] does.
    pub fn evaluate(&self, inputs: &[f32], scratch: &mut [f32], tables: &Tables<f32>) -> Vec<f32> {
        let kernels = self.kernels.iter().flat_map(|k| {
            let lists = [&k.options.inputs, &k.options.outputs];
            lists.into_iter().flatten().flatten()
        });
        let last = kernels.chain(&self.inputs).chain(&self.outputs).max();
        // what nobody wrote is not to be used
        let mut fields = vec![f32::NAN; last.map_or(0, |field| *field as usize + 1)];
        for (field, x) in self.inputs.iter().zip(inputs) {
            fields[*field as usize] = *x;
        }
        self.run(&self.order, &mut fields, scratch, tables);
        let output = |field: &u32| fields[*field as usize];
        self.outputs.iter().map(output).collect()
    }

    fn run(&self, parts: &[Part], fields: &mut [f32], scratch: &mut [f32], tables: &Tables<f32>) {
        for part in parts {
            match part {
                Part::Kernel(k) => self.kernels[*k].run(fields, scratch, tables),
                Part::Repeat { rounds, parts, .. } => {
                    for _ in 0..*rounds {
                        self.run(parts, fields, scratch, tables);
                    }
                }
            }
        }
    }
}

//! Splits a recording into kernels, none of which takes a driver long to compile.
//!
//! A driver's compile time grows faster than linearly with the length of a kernel. [`split`] cuts a recording between its statements. A
//! loop or a block that is itself too long is cut inside, and then dispatched once per iteration ([`Part::Repeat`]). Values that are
//! used past a cut go through fields that the caller reserves, in vectors of four. The cuts lie where few values cross.

mod cost;
mod emit;
mod items;
mod kernel;
mod live_out;
mod live_ranges;
mod order;
mod partition;
mod plan;
mod private;
mod stops_last;

pub use cost::Prices;
pub use kernel::Kernel;
pub use order::{Limits, Part};

use crate::ir::recording::Recording;
use crate::wgsl::ProgramOptions;
use sim_physics::lane::Tables;

/// Kernels that do what a recording does, and their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Each is printed by itself, for all worlds.
    pub kernels: Vec<Kernel>,
    /// Dispatches in order; each sees what those before it wrote.
    pub order: Vec<Part>,
    /// Fields used beyond the first that was spare, a multiple of four.
    pub spare: usize,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
}

/// Cuts a recording into kernels within limits, where its statements allow it. Values that cross a cut go through the fields from `spare`
/// on, rounded up to a whole vector. No input or output may use these fields.
///
/// # Panics
/// As [`wgsl`] does.
pub fn split(recording: &Recording, options: &ProgramOptions, limits: Limits, spare: u32) -> Split {
    let (inputs, outputs) = options.fields(recording);
    let spare = spare.next_multiple_of(4);
    let recording = &stops_last::with_stops_last(recording);
    let pieces = partition::pieces(recording, limits, spare);
    let (mut kernels, used) = emit::kernels(recording, options, &pieces, spare);
    // the last kernel may have no effect
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

/// The order with kernels renumbered, without those that were dropped.
fn renumbered(order: &[Part], numbers: &[Option<usize>]) -> Vec<Part> {
    let part = |part: &Part| match part {
        Part::Kernel(k) => numbers[*k].map(Part::Kernel),
        Part::Repeat {
            iterations,
            parts,
            exited,
        } => Some(Part::Repeat {
            iterations: *iterations,
            parts: renumbered(parts, numbers),
            exited: *exited,
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
        // a field that nobody wrote must not be used
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
                Part::Repeat {
                    iterations, parts, ..
                } => {
                    for _ in 0..*iterations {
                        self.run(parts, fields, scratch, tables);
                    }
                }
            }
        }
    }
}

//! A kernel: a part of a recording that reads and writes fields.

use super::cost::{self, Prices};
use crate::ir::recording::Recording;
use crate::wgsl::{ProgramOptions, sequence, wgsl};
use sim_physics::lane::Tables;

/// A part of a recording, from fields to fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    pub(super) recording: Recording,
    pub(super) options: ProgramOptions,
}

impl Kernel {
    /// The kernel as WGSL.
    pub fn wgsl(&self) -> String {
        wgsl(&self.recording, &self.options)
    }

    /// This kernel and another one that runs after it, as one program.
    ///
    /// # Panics
    /// As [`sequence`] does.
    pub fn wgsl_before(&self, next: &Kernel) -> String {
        sequence(&[
            (&self.recording, &self.options),
            (&next.recording, &next.options),
        ])
    }

    /// What it computes, from the fields `options().inputs` to `options().outputs`.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Fields of its inputs and outputs.
    pub fn options(&self) -> &ProgramOptions {
        &self.options
    }

    /// What it costs, in units of a simple statement.
    pub fn cost(&self, prices: &Prices) -> usize {
        cost::of_kernel(&self.recording.vectorized(), prices)
    }

    pub(super) fn run(&self, fields: &mut [f32], scratch: &mut [f32], tables: &Tables<f32>) {
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

//! Programs run once over nothing: some drivers compile a program where it first runs (Mesa's lavapipe), others do part of it there.
//!
//! So that takes place within the limit that the caller set for compiling, and the first run is like any other.

use crate::batch::{Batch, Replay, Slot};
use crate::device::Device;
use crate::error::DeviceError;
use crate::program::{Program, within};
use std::time::Duration;

/// What stands at each binding: no thread looks at it [bytes].
const NOTHING: u64 = 256;

impl Device {
    /// A program without workgroups: to run it is to have it compiled, or read from what the driver kept.
    pub(crate) fn over_nothing(&self, program: &Program) -> Result<Batch, DeviceError> {
        let nothing = self.buffer("nothing", NOTHING)?;
        let slots = program.0.bindings.iter().map(|binding| Slot {
            binding: binding.number,
            read_only: binding.read_only,
            buffer: nothing.0.clone(),
            range: 0..NOTHING,
        });
        let mut batch = self.batch(Replay::Recorded);
        batch.empty(program, slots.collect());
        batch.finish()
    }

    /// Runs each program with no workgroups. Only recorded programs wait for it: other drivers compile when they are asked to.
    ///
    /// Errors: the first program over which the driver takes longer than `limit`; its thread is left to itself.
    pub(crate) fn warm(&self, programs: &[Program], limit: Duration) -> Result<(), DeviceError> {
        if self.inner.vulkan.is_none() {
            return Ok(());
        }
        let batches = programs.iter().map(|program| self.over_nothing(program));
        let batches: Vec<Batch> = batches.collect::<Result<_, _>>()?;
        let labels = programs.iter().map(|p| p.label().to_owned()).collect();
        let device = self.clone();
        let run = move |place: usize| {
            let batch: &Batch = &batches[place];
            device.run(&[batch]).map_err(|e| e.to_string())
        };
        // one after another: a driver has one queue, and each program its own time
        within(&self.inner, labels, 1, limit, run)?;
        Ok(())
    }
}

//! First runs: every program runs once without workgroups, since some drivers compile at the first run.
//!
//! lavapipe compiles the whole program there, other drivers finish it. The run takes place within the caller's compile limit, so later
//! runs take their usual time.

use crate::batch::op::Slot;
use crate::batch::{Batch, Replay};
use crate::device::Device;
use crate::error::DeviceError;
use crate::program::Program;
use crate::program::workers::within;
use std::time::Duration;

/// Size of the dummy buffer behind every binding; no thread reads it [bytes].
const DUMMY_BYTES: u64 = 256;

/// A batch that runs a program without workgroups.
pub(super) fn empty_batch(device: &Device, program: &Program) -> Result<Batch, DeviceError> {
    let dummy = device.buffer("dummy", DUMMY_BYTES)?;
    let slots = program.0.bindings.iter().map(|binding| Slot {
        binding: binding.number,
        read_only: binding.read_only,
        buffer: dummy.0.clone(),
        range: 0..DUMMY_BYTES,
    });
    let mut batch = device.batch(Replay::Recorded);
    batch.empty(program, slots.collect());
    batch.finish()
}

/// Runs each program once without workgroups. Only the Vulkan route needs it: the other drivers compile when they are asked to.
///
/// Errors: the first program whose driver takes longer than `limit`; its thread is abandoned.
pub(crate) fn run_empty(
    device: &Device,
    programs: &[Program],
    limit: Duration,
) -> Result<(), DeviceError> {
    if device.inner.vulkan.is_none() {
        return Ok(());
    }
    let batches = programs.iter().map(|program| empty_batch(device, program));
    let batches: Vec<Batch> = batches.collect::<Result<_, _>>()?;
    let labels = programs.iter().map(|p| p.label().to_owned()).collect();
    let runner = device.clone();
    let run = move |place: usize| {
        let batch: &Batch = &batches[place];
        runner.run(&[batch]).map_err(|e| e.to_string())
    };
    // one after another: a driver has one queue, and the limit is per program
    within(&device.inner, labels, 1, limit, run)?;
    Ok(())
}

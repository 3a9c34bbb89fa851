//! Programs run once over nothing: some drivers compile a program where it first runs (Mesa's lavapipe), others do part of it there.
//!
//! So that takes place within the limit that the caller set for compiling, and the first run is like any other.

use crate::batch::{Batch, Command, Slot, Way};
use crate::device::Device;
use crate::error::DeviceError;
use crate::program::{Program, within};
use std::time::Duration;

/// What stands at each binding: no thread looks at it [bytes].
const NOTHING: u64 = 256;

impl Device {
    /// Runs each program with no workgroups. Only recorded programs wait for it: other drivers compile when they are asked to.
    ///
    /// Errors: the first program over which the driver takes longer than `limit`; its thread is left to itself.
    pub(crate) fn warm(&self, programs: &[Program], limit: Duration) -> Result<(), DeviceError> {
        let Some(vulkan) = &self.inner.vulkan else {
            return Ok(());
        };
        let nothing = self.buffer("nothing", NOTHING)?;
        let mut batches = Vec::with_capacity(programs.len());
        for program in programs {
            let slots = program.0.bindings.iter().map(|binding| Slot {
                binding: binding.number,
                read_only: binding.read_only,
                buffer: nothing.0.clone(),
                range: 0..NOTHING,
            });
            let commands = vec![Command::Dispatch {
                program: program.0.clone(),
                slots: slots.collect(),
                workgroups: 0,
            }];
            let recorded = vulkan.record(&commands).map_err(|e| {
                let reason = format!("recording: {e}");
                self.inner.failed(&e, DeviceError::Driver { reason })
            })?;
            batches.push(Batch {
                way: Way::Recorded(recorded),
                commands,
                staging: Vec::new(),
                device: self.inner.clone(),
            });
        }
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

//! Batches: dispatches and copies that are checked once and run often.

mod encode;
pub(crate) mod op;
pub(crate) mod run;

use crate::batch::op::{BatchOp, Groups, Slot, Staged, staged_buffers};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::memory::Buffer;
use crate::program::Program;
use crate::vulkan::Recording;
use std::ops::Range;
use std::sync::Arc;

/// How a batch gets to the device at each run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replay {
    /// Recorded once. Only the Vulkan route can; elsewhere as `Encoded`.
    Recorded,
    /// As `Recorded`, and the device notes when each command has ended: for benchmarks.
    Timed,
    /// Encoded through wgpu at every run.
    Encoded,
}

/// Commands that a device has accepted.
///
/// Each command sees the writes of all commands before it, in this batch and in earlier ones. A batch keeps its programs and buffers alive.
pub struct Batch {
    /// Dropped first: its programs and buffers must outlive it.
    pub(crate) route: Route,
    pub(crate) ops: Vec<BatchOp>,
    /// Staging buffers: they are locked while the batch runs.
    pub(crate) staging: Vec<Staged>,
    pub(crate) device: Arc<Inner>,
}

/// How a batch runs.
pub(crate) enum Route {
    Recorded(Box<Recording>),
    Encoded(Vec<wgpu::BindGroup>),
}

/// Collects the commands of a batch. `finish` reports the first that is wrong.
pub struct BatchBuilder {
    replay: Replay,
    ops: Vec<BatchOp>,
    failure: Option<DeviceError>,
    device: Arc<Inner>,
}

impl Device {
    /// A batch without commands.
    pub fn batch(&self, replay: Replay) -> BatchBuilder {
        BatchBuilder {
            replay,
            ops: Vec::new(),
            failure: None,
            device: self.inner.clone(),
        }
    }
}

impl Batch {
    /// The commands with what each took on the device in the last run [s], the wait for those before it included. Empty without
    /// `Replay::Timed`, on other routes, and before the first run.
    pub fn seconds(&self) -> Vec<(&str, f64)> {
        let seconds = match (&self.route, &self.device.vulkan) {
            (Route::Recorded(recording), Some(vulkan)) => vulkan.seconds(recording),
            _ => Vec::new(),
        };
        self.ops.iter().map(BatchOp::label).zip(seconds).collect()
    }
}

impl BatchBuilder {
    /// Runs `workgroups` of a program, with a range of a buffer [bytes] at each binding. Bindings that the program does not use are ignored.
    pub fn dispatch(
        &mut self,
        program: &Program,
        buffers: &[(u32, &Buffer, Range<u64>)],
        workgroups: u32,
    ) {
        let max = self.device.info.workgroups_max;
        if workgroups == 0 || workgroups > max {
            let reason = format!("{workgroups} workgroups; from 1 to {max} may be");
            return self.fail(program.label(), reason);
        }
        match self.slots(program, buffers) {
            Ok(slots) => self.push(program, slots, Groups::Given(workgroups)),
            Err(reason) => self.fail(program.label(), reason),
        }
    }

    /// As `dispatch`, with the number of workgroups that an earlier command wrote: three `u32` at a byte of `indirect`.
    /// The last two are 1. The first is at most the adapter's limit, and may be 0.
    pub fn dispatch_found(
        &mut self,
        program: &Program,
        buffers: &[(u32, &Buffer, Range<u64>)],
        indirect: &Buffer,
        at: u64,
    ) {
        if !Arc::ptr_eq(&indirect.0.device, &self.device) {
            let reason = format!("`{}` is another device's", indirect.label());
            return self.fail(program.label(), reason);
        }
        if !at.is_multiple_of(4) || at.checked_add(12).is_none_or(|end| end > indirect.bytes()) {
            let bytes = indirect.bytes();
            let reason = format!("numbers of workgroups at {at} of {bytes} bytes");
            return self.fail(program.label(), reason);
        }
        let groups = Groups::Found {
            buffer: indirect.0.clone(),
            at,
        };
        match self.slots(program, buffers) {
            // wgpu refuses it, as below
            Ok(slots)
                if slots
                    .iter()
                    .any(|slot| !slot.read_only && Arc::ptr_eq(&slot.buffer, &indirect.0)) =>
            {
                let reason = format!(
                    "it writes `{}`, which says how many workgroups run",
                    indirect.label()
                );
                self.fail(program.label(), reason);
            }
            Ok(slots) => self.push(program, slots, groups),
            Err(reason) => self.fail(program.label(), reason),
        }
    }

    fn push(&mut self, program: &Program, slots: Vec<Slot>, groups: Groups) {
        self.ops.push(BatchOp::Dispatch {
            program: program.0.clone(),
            slots,
            groups,
        });
    }

    /// Runs no workgroup of a program.
    pub(crate) fn empty(&mut self, program: &Program, slots: Vec<Slot>) {
        self.push(program, slots, Groups::Given(0));
    }

    /// Copies bytes; offsets and size are multiples of 4.
    pub fn copy(&mut self, from: &Buffer, from_at: u64, to: &Buffer, to_at: u64, bytes: u64) {
        match self.copied(from, from_at, to, to_at, bytes) {
            Ok(op) => self.ops.push(op),
            Err(reason) => self.fail(from.label(), reason),
        }
    }

    /// Hands the commands to the driver.
    ///
    /// Errors: the first command that is wrong; out of memory; for `Encoded`, errors of compiling for wgpu.
    pub fn finish(self) -> Result<Batch, DeviceError> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        self.device.alive()?;
        let route = match (&self.device.vulkan, self.replay) {
            (Some(vulkan), Replay::Recorded | Replay::Timed) => {
                let ops: Vec<_> = self.ops.iter().map(BatchOp::raw).collect();
                let is_timed = self.replay == Replay::Timed;
                Route::Recorded(vulkan.record(&ops, is_timed).map_err(|e| {
                    let reason = format!("recording: {e}");
                    self.device.failed(&e, DeviceError::Driver { reason })
                })?)
            }
            _ => Route::Encoded(encode::bind_groups(&self.ops)?),
        };
        Ok(Batch {
            route,
            staging: staged_buffers(&self.ops),
            ops: self.ops,
            device: self.device,
        })
    }

    fn fail(&mut self, label: &str, reason: String) {
        let label = label.to_owned();
        self.failure
            .get_or_insert(DeviceError::Command { label, reason });
    }

    /// The buffers that a program sees, checked.
    fn slots(
        &self,
        program: &Program,
        buffers: &[(u32, &Buffer, Range<u64>)],
    ) -> Result<Vec<Slot>, String> {
        if !Arc::ptr_eq(&program.0.device, &self.device) {
            return Err("the program is another device's".to_owned());
        }
        let mut slots: Vec<Slot> = Vec::new();
        for wanted in &program.0.bindings {
            let number = wanted.number;
            let mut given = buffers.iter().filter(|(binding, ..)| *binding == number);
            let Some((_, buffer, range)) = given.next() else {
                return Err(format!("nothing is given for binding {number}"));
            };
            if given.next().is_some() {
                return Err(format!("binding {number} is given twice"));
            }
            let slot = Slot {
                binding: number,
                read_only: wanted.read_only,
                buffer: buffer.0.clone(),
                range: range.clone(),
            };
            self.check(&slot)
                .map_err(|reason| format!("binding {number}, `{}`: {reason}", buffer.label()))?;
            // wgpu refuses it, since one dispatch would read what it writes
            if let Some(other) = slots.iter().find(|other| {
                Arc::ptr_eq(&other.buffer, &slot.buffer) && other.read_only != slot.read_only
            }) {
                let other = other.binding;
                return Err(format!(
                    "`{}` is read-only at one of bindings {other} and {number} and written at the other",
                    buffer.label()
                ));
            }
            slots.push(slot);
        }
        Ok(slots)
    }

    fn check(&self, slot: &Slot) -> Result<(), String> {
        let info = &self.device.info;
        let Range { start, end } = slot.range;
        if !Arc::ptr_eq(&slot.buffer.device, &self.device) {
            return Err("the buffer is another device's".to_owned());
        }
        if start >= end || end > slot.buffer.bytes {
            let bytes = slot.buffer.bytes;
            return Err(format!("range {start}..{end} of {bytes} bytes"));
        }
        if !start.is_multiple_of(info.binding_align) || !end.is_multiple_of(4) {
            let align = info.binding_align;
            return Err(format!(
                "range {start}..{end} must start at a multiple of {align} and end at one of 4"
            ));
        }
        if end - start > info.binding_max {
            let max = info.binding_max;
            return Err(format!(
                "range {start}..{end} is larger than the adapter's {max} bytes"
            ));
        }
        Ok(())
    }

    fn copied(
        &self,
        from: &Buffer,
        from_at: u64,
        to: &Buffer,
        to_at: u64,
        bytes: u64,
    ) -> Result<BatchOp, String> {
        for (buffer, at) in [(from, from_at), (to, to_at)] {
            let label = buffer.label();
            if !Arc::ptr_eq(&buffer.0.device, &self.device) {
                return Err(format!("`{label}` is another device's"));
            }
            if at.checked_add(bytes).is_none_or(|end| end > buffer.bytes()) || bytes == 0 {
                let size = buffer.bytes();
                return Err(format!(
                    "{bytes} bytes at {at} of `{label}`, which has {size}"
                ));
            }
            if !at.is_multiple_of(4) || !bytes.is_multiple_of(4) {
                return Err(format!(
                    "{bytes} bytes at {at} of `{label}`: not multiples of 4"
                ));
            }
        }
        if Arc::ptr_eq(&from.0, &to.0) {
            return Err("copies within one buffer are not supported".to_owned());
        }
        Ok(BatchOp::Copy {
            from: from.0.clone(),
            from_at,
            to: to.0.clone(),
            to_at,
            bytes,
        })
    }
}

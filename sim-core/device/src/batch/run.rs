//! Runs: batches are submitted together and waited for.

use crate::adapter::AdapterKind;
use crate::batch::encode;
use crate::batch::op::Staged;
use crate::batch::{Batch, Route};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::memory::shared::Moment;
use crate::memory::staging;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, TryLockError};
use std::time::{Duration, Instant};

thread_local! {
    /// Runs that this thread may ask for before its device is lost.
    static RUNS_LEFT: Cell<u64> = const { Cell::new(u64::MAX) };
}

/// Loses the device of this thread after so many runs, as a driver may. For tests of the error path.
#[doc(hidden)]
pub fn lose_after(runs: u64) {
    RUNS_LEFT.set(runs);
}

impl Device {
    /// Runs batches in order, as one submission, and waits until they are done.
    ///
    /// Errors: `DeviceError::Busy` if a view of one of their staging buffers is held; `DeviceError::Lost`.
    pub fn run(&self, batches: &[&Batch]) -> Result<(), DeviceError> {
        self.run_between(batches, None, None)
    }

    /// As `run`, of memory that another process uses too: begins when a timeline has the value `after`, and advances one to `done`.
    ///
    /// The other process must have ordered its value before: the call waits for it without a limit.
    pub fn run_between(
        &self,
        batches: &[&Batch],
        after: Option<Moment<'_>>,
        done: Option<Moment<'_>>,
    ) -> Result<(), DeviceError> {
        let inner = &self.inner;
        inner.alive()?;
        match RUNS_LEFT.get() {
            u64::MAX => {}
            0 => self.lose(),
            left => RUNS_LEFT.set(left - 1),
        }
        for batch in batches {
            assert!(Arc::ptr_eq(&batch.device, inner), "a batch of this device");
        }
        for (timeline, _) in after.iter().chain(&done) {
            assert!(timeline.is_of(inner), "a timeline of this device");
        }
        let staged_buffers = distinct(batches);
        let mut locked = Vec::with_capacity(staged_buffers.len());
        for staged in &staged_buffers {
            let host = staged.memory.host.as_ref().expect("staging");
            locked.push(match host.bytes.try_write() {
                Ok(guard) => guard,
                Err(TryLockError::Poisoned(e)) => e.into_inner(),
                Err(TryLockError::WouldBlock) => {
                    let label = staged.memory.label.clone();
                    return Err(DeviceError::Busy { label });
                }
            });
        }
        // wgpu panics if the device is lost during a wait; no state of this crate is half updated then
        let done = catch_unwind(AssertUnwindSafe(|| {
            for (staged, bytes) in staged_buffers.iter().zip(&locked) {
                staging::upload(&inner.queue, &staged.memory, bytes);
            }
            inner.submit(batches, &staged_buffers, [after, done])?;
            for (staged, bytes) in staged_buffers.iter().zip(&mut locked) {
                if staged.written {
                    staging::receive(&inner.wgpu, &staged.memory, bytes)?;
                }
            }
            Ok(())
        }));
        match done {
            Ok(done) => {
                // what wgpu reports by itself comes first: it carries the driver's message
                inner.alive()?;
                done
            }
            Err(_) => Err(inner.lose("wgpu gave up during a run")),
        }
    }
}

impl Inner {
    /// Submits all batches at once and waits.
    fn submit(
        &self,
        batches: &[&Batch],
        staged_buffers: &[Staged],
        order: [Option<Moment<'_>>; 2],
    ) -> Result<(), DeviceError> {
        let mut buffers = Vec::new();
        let mut accepted = true;
        let mut rest = batches;
        while let Some(first) = rest.first() {
            let mut encoder = self.encoder();
            let mut recorded = Vec::new();
            while let Some(Route::Recorded(recording)) = rest.first().map(|batch| &batch.route) {
                recorded.push(&**recording);
                rest = &rest[1..];
            }
            match (&self.vulkan, &first.route) {
                (Some(vulkan), Route::Recorded(_)) => {
                    accepted &= vulkan.execute(&mut encoder, &recorded);
                }
                (_, Route::Encoded(groups)) => {
                    encode::encode(&mut encoder, &first.ops, groups)?;
                    rest = &rest[1..];
                }
                (None, Route::Recorded(_)) => unreachable!("recorded on the Vulkan route"),
            }
            buffers.push(encoder.finish());
        }
        match (&self.vulkan, batches.last().map(|batch| &batch.route)) {
            // what wgpu encodes ends without a barrier for the host
            (Some(vulkan), Some(Route::Encoded(_))) => {
                let mut encoder = self.encoder();
                accepted &= vulkan.execute(&mut encoder, &[]);
                buffers.push(encoder.finish());
            }
            (None, _) => {
                let mut encoder = self.encoder();
                for staged in staged_buffers.iter().filter(|staged| staged.written) {
                    staging::fetch(&mut encoder, &staged.memory);
                }
                buffers.push(encoder.finish());
            }
            _ => {}
        }
        if let Some(vulkan) = &self.vulkan {
            let raw = order.map(|moment| moment.map(|(timeline, value)| (timeline.raw(), value)));
            vulkan.order(&self.queue, raw[0], raw[1]);
        }
        let index = self.queue.submit(buffers);
        let done = self.wait(index);
        // waiting also lets wgpu report why it took no commands
        self.alive()?;
        match done {
            Ok(_) if accepted => {
                if let Some(vulkan) = &self.vulkan {
                    let routes = batches.iter().map(|batch| &batch.route);
                    let recorded = routes.filter_map(|route| match route {
                        Route::Recorded(recording) => Some(&**recording),
                        Route::Encoded(_) => None,
                    });
                    recorded.for_each(|recording| vulkan.done(recording));
                }
                Ok(())
            }
            Ok(_) => Err(self.lose("its commands are not taken")),
            Err(e) => Err(self.lose(&format!("waiting for a run: {e}"))),
        }
    }
}

/// How long a run is watched before the thread sleeps: a thread that sleeps is woken late, and most frames take less than this.
const WATCHED: Duration = Duration::from_millis(2);

impl Inner {
    /// Waits until a submission is done.
    fn wait(&self, index: wgpu::SubmissionIndex) -> Result<wgpu::PollStatus, wgpu::PollError> {
        // a software driver needs this processor
        if self.info.kind != AdapterKind::Software {
            let since = Instant::now();
            while since.elapsed() < WATCHED {
                if self.wgpu.poll(wgpu::PollType::Poll)?.is_queue_empty() {
                    break;
                }
                std::thread::yield_now();
            }
        }
        // returns at once after the above, but reports a submission that was not accepted
        self.wgpu.poll(wgpu::PollType::Wait {
            submission_index: Some(index),
            timeout: None,
        })
    }
}

/// The staging buffers of several batches, without repetition.
fn distinct(batches: &[&Batch]) -> Vec<Staged> {
    let mut buffers: Vec<Staged> = Vec::new();
    for staged in batches.iter().flat_map(|batch| &batch.staging) {
        match buffers
            .iter_mut()
            .find(|other| Arc::ptr_eq(&other.memory, &staged.memory))
        {
            Some(other) => other.written |= staged.written,
            None => buffers.push(staged.clone()),
        }
    }
    buffers
}

//! Memory that another process maps on the same card, and timelines that order the work of both.
//!
//! The other process imports each by a descriptor: with CUDA `cuImportExternalMemory` and `cuImportExternalSemaphore`, with Vulkan
//! `VK_KHR_external_memory_fd` and `VK_KHR_external_semaphore_fd`. Only the Vulkan route exports.

use crate::allocation::GRAIN;
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::memory::Buffer;
use crate::vulkan::RawTimeline;
use std::sync::Arc;
use std::time::Duration;

/// A descriptor of the driver, which the importing process takes over.
#[cfg(unix)]
pub type Descriptor = std::os::fd::OwnedFd;
/// No other system exports.
#[cfg(not(unix))]
pub type Descriptor = std::convert::Infallible;

/// Device memory that another process can import.
pub struct SharedBuffer {
    /// The buffer here.
    pub buffer: Buffer,
    /// What the other process imports.
    pub memory: Descriptor,
    /// Size of the allocation, which the other process must name [bytes].
    pub allocated: u64,
    /// Whether the allocation belongs to this buffer alone, which the other process must say.
    pub dedicated: bool,
}

/// A counter that programs of two processes wait for and advance. It only grows.
#[derive(Clone)]
pub struct Timeline(Arc<Counter>);

/// Field order matters: the semaphore goes before its device.
struct Counter {
    raw: RawTimeline,
    device: Arc<Inner>,
}

/// A value of a timeline.
pub type Moment<'a> = (&'a Timeline, u64);

impl Device {
    /// Identifies the card across APIs, as `cuDeviceGetUuid` does; none off the Vulkan route.
    pub fn uuid(&self) -> Option<[u8; 16]> {
        self.inner.vulkan.as_ref().map(|vulkan| vulkan.uuid())
    }

    /// Memory of the device that another process can import, zeroed.
    ///
    /// Errors: `DeviceError::Export` where the driver does not export memory, or has no room.
    pub fn shared_buffer(&self, label: &str, bytes: u64) -> Result<SharedBuffer, DeviceError> {
        let inner = &self.inner;
        inner.alive()?;
        let refused = |reason| DeviceError::Export { reason };
        let Some(vulkan) = &inner.vulkan else {
            return Err(refused("only Vulkan exports memory".to_owned()));
        };
        let rounded = bytes.max(1).next_multiple_of(GRAIN);
        if rounded > inner.buffer_max {
            let most = inner.buffer_max;
            let reason = format!("{bytes} bytes are more than the {most} of the largest buffer");
            return Err(refused(reason));
        }
        let made = vulkan.allocate_exported(&inner.wgpu, rounded);
        let ((wgpu, raw, _), exported) = made.map_err(refused)?;
        let mut encoder = inner.encoder();
        encoder.clear_buffer(&wgpu, 0, None);
        inner.queue.submit([encoder.finish()]);
        inner.alive()?;
        Ok(SharedBuffer {
            buffer: self.named(label, bytes, wgpu, Some(raw), None),
            memory: exported.memory,
            allocated: exported.bytes,
            dedicated: exported.dedicated,
        })
    }

    /// A timeline at 0, and what another process imports it by.
    ///
    /// Errors: `DeviceError::Export` where the driver does not export timelines.
    pub fn timeline(&self) -> Result<(Timeline, Descriptor), DeviceError> {
        self.inner.alive()?;
        let made = match &self.inner.vulkan {
            Some(vulkan) => vulkan.timeline(),
            None => Err("only Vulkan exports semaphores".to_owned()),
        };
        let (raw, descriptor) = made.map_err(|reason| DeviceError::Export { reason })?;
        let device = self.inner.clone();
        Ok((Timeline(Arc::new(Counter { raw, device })), descriptor))
    }
}

impl Timeline {
    /// Waits until the timeline has a value; false if it has not in time.
    ///
    /// Errors: `DeviceError::Lost`.
    pub fn wait(&self, value: u64, timeout: Duration) -> Result<bool, DeviceError> {
        let waited = self.0.raw.wait(value, timeout);
        waited.map_err(|e| {
            let reason = format!("waiting for another process: {e}");
            self.0.device.failed(&e, DeviceError::Driver { reason })
        })
    }

    /// The semaphore itself.
    pub(crate) fn raw(&self) -> &RawTimeline {
        &self.0.raw
    }

    /// Whether it is of this device.
    pub(crate) fn is_of(&self, device: &Arc<Inner>) -> bool {
        Arc::ptr_eq(&self.0.device, device)
    }
}

// a software driver that exports no timelines has them all the same
#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use crate::{Choice, Replay};
    use std::thread;

    fn timeline_here(device: &Device) -> Timeline {
        let vulkan = device.inner.vulkan.as_ref();
        let raw = vulkan.expect("a Vulkan driver").timeline_here();
        let device = device.inner.clone();
        Timeline(Arc::new(Counter { raw, device }))
    }

    #[test]
    fn work_begins_at_a_value_of_one_timeline_and_then_advances_another() {
        let device = Device::open(&Choice::First, None).expect("the tests need an adapter");
        let (ready, done) = (timeline_here(&device), timeline_here(&device));
        let [from, to] = [1, 2].map(|byte| {
            let staging = device.staging("numbers", 16).unwrap();
            staging.write().fill(byte);
            staging
        });
        let mut batch = device.batch(Replay::Recorded);
        batch.copy(&from, 0, &to, 0, 16);
        let batch = batch.finish().unwrap();
        let has = |timeline: &Timeline, value, within| timeline.wait(value, within).unwrap();
        let (soon, late) = (Duration::from_millis(50), Duration::from_secs(60));
        thread::scope(|scope| {
            let run = || device.run_between(&[&batch], Some((&ready, 5)), Some((&done, 3)));
            let running = scope.spawn(run);
            assert!(!has(&done, 1, soon), "nothing is ready");
            ready.raw().signal(4);
            assert!(!has(&done, 1, soon), "5 is waited for");
            ready.raw().signal(5);
            assert!(has(&done, 3, late));
            running.join().unwrap().unwrap();
        });
        assert!(!has(&done, 4, Duration::ZERO));
        assert_eq!(to.read()[..], [1; 16]);
    }
}

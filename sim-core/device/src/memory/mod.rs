//! Memory of the device, and memory that the host sees too.

pub(crate) mod shared;
pub(crate) mod staging;

use crate::adapter::ready;
use crate::allocation::{GRAIN, Residence, USAGES};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::host_pages::Pinned;
use crate::vulkan;
use std::cell::Cell;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A storage buffer. Clones name the same memory.
#[derive(Clone)]
pub struct Buffer(pub(crate) Arc<Memory>);

/// Memory of a buffer. Field order matters: the buffers are dropped before the device and before the pages under them.
pub(crate) struct Memory {
    pub label: String,
    /// Size that was asked for [bytes]; what is allocated is a multiple of `GRAIN`.
    pub bytes: u64,
    /// Vulkan's handle of the buffer, on that route.
    pub raw: Option<vulkan::Handle>,
    pub wgpu: wgpu::Buffer,
    /// The host's side of a staging buffer.
    pub host: Option<HostSide>,
    pub device: Arc<Inner>,
    /// The host's pages, where they were imported.
    pub _pinned: Option<Pinned>,
}

impl Memory {
    /// Vulkan's handle of the buffer.
    pub fn raw(&self) -> &vulkan::Handle {
        self.raw.as_ref().expect("allocated on the Vulkan route")
    }
}

/// The host's side of a staging buffer.
pub(crate) struct HostSide {
    pub bytes: RwLock<HostBytes>,
    /// Portable route: a buffer that the host maps, since it cannot map one that a program writes.
    pub mirror: Option<wgpu::Buffer>,
}

/// Bytes that the host reads and writes.
pub(crate) enum HostBytes {
    /// The device's own memory, mapped.
    Mapped(vulkan::Mapped),
    /// A copy, which `run` sends and receives. Words, so that floats can be read in place.
    Copied(Vec<u64>),
}

impl HostBytes {
    pub fn slice(&self) -> &[u8] {
        match self {
            HostBytes::Mapped(mapped) => mapped.slice(),
            HostBytes::Copied(words) => bytemuck::cast_slice(words),
        }
    }

    pub fn slice_mut(&mut self) -> &mut [u8] {
        match self {
            HostBytes::Mapped(mapped) => mapped.slice_mut(),
            HostBytes::Copied(words) => bytemuck::cast_slice_mut(words),
        }
    }
}

impl Buffer {
    /// Size [bytes].
    pub fn bytes(&self) -> u64 {
        self.0.bytes
    }

    /// Name, for errors.
    pub fn label(&self) -> &str {
        &self.0.label
    }
}

/// A buffer that host and device share. It dereferences to `Buffer`.
///
/// A batch locks its staging buffers while it runs. Holding a view then is an error (`DeviceError::Busy`).
#[derive(Clone)]
pub struct Staging(pub(crate) Buffer);

impl Deref for Staging {
    type Target = Buffer;

    fn deref(&self) -> &Buffer {
        &self.0
    }
}

impl Staging {
    /// The bytes as the last run left them. Waits for a run, or for a `Write` of another thread.
    pub fn read(&self) -> Read<'_> {
        let lock = &self.host().bytes;
        Read {
            guard: lock.read().unwrap_or_else(|e| e.into_inner()),
            bytes: self.bytes() as usize,
        }
    }

    /// The bytes, to be seen by the next run. Waits for a run, or for views of other threads.
    pub fn write(&self) -> Write<'_> {
        let lock = &self.host().bytes;
        Write {
            guard: lock.write().unwrap_or_else(|e| e.into_inner()),
            bytes: self.bytes() as usize,
        }
    }

    fn host(&self) -> &HostSide {
        self.0.0.host.as_ref().expect("staging has a host's side")
    }
}

/// Bytes of a staging buffer, read. Aligned to 8 bytes at least.
pub struct Read<'a> {
    guard: RwLockReadGuard<'a, HostBytes>,
    bytes: usize,
}

impl Deref for Read<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.guard.slice()[..self.bytes]
    }
}

/// Bytes of a staging buffer, written. Aligned to 8 bytes at least.
pub struct Write<'a> {
    guard: RwLockWriteGuard<'a, HostBytes>,
    bytes: usize,
}

impl Deref for Write<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.guard.slice()[..self.bytes]
    }
}

impl DerefMut for Write<'_> {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.guard.slice_mut()[..self.bytes]
    }
}

thread_local! {
    /// Buffers that this thread may allocate.
    static ALLOCATIONS_LEFT: Cell<u64> = const { Cell::new(u64::MAX) };
}

/// Lets this thread run out of memory after so many buffers. For tests of the error path.
#[doc(hidden)]
pub fn allocate_at_most(buffers: u64) {
    ALLOCATIONS_LEFT.set(buffers);
}

impl Device {
    /// Memory of the device, zeroed.
    pub fn buffer(&self, label: &str, bytes: u64) -> Result<Buffer, DeviceError> {
        self.make(label, bytes, Residence::Device)
    }

    /// Memory that the host reads and writes between runs, zeroed. `bytes` are less than the adapter's memory.
    pub fn staging(&self, label: &str, bytes: u64) -> Result<Staging, DeviceError> {
        Ok(Staging(self.make(label, bytes, Residence::Host)?))
    }

    fn make(&self, label: &str, bytes: u64, place: Residence) -> Result<Buffer, DeviceError> {
        self.inner.alive()?;
        let left = ALLOCATIONS_LEFT.get();
        ALLOCATIONS_LEFT.set(left.saturating_sub(u64::from(left < u64::MAX)));
        let no_room = || DeviceError::OutOfMemory {
            label: label.to_owned(),
            bytes,
        };
        let limit = self.inner.buffer_max.min(isize::MAX as u64) - GRAIN;
        if left == 0 || bytes > limit.min(self.info().memory.unwrap_or(u64::MAX)) {
            return Err(no_room());
        }
        let rounded = bytes.max(1).next_multiple_of(GRAIN);
        let (wgpu, raw, host) = match &self.inner.vulkan {
            Some(vulkan) => {
                let made = vulkan.allocate(&self.inner.wgpu, rounded, place);
                let (wgpu, handle, mapped) = made.map_err(|e| self.inner.failed(&e, no_room()))?;
                let host = mapped.map(|mapped| HostSide {
                    bytes: RwLock::new(HostBytes::Mapped(mapped)),
                    mirror: None,
                });
                (wgpu, Some(handle), host)
            }
            None => {
                let buffer = |usage| {
                    let scope = self
                        .inner
                        .wgpu
                        .push_error_scope(wgpu::ErrorFilter::OutOfMemory);
                    let made = self.inner.wgpu.create_buffer(&wgpu::BufferDescriptor {
                        label: Some(label),
                        size: rounded,
                        usage,
                        mapped_at_creation: false,
                    });
                    match ready(scope.pop()) {
                        Some(_) => Err(no_room()),
                        None => Ok(made),
                    }
                };
                let host = match place {
                    Residence::Device => None,
                    Residence::Host => Some(HostSide {
                        bytes: RwLock::new(HostBytes::Copied(vec![0; rounded as usize / 8])),
                        mirror: Some(buffer(
                            wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                        )?),
                    }),
                };
                (buffer(USAGES)?, None, host)
            }
        };
        // the host clears its own side: it would see a command of the device only after a run
        if let Some(host) = &host {
            let mut bytes = host.bytes.write().unwrap_or_else(|e| e.into_inner());
            bytes.slice_mut().fill(0);
        } else {
            let mut encoder = self.inner.encoder();
            encoder.clear_buffer(&wgpu, 0, None);
            self.inner.queue.submit([encoder.finish()]);
        }
        self.inner.alive()?;
        Ok(self.named(label, bytes, wgpu, raw, host))
    }

    pub(crate) fn named(
        &self,
        label: &str,
        bytes: u64,
        wgpu: wgpu::Buffer,
        raw: Option<vulkan::Handle>,
        host: Option<HostSide>,
    ) -> Buffer {
        Buffer(Arc::new(Memory {
            label: label.to_owned(),
            bytes,
            raw,
            wgpu,
            host,
            device: self.inner.clone(),
            _pinned: None,
        }))
    }
}

//! Memory of the device, and memory that the host sees too.

use crate::device::Inner;
use crate::vulkan;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A storage buffer. Clones name the same memory.
#[derive(Clone)]
pub struct Buffer(pub(crate) Arc<Memory>);

/// Memory of a buffer. The fields go in this order: what lies in the device goes before the device.
pub(crate) struct Memory {
    pub label: String,
    /// Size that was asked for [bytes]; what is allocated is a multiple of `GRAIN`.
    pub bytes: u64,
    /// Vulkan's name of it, where that is the route.
    pub raw: Option<vulkan::Handle>,
    pub wgpu: wgpu::Buffer,
    /// The host's side of a staging buffer.
    pub host: Option<Host>,
    pub device: Arc<Inner>,
}

/// Allocations are multiples of this, so that they can be cleared and copied whole [bytes].
pub(crate) const GRAIN: u64 = 16;

/// What every buffer may be used for.
pub(crate) const USAGES: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::INDIRECT)
    .union(wgpu::BufferUsages::COPY_SRC)
    .union(wgpu::BufferUsages::COPY_DST);

/// The host's side of a staging buffer.
pub(crate) struct Host {
    pub bytes: RwLock<HostBytes>,
    /// Portable route: what the host maps, since it cannot map what a program writes.
    pub mirror: Option<wgpu::Buffer>,
}

/// Bytes that the host reads and writes.
pub(crate) enum HostBytes {
    /// The device's own memory, mapped.
    Mapped(vulkan::Mapped),
    /// A copy, which `run` carries there and back. Words, so that floats may be read in place.
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

/// A buffer that host and device share; it stands for a `Buffer` wherever one is asked for.
///
/// A batch that names it locks it while it runs, so no view may be held then (`DeviceError::Busy`).
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

    fn host(&self) -> &Host {
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

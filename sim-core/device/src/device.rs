//! A device: opened once, then memory, programs and runs.

use crate::adapter::{AdapterInfo, Choice, choose, ready};
use crate::batch::{Batch, Staged, Way};
use crate::cache::Cache;
use crate::error::DeviceError;
use crate::memory::{Buffer, GRAIN, Host, HostBytes, Memory, Staging, USAGES};
use crate::portable;
use crate::vulkan::{self, Vulkan};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, RwLock, TryLockError};

thread_local! {
    /// Runs that this thread may ask for before a device is lost.
    static RUNS_LEFT: Cell<u64> = const { Cell::new(u64::MAX) };
}

/// Loses the device of this thread's next run but so many, as a driver might. For tests of what comes after.
#[doc(hidden)]
pub fn lose_after(runs: u64) {
    RUNS_LEFT.set(runs);
}

/// An open device. Clones name the same one; it closes when its last clone, buffer, program and batch are gone.
#[derive(Clone)]
pub struct Device {
    pub(crate) inner: Arc<Inner>,
}

/// What all that a device made holds on to. The fields go in this order: `vulkan` goes before the device under it.
pub(crate) struct Inner {
    pub vulkan: Option<Vulkan>,
    pub queue: wgpu::Queue,
    pub wgpu: wgpu::Device,
    pub info: AdapterInfo,
    /// Vulkan route: other drivers keep their own.
    pub cache: Option<Cache>,
    /// Threads that compile.
    pub compiling: AtomicUsize,
    trouble: Arc<Trouble>,
    buffer_max: u64,
}

/// What wgpu has told outside of calls.
#[derive(Default)]
struct Trouble {
    lost: Mutex<Option<String>>,
    other: Mutex<Option<String>>,
}

impl Trouble {
    fn note(place: &Mutex<Option<String>>, reason: String) {
        let mut place = place.lock().unwrap_or_else(|e| e.into_inner());
        place.get_or_insert(reason);
    }
}

impl Device {
    /// Opens a device. `cache` is a folder that keeps compiled programs from run to run (on Vulkan: elsewhere drivers do so
    /// themselves). It is made where it is not there; where it cannot be written, nothing is kept.
    pub fn open(choice: &Choice, cache: Option<&Path>) -> Result<Device, DeviceError> {
        Device::open_by(choice, cache, true)
    }

    /// As `open`, but everything goes through wgpu, as it does on machines without Vulkan.
    #[doc(hidden)]
    pub fn open_portable(choice: &Choice, cache: Option<&Path>) -> Result<Device, DeviceError> {
        Device::open_by(choice, cache, false)
    }

    fn open_by(choice: &Choice, cache: Option<&Path>, raw: bool) -> Result<Device, DeviceError> {
        let (adapter, mut info) = choose(choice)?;
        let refused = |reason: String| DeviceError::Open {
            adapter: info.name.clone(),
            reason,
        };
        let wanted = wgpu::DeviceDescriptor {
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = match raw.then(|| vulkan::open(&adapter, &wanted)).flatten() {
            Some(opened) => opened.map(|(device, queue, vulkan)| (device, queue, Some(vulkan))),
            None => ready(adapter.request_device(&wanted))
                .map(|(device, queue)| (device, queue, None))
                .map_err(|e| e.to_string()),
        };
        let (device, queue, mut vulkan) = opened.map_err(refused)?;

        let trouble = Arc::new(Trouble::default());
        let lost = trouble.clone();
        device.set_device_lost_callback(move |reason, words| {
            Trouble::note(&lost.lost, format!("{reason:?} {words}").trim().to_owned());
        });
        let other = trouble.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            Trouble::note(&other.other, e.to_string());
        }));
        info.imports = vulkan.as_ref().is_some_and(|vulkan| vulkan.probe(&device));
        let cache = vulkan.as_mut().zip(cache).map(|(vulkan, folder)| {
            let cache = Cache::new(folder, vulkan.driver());
            vulkan.remember(&cache.pipelines());
            cache
        });
        Ok(Device {
            inner: Arc::new(Inner {
                vulkan,
                queue,
                buffer_max: device.limits().max_buffer_size,
                wgpu: device,
                info,
                cache,
                compiling: AtomicUsize::new(0),
                trouble,
            }),
        })
    }

    /// What was opened.
    pub fn info(&self) -> &AdapterInfo {
        &self.inner.info
    }

    /// Threads that compile, those included that `programs` has given up.
    pub fn compiling(&self) -> usize {
        self.inner.compiling.load(Ordering::Relaxed)
    }

    /// Programs, so far, whose words were found in the folder given to `open`.
    pub fn cached(&self) -> usize {
        let cache = self.inner.cache.as_ref();
        cache.map_or(0, |cache| cache.hits.load(Ordering::Relaxed))
    }

    /// Memory of the device, zeroed.
    pub fn buffer(&self, label: &str, bytes: u64) -> Result<Buffer, DeviceError> {
        self.make(label, bytes, vulkan::Place::Device)
    }

    /// Memory that the host reads and writes between runs, zeroed. `bytes` are less than the adapter's memory.
    pub fn staging(&self, label: &str, bytes: u64) -> Result<Staging, DeviceError> {
        Ok(Staging(self.make(label, bytes, vulkan::Place::Host)?))
    }

    fn make(&self, label: &str, bytes: u64, place: vulkan::Place) -> Result<Buffer, DeviceError> {
        self.inner.alive()?;
        let no_room = || DeviceError::OutOfMemory {
            label: label.to_owned(),
            bytes,
        };
        let limit = self.inner.buffer_max.min(isize::MAX as u64) - GRAIN;
        if bytes > limit.min(self.info().memory.unwrap_or(u64::MAX)) {
            return Err(no_room());
        }
        let rounded = bytes.max(1).next_multiple_of(GRAIN);
        let (wgpu, raw, host) = match &self.inner.vulkan {
            Some(vulkan) => {
                let made = vulkan.allocate(&self.inner.wgpu, rounded, place);
                let (wgpu, handle, mapped) = made.map_err(|e| self.inner.failed(&e, no_room()))?;
                let host = mapped.map(|mapped| Host {
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
                    vulkan::Place::Device => None,
                    vulkan::Place::Host => Some(Host {
                        bytes: RwLock::new(HostBytes::Copied(vec![0; rounded as usize / 8])),
                        mirror: Some(buffer(
                            wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                        )?),
                    }),
                };
                (buffer(USAGES)?, None, host)
            }
        };
        // commands of the device would be seen by the host only after a run
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

    /// Pages of the host as a buffer: programs and copies read and write them where they lie.
    ///
    /// Errors: `DeviceError::Import` where the driver does not take them; nothing has happened then.
    ///
    /// # Safety
    /// `at` is mapped for `bytes`, readable and writable, for as long as the buffer or a batch that names it lives, and nobody
    /// relies on its contents while a batch that writes them runs.
    pub unsafe fn import(&self, at: *mut u8, bytes: u64) -> Result<Buffer, DeviceError> {
        self.inner.alive()?;
        let made = match &self.inner.vulkan {
            // SAFETY: as promised by the caller.
            Some(vulkan) => unsafe { vulkan.import(&self.inner.wgpu, at, bytes) },
            None => Err("only Vulkan can".to_owned()),
        };
        let (wgpu, raw, _) = made.map_err(|reason| DeviceError::Import { reason })?;
        Ok(self.named("imported", bytes, wgpu, Some(raw), None))
    }

    fn named(
        &self,
        label: &str,
        bytes: u64,
        wgpu: wgpu::Buffer,
        raw: Option<vulkan::Handle>,
        host: Option<Host>,
    ) -> Buffer {
        Buffer(Arc::new(Memory {
            label: label.to_owned(),
            bytes,
            raw,
            wgpu,
            host,
            device: self.inner.clone(),
        }))
    }

    /// Runs batches in their order, as one submission, and waits until they are done.
    ///
    /// Errors: `DeviceError::Busy` where a staging buffer of theirs is being looked at; `DeviceError::Lost`.
    pub fn run(&self, batches: &[&Batch]) -> Result<(), DeviceError> {
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
        let staging = distinct(batches);
        let mut locked = Vec::with_capacity(staging.len());
        for staged in &staging {
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
        // wgpu panics where a wait finds the device lost; nothing of ours is half done then
        let done = catch_unwind(AssertUnwindSafe(|| {
            for (staged, bytes) in staging.iter().zip(&locked) {
                portable::upload(&inner.queue, &staged.memory, bytes);
            }
            inner.submit(batches, &staging)?;
            for (staged, bytes) in staging.iter().zip(&mut locked) {
                if staged.written {
                    portable::receive(&inner.wgpu, &staged.memory, bytes)?;
                }
            }
            Ok(())
        }));
        match done {
            Ok(done) => {
                // what wgpu tells by itself comes first: it has the driver's words
                inner.alive()?;
                done
            }
            Err(_) => Err(inner.lose("wgpu gave up during a run")),
        }
    }

    /// Loses the device, as a driver might. For tests of what comes after.
    #[doc(hidden)]
    pub fn lose(&self) {
        self.inner.wgpu.destroy();
    }
}

impl Inner {
    /// Refuses work once the device is lost or something unexpected happened.
    pub fn alive(&self) -> Result<(), DeviceError> {
        let said = |place: &Mutex<Option<String>>| {
            let place = place.lock().unwrap_or_else(|e| e.into_inner());
            place.clone()
        };
        if let Some(reason) = said(&self.trouble.lost) {
            return Err(DeviceError::Lost { reason });
        }
        match said(&self.trouble.other) {
            Some(reason) => Err(DeviceError::Driver { reason }),
            None => Ok(()),
        }
    }

    /// What a failure of the driver means: `otherwise`, unless the device is lost.
    pub fn failed(&self, failure: &vulkan::Failure, otherwise: DeviceError) -> DeviceError {
        match failure {
            vulkan::Failure::Lost => self.lose("the driver says so"),
            vulkan::Failure::Other(_) => otherwise,
        }
    }

    /// Takes the device as lost from now on.
    fn lose(&self, reason: &str) -> DeviceError {
        Trouble::note(&self.trouble.lost, reason.to_owned());
        let reason = reason.to_owned();
        DeviceError::Lost { reason }
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.wgpu
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// One submission, waited for.
    fn submit(&self, batches: &[&Batch], staging: &[Staged]) -> Result<(), DeviceError> {
        let mut buffers = Vec::new();
        let mut taken = true;
        let mut rest = batches;
        while let Some(first) = rest.first() {
            let mut encoder = self.encoder();
            let mut recorded = Vec::new();
            while let Some(Way::Recorded(recording)) = rest.first().map(|batch| &batch.way) {
                recorded.push(&**recording);
                rest = &rest[1..];
            }
            match (&self.vulkan, &first.way) {
                (Some(vulkan), Way::Recorded(_)) => {
                    taken &= vulkan.execute(&mut encoder, &recorded);
                }
                (_, Way::Encoded(groups)) => {
                    portable::encode(&mut encoder, &first.commands, groups)?;
                    rest = &rest[1..];
                }
                (None, Way::Recorded(_)) => unreachable!("recorded on the Vulkan route"),
            }
            buffers.push(encoder.finish());
        }
        match (&self.vulkan, batches.last().map(|batch| &batch.way)) {
            // what wgpu encodes ends without a barrier for the host
            (Some(vulkan), Some(Way::Encoded(_))) => {
                let mut encoder = self.encoder();
                taken &= vulkan.execute(&mut encoder, &[]);
                buffers.push(encoder.finish());
            }
            (None, _) => {
                let mut encoder = self.encoder();
                for staged in staging.iter().filter(|staged| staged.written) {
                    portable::fetch(&mut encoder, &staged.memory);
                }
                buffers.push(encoder.finish());
            }
            _ => {}
        }
        let index = self.queue.submit(buffers);
        let wait = wgpu::PollType::Wait {
            submission_index: Some(index),
            timeout: None,
        };
        let done = self.wgpu.poll(wait);
        // the wait was also for wgpu to tell why it took no commands
        self.alive()?;
        match done {
            Ok(_) if taken => Ok(()),
            Ok(_) => Err(self.lose("its commands are not taken")),
            Err(e) => Err(self.lose(&format!("waiting for a run: {e}"))),
        }
    }
}

/// The staging buffers of several batches, each once.
fn distinct(batches: &[&Batch]) -> Vec<Staged> {
    let mut found: Vec<Staged> = Vec::new();
    for staged in batches.iter().flat_map(|batch| &batch.staging) {
        match found
            .iter_mut()
            .find(|other| Arc::ptr_eq(&other.memory, &staged.memory))
        {
            Some(other) => other.written |= staged.written,
            None => found.push(staged.clone()),
        }
    }
    found
}

//! An open device, and the errors that it reports.

use crate::adapter::{AdapterInfo, Choice, choose, ready};
use crate::error::DeviceError;
use crate::host_pages::HostPages;
use crate::shader::cache::Cache;
use crate::vulkan::{self, Vulkan};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// An open device. Clones share it. It closes when its last clone, buffer, program and batch are dropped.
#[derive(Clone)]
pub struct Device {
    pub(crate) inner: Arc<Inner>,
}

/// The device, shared by everything that it made. Field order matters: `vulkan` is dropped before the wgpu device under it.
pub(crate) struct Inner {
    pub vulkan: Option<Vulkan>,
    pub queue: wgpu::Queue,
    pub wgpu: wgpu::Device,
    pub info: AdapterInfo,
    /// Vulkan route only: other drivers keep a cache of their own.
    pub cache: Option<Cache>,
    /// Threads that compile for this device, abandoned ones included.
    pub compiling: AtomicUsize,
    reports: Arc<Reports>,
    /// Size of the largest buffer [bytes].
    pub buffer_max: u64,
    /// Imported pages of buffers that went after the device was lost. Last: the device is closed before they may be unmapped.
    pub kept_pages: Mutex<Vec<Arc<dyn HostPages>>>,
}

/// Errors that wgpu reports outside of calls; the first of each kind is kept.
#[derive(Default)]
struct Reports {
    lost: Mutex<Option<String>>,
    other: Mutex<Option<String>>,
}

impl Reports {
    fn note(place: &Mutex<Option<String>>, reason: String) {
        let mut place = place.lock().unwrap_or_else(|e| e.into_inner());
        place.get_or_insert(reason);
    }
}

impl Device {
    /// Opens a device. On Vulkan, `cache` is a folder that keeps compiled programs from run to run; other drivers keep their own.
    /// The folder is created if it is missing. If it cannot be written, nothing is kept.
    pub fn open(choice: &Choice, cache: Option<&Path>) -> Result<Device, DeviceError> {
        Device::open_by(choice, cache, true)
    }

    /// As `open`, but everything goes through wgpu, as on systems without Vulkan.
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
            required_features: features(&info),
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

        let reports = Arc::new(Reports::default());
        let lost = reports.clone();
        device.set_device_lost_callback(move |reason, message| {
            Reports::note(
                &lost.lost,
                format!("{reason:?} {message}").trim().to_owned(),
            );
        });
        let other = reports.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            Reports::note(&other.other, e.to_string());
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
                reports,
                kept_pages: Mutex::default(),
            }),
        })
    }

    /// The adapter that was opened.
    pub fn info(&self) -> &AdapterInfo {
        &self.inner.info
    }

    /// Threads that compile, abandoned ones included.
    pub fn compiling(&self) -> usize {
        self.inner.compiling.load(Ordering::Relaxed)
    }

    /// Programs so far whose SPIR-V was found in the cache folder.
    pub fn cached(&self) -> usize {
        let cache = self.inner.cache.as_ref();
        cache.map_or(0, |cache| cache.hits.load(Ordering::Relaxed))
    }

    /// Loses the device, as a driver may. For tests of the error path.
    #[doc(hidden)]
    pub fn lose(&self) {
        self.inner.wgpu.destroy();
    }
}

/// The features of wgpu that programs may need and the adapter has.
fn features(info: &AdapterInfo) -> wgpu::Features {
    let mut features = wgpu::Features::empty();
    let shuffles = wgpu::Features::SUBGROUP | wgpu::Features::SUBGROUP_BARRIER;
    features.set(shuffles, info.shuffles);
    features.set(wgpu::Features::SHADER_F64, info.doubles);
    features
}

impl Inner {
    /// Refuses work after the device was lost or an unexpected error was reported.
    pub fn alive(&self) -> Result<(), DeviceError> {
        let reported = |place: &Mutex<Option<String>>| {
            let place = place.lock().unwrap_or_else(|e| e.into_inner());
            place.clone()
        };
        if let Some(reason) = reported(&self.reports.lost) {
            return Err(DeviceError::Lost { reason });
        }
        match reported(&self.reports.other) {
            Some(reason) => Err(DeviceError::Driver { reason }),
            None => Ok(()),
        }
    }

    /// The error of a driver failure: `otherwise`, unless the device is lost.
    pub fn failed(&self, failure: &vulkan::Failure, otherwise: DeviceError) -> DeviceError {
        match failure {
            vulkan::Failure::Lost => self.lose("the driver reports it"),
            vulkan::Failure::Other(_) => otherwise,
        }
    }

    /// Marks the device as lost.
    pub fn lose(&self, reason: &str) -> DeviceError {
        Reports::note(&self.reports.lost, reason.to_owned());
        let reason = reason.to_owned();
        DeviceError::Lost { reason }
    }

    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.wgpu
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}

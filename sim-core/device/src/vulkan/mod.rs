//! The Vulkan route: memory, pipelines and recorded commands of the driver itself, beside those of wgpu.
//!
//! wgpu opens the device, submits and waits. It tracks nothing that is recorded here.

mod export;
mod memory;
mod pipeline;
mod recording;
mod stamps;

use export::Exports;
pub(crate) use export::RawTimeline;
pub(crate) use memory::{Handle, Made, Mapped};
pub(crate) use pipeline::Pipeline;
pub(crate) use recording::Recording;
use stamps::Clock;

use ash::vk;
use thiserror::Error;
use wgpu::hal::api::Vulkan as Api;

/// Why the driver did not do what it was asked.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    /// The device is gone.
    #[error("the device is lost")]
    Lost,
    /// Anything else, most often that there is no room.
    #[error("{0}")]
    Other(vk::Result),
}

impl From<vk::Result> for Failure {
    fn from(result: vk::Result) -> Failure {
        match result {
            vk::Result::ERROR_DEVICE_LOST => Failure::Lost,
            other => Failure::Other(other),
        }
    }
}

/// Handles of an open device.
pub(crate) struct Vulkan {
    device: ash::Device,
    family: u32,
    heaps: vk::PhysicalDeviceMemoryProperties,
    host: Option<ash::ext::external_memory_host::Device>,
    /// Addresses and sizes of imported memory are multiples of this [bytes].
    host_align: u64,
    /// Whether a pipeline may go without robust buffer access (`VK_EXT_pipeline_robustness`).
    trusts_pipelines: bool,
    /// The driver's pipeline cache, which locks itself.
    cache: vk::PipelineCache,
    exports: Exports,
    clock: Clock,
    driver: String,
}

/// Largest device-local heap [bytes], and whether the driver knows how to import host memory.
pub(crate) fn properties(adapter: &wgpu::Adapter) -> (Option<u64>, bool) {
    // SAFETY: the handles are only queried, while `adapter` is borrowed.
    unsafe {
        let Some(hal) = adapter.as_hal::<Api>() else {
            return (None, false);
        };
        let heaps = hal
            .shared_instance()
            .raw_instance()
            .get_physical_device_memory_properties(hal.raw_physical_device());
        let imports = hal
            .physical_device_capabilities()
            .supports_extension(ash::ext::external_memory_host::NAME);
        let local = heaps
            .memory_heaps_as_slice()
            .iter()
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max();
        (local, imports)
    }
}

/// Opens a device on this route; `None` if the adapter is not Vulkan's.
pub(crate) fn open(
    adapter: &wgpu::Adapter,
    wanted: &wgpu::DeviceDescriptor,
) -> Option<Result<(wgpu::Device, wgpu::Queue, Vulkan), String>> {
    // SAFETY: the callback adds extensions and a feature that the device has, and takes nothing away; the device goes to the adapter that made it.
    unsafe {
        let hal = adapter.as_hal::<Api>()?;
        let imports = hal
            .physical_device_capabilities()
            .supports_extension(ash::ext::external_memory_host::NAME);
        let signals = hal
            .physical_device_capabilities()
            .supports_extension(ash::khr::external_semaphore_fd::NAME);
        let trusts_pipelines = trusts_pipelines(&hal);
        let mut robustness = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default()
            .pipeline_robustness(trusts_pipelines);
        let robustness = &mut robustness;
        let opened = hal.open_with_callback(
            wanted.required_features,
            &wanted.required_limits,
            &wanted.memory_hints,
            Some(Box::new(move |arguments| {
                if signals {
                    arguments
                        .extensions
                        .push(ash::khr::external_semaphore_fd::NAME);
                }
                if imports {
                    arguments
                        .extensions
                        .push(ash::ext::external_memory_host::NAME);
                }
                if trusts_pipelines {
                    arguments
                        .extensions
                        .push(ash::ext::pipeline_robustness::NAME);
                    *arguments.create_info = arguments.create_info.push_next(robustness);
                }
            })),
        );
        let opened = match opened {
            Ok(opened) => opened,
            Err(e) => return Some(Err(e.to_string())),
        };
        drop(hal);
        let (device, queue) = match adapter.create_device_from_hal::<Api>(opened, wanted) {
            Ok(both) => both,
            Err(e) => return Some(Err(e.to_string())),
        };
        let vulkan = handles(&device, imports, trusts_pipelines);
        Some(Ok((device, queue, vulkan)))
    }
}

/// Whether the driver lets a pipeline go without robust buffer access.
fn trusts_pipelines(hal: &<Api as wgpu::hal::Api>::Adapter) -> bool {
    let capabilities = hal.physical_device_capabilities();
    if !capabilities.supports_extension(ash::ext::pipeline_robustness::NAME) {
        return false;
    }
    let mut known = vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default();
    let mut all = vk::PhysicalDeviceFeatures2::default().push_next(&mut known);
    // SAFETY: the handles are only queried, while `hal` is borrowed.
    unsafe {
        let instance = hal.shared_instance().raw_instance();
        instance.get_physical_device_features2(hal.raw_physical_device(), &mut all);
    }
    known.pipeline_robustness == vk::TRUE
}

/// # Safety
/// `device` is Vulkan's, has the extensions if `imports` and if `trusts_pipelines`, and outlives what is returned.
unsafe fn handles(device: &wgpu::Device, imports: bool, trusts_pipelines: bool) -> Vulkan {
    // SAFETY: as promised by the caller.
    unsafe {
        let hal = device.as_hal::<Api>().expect("opened on Vulkan");
        let instance = hal.shared_instance().raw_instance().clone();
        let raw = hal.raw_device().clone();
        let physical = hal.raw_physical_device();
        let mut host = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
        let mut all = vk::PhysicalDeviceProperties2::default();
        if imports {
            all = all.push_next(&mut host);
        }
        instance.get_physical_device_properties2(physical, &mut all);
        let known = all.properties;
        let families = instance.get_physical_device_queue_family_properties(physical);
        Vulkan {
            host: imports.then(|| ash::ext::external_memory_host::Device::new(&instance, &raw)),
            exports: Exports::new(&instance, physical, &raw, hal.enabled_device_extensions()),
            host_align: host.min_imported_host_pointer_alignment.max(1),
            trusts_pipelines,
            heaps: instance.get_physical_device_memory_properties(physical),
            family: hal.queue_family_index(),
            clock: Clock {
                tick_s: f64::from(known.limits.timestamp_period) * 1e-9,
                bits: families[hal.queue_family_index() as usize].timestamp_valid_bits,
            },
            cache: vk::PipelineCache::null(),
            driver: format!(
                "{}-{:08x}",
                known
                    .pipeline_cache_uuid
                    .map(|byte| format!("{byte:02x}"))
                    .concat(),
                known.driver_version
            ),
            device: raw,
        }
    }
}

impl Vulkan {
    /// Device and driver version, in letters that a file's name may have.
    pub fn driver(&self) -> &str {
        &self.driver
    }

    /// Starts from the pipeline cache of an earlier run. A driver ignores the data of another one.
    pub fn remember(&mut self, earlier: &[u8]) {
        let data = vk::PipelineCacheCreateInfo::default().initial_data(earlier);
        // SAFETY: the data are whole, since the cache compared their hash, and this driver's, since the file has its name.
        let made = unsafe { self.device.create_pipeline_cache(&data, None) };
        self.cache = made.unwrap_or_default();
    }

    /// The pipeline cache, for `remember` in the next run.
    pub fn remembered(&self) -> Vec<u8> {
        // SAFETY: the cache is this device's; without one there is nothing to ask.
        unsafe {
            if self.cache == vk::PipelineCache::null() {
                return Vec::new();
            }
            let data = self.device.get_pipeline_cache_data(self.cache);
            data.unwrap_or_default()
        }
    }
}

impl Drop for Vulkan {
    fn drop(&mut self) {
        // SAFETY: the cache is this device's, and no thread compiles: they keep the device alive.
        unsafe { self.device.destroy_pipeline_cache(self.cache, None) };
    }
}

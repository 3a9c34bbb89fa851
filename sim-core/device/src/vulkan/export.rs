//! Memory and semaphores that another process imports, each by a file descriptor of the driver ("opaque").

use super::memory::{describe, wrap};
use super::{Failure, Made, Vulkan};
use crate::allocation::{GRAIN, Residence};
use ash::vk;
use std::ffi::c_int;
use std::os::fd::{FromRawFd, OwnedFd};
use std::time::Duration;

const MEMORY: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
const SEMAPHORE: vk::ExternalSemaphoreHandleTypeFlags =
    vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD;

/// What a device can export; where it cannot, the reason.
pub(super) struct Exports {
    memory: Result<ash::khr::external_memory_fd::Device, String>,
    semaphores: Result<ash::khr::external_semaphore_fd::Device, String>,
    /// The driver gives an exported buffer an allocation of its own.
    dedicated: bool,
    /// Identifies the card across APIs (`VkPhysicalDeviceIDProperties`).
    uuid: [u8; vk::UUID_SIZE],
}

impl Exports {
    /// Asks a driver. `extensions` are those that the device was opened with.
    ///
    /// # Safety
    /// All handles are of one device, and alive.
    pub unsafe fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        extensions: &[&std::ffi::CStr],
    ) -> Exports {
        let has = |name| match extensions.contains(&name) {
            true => Ok(()),
            false => Err(format!("the driver has no {}", name.to_string_lossy())),
        };
        let mut ids = vk::PhysicalDeviceIDProperties::default();
        let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
        let buffers = describe(GRAIN);
        let buffers = vk::PhysicalDeviceExternalBufferInfo::default()
            .usage(buffers.usage)
            .handle_type(MEMORY);
        let mut buffer = vk::ExternalBufferProperties::default();
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(TIMELINE);
        let timelines = vk::PhysicalDeviceExternalSemaphoreInfo::default()
            .handle_type(SEMAPHORE)
            .push_next(&mut kind);
        let mut timeline = vk::ExternalSemaphoreProperties::default();
        // SAFETY: the handles are only queried.
        unsafe {
            instance.get_physical_device_properties2(physical, &mut all);
            instance.get_physical_device_external_buffer_properties(
                physical,
                &buffers,
                &mut buffer,
            );
            instance.get_physical_device_external_semaphore_properties(
                physical,
                &timelines,
                &mut timeline,
            );
        }
        let version = all.properties.api_version;
        let known = buffer.external_memory_properties.external_memory_features;
        let memory = has(ash::khr::external_memory_fd::NAME).and_then(|()| {
            match known.contains(vk::ExternalMemoryFeatureFlags::EXPORTABLE) {
                true => Ok(ash::khr::external_memory_fd::Device::new(instance, device)),
                false => Err("the driver exports no memory of buffers".to_owned()),
            }
        });
        let known_timelines = timeline.external_semaphore_features;
        let exports = known_timelines.contains(vk::ExternalSemaphoreFeatureFlags::EXPORTABLE);
        let semaphores = has(ash::khr::external_semaphore_fd::NAME).and_then(|()| {
            if version < vk::API_VERSION_1_2 {
                return Err("timeline semaphores need Vulkan 1.2".to_owned());
            }
            match exports {
                true => Ok(ash::khr::external_semaphore_fd::Device::new(
                    instance, device,
                )),
                false => Err("the driver exports no timeline semaphores".to_owned()),
            }
        });
        Exports {
            memory,
            semaphores,
            dedicated: known.contains(vk::ExternalMemoryFeatureFlags::DEDICATED_ONLY),
            uuid: ids.device_uuid,
        }
    }
}

const TIMELINE: vk::SemaphoreType = vk::SemaphoreType::TIMELINE;

/// Memory as another process imports it.
pub(crate) struct Exported {
    pub memory: OwnedFd,
    /// Size of the allocation [bytes].
    pub bytes: u64,
    pub dedicated: bool,
}

/// A semaphore that counts up.
pub(crate) struct RawTimeline {
    semaphore: vk::Semaphore,
    device: ash::Device,
}

impl Vulkan {
    /// Identifies the card across APIs.
    pub fn uuid(&self) -> [u8; vk::UUID_SIZE] {
        self.exports.uuid
    }

    /// Device memory that another process can import; its contents are not defined.
    pub fn allocate_exported(
        &self,
        device: &wgpu::Device,
        bytes: u64,
    ) -> Result<(Made, Exported), String> {
        let functions = self.exports.memory.as_ref().map_err(Clone::clone)?;
        let dedicated = self.exports.dedicated;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY);
        let info = describe(bytes).push_next(&mut external);
        // SAFETY: as in `allocate`: memory and buffer are made for one another, and on failure nothing is left behind.
        unsafe {
            let failed = |e: vk::Result| e.to_string();
            let buffer = self.device.create_buffer(&info, None).map_err(failed)?;
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let made = self
                .exportable(buffer, &needs, dedicated)
                .and_then(|memory| self.bind(buffer, memory, bytes, Residence::Device))
                .and_then(|(memory, _)| {
                    let wanted = vk::MemoryGetFdInfoKHR::default()
                        .memory(memory)
                        .handle_type(MEMORY);
                    let exported = functions.get_memory_fd(&wanted);
                    exported.map(|fd| (memory, fd)).inspect_err(|_| {
                        self.device.free_memory(memory, None);
                    })
                });
            let (memory, fd) = made.map_err(|e| {
                self.device.destroy_buffer(buffer, None);
                e.to_string()
            })?;
            let exported = Exported {
                memory: owned(fd),
                bytes: needs.size,
                dedicated,
            };
            Ok((wrap(device, buffer, memory, bytes, None), exported))
        }
    }

    /// Memory for a buffer, to be exported.
    ///
    /// # Safety
    /// `needs` are those of `buffer`, which is alive.
    unsafe fn exportable(
        &self,
        buffer: vk::Buffer,
        needs: &vk::MemoryRequirements,
        dedicated: bool,
    ) -> Result<vk::DeviceMemory, vk::Result> {
        let local = vk::MemoryPropertyFlags::DEVICE_LOCAL;
        let kind = self
            .memory_type(needs.memory_type_bits, local)
            .ok_or(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)?;
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(MEMORY);
        let mut alone = vk::MemoryDedicatedAllocateInfo::default().buffer(buffer);
        let mut request = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(kind)
            .push_next(&mut export);
        if dedicated {
            request = request.push_next(&mut alone);
        }
        // SAFETY: the index is one of the device's types.
        unsafe { self.device.allocate_memory(&request, None) }
    }

    /// A timeline at 0, and what another process imports it by.
    pub fn timeline(&self) -> Result<(RawTimeline, OwnedFd), String> {
        let functions = self.exports.semaphores.as_ref().map_err(Clone::clone)?;
        let failed = |e: vk::Result| e.to_string();
        let mut export = vk::ExportSemaphoreCreateInfo::default().handle_types(SEMAPHORE);
        let made = self.counter(vk::SemaphoreCreateInfo::default().push_next(&mut export));
        let made = made.map_err(failed)?;
        let wanted = vk::SemaphoreGetFdInfoKHR::default()
            .semaphore(made.semaphore)
            .handle_type(SEMAPHORE);
        // SAFETY: the semaphore is alive, and made to be exported.
        unsafe {
            let fd = functions.get_semaphore_fd(&wanted).map_err(failed)?;
            Ok((made, owned(fd)))
        }
    }

    /// A timeline at 0 of this process alone, which needs no extension.
    #[cfg(test)]
    pub fn timeline_here(&self) -> RawTimeline {
        let made = self.counter(vk::SemaphoreCreateInfo::default());
        made.expect("Vulkan 1.2 has timelines")
    }

    fn counter(&self, info: vk::SemaphoreCreateInfo<'_>) -> Result<RawTimeline, vk::Result> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(TIMELINE);
        let info = info.push_next(&mut kind);
        Ok(RawTimeline {
            // SAFETY: the device is alive, and the driver exports such semaphores if `info` asks for it.
            semaphore: unsafe { self.device.create_semaphore(&info, None)? },
            device: self.device.clone(),
        })
    }

    /// Lets the next submission wait until one timeline has a value, and advance another one to a value at its end.
    pub fn order(
        &self,
        queue: &wgpu::Queue,
        after: Option<(&RawTimeline, u64)>,
        done: Option<(&RawTimeline, u64)>,
    ) {
        // SAFETY: the semaphores are of this device, and live until `run` has waited.
        unsafe {
            let Some(queue) = queue.as_hal::<super::Api>() else {
                return;
            };
            if let Some((timeline, value)) = after {
                let stage = vk::PipelineStageFlags::ALL_COMMANDS;
                queue.add_wait_semaphore(timeline.semaphore, Some(value), stage);
            }
            if let Some((timeline, value)) = done {
                queue.add_signal_semaphore(timeline.semaphore, Some(value));
            }
        }
    }
}

impl RawTimeline {
    /// Waits until the timeline has a value; false if it has not in time.
    pub fn wait(&self, value: u64, timeout: Duration) -> Result<bool, Failure> {
        let (semaphores, values) = ([self.semaphore], [value]);
        let wanted = vk::SemaphoreWaitInfo::default()
            .semaphores(&semaphores)
            .values(&values);
        let timeout = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the semaphore is a timeline of this device, which has Vulkan 1.2.
        match unsafe { self.device.wait_semaphores(&wanted, timeout) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }

    /// Sets a value, as the other process does.
    #[cfg(test)]
    pub fn signal(&self, value: u64) {
        let wanted = vk::SemaphoreSignalInfo::default()
            .semaphore(self.semaphore)
            .value(value);
        // SAFETY: the semaphore is a timeline of this device, and the value above its own.
        unsafe { self.device.signal_semaphore(&wanted) }.expect("the device is alive");
    }
}

impl Drop for RawTimeline {
    fn drop(&mut self) {
        // SAFETY: `run` waits for what uses it; the device is alive.
        unsafe { self.device.destroy_semaphore(self.semaphore, None) };
    }
}

/// # Safety
/// The driver gave this descriptor to us alone.
unsafe fn owned(fd: c_int) -> OwnedFd {
    // SAFETY: as promised by the caller.
    unsafe { OwnedFd::from_raw_fd(fd) }
}

//! Device memory of another process, imported by Vulkan as a client with a card imports it by CUDA.
//!
//! It is mapped, which only a driver allows whose device memory is the host's: a software driver.

use ash::vk;
use std::os::fd::{IntoRawFd, OwnedFd};

/// Imported memory, mapped. The instance of Vulkan is its own, so nothing is shared but the memory.
pub struct ImportedMemory {
    _entry: ash::Entry,
    instance: ash::Instance,
    device: ash::Device,
    memory: vk::DeviceMemory,
    at: *mut u8,
    bytes: usize,
}

impl ImportedMemory {
    /// Imports memory of the device that has this UUID.
    pub fn new(memory: OwnedFd, allocated: u64, uuid: [u8; 16]) -> ImportedMemory {
        // SAFETY: the handles are used while they live, and the descriptor goes to the driver once.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let version = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let wanted = vk::InstanceCreateInfo::default().application_info(&version);
            let instance = entry.create_instance(&wanted, None).unwrap();
            let physical = of_uuid(&instance, uuid);
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(0)
                .queue_priorities(&[1.0])];
            let extensions = [ash::khr::external_memory_fd::NAME.as_ptr()];
            let wanted = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions);
            let device = instance.create_device(physical, &wanted, None).unwrap();
            let mut fd = vk::ImportMemoryFdInfoKHR::default()
                .handle_type(vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD)
                .fd(memory.into_raw_fd());
            let wanted = vk::MemoryAllocateInfo::default()
                .allocation_size(allocated)
                .memory_type_index(mappable(&instance, physical))
                .push_next(&mut fd);
            let memory = device.allocate_memory(&wanted, None).unwrap();
            let flags = vk::MemoryMapFlags::empty();
            let at = device.map_memory(memory, 0, vk::WHOLE_SIZE, flags).unwrap();
            ImportedMemory {
                _entry: entry,
                instance,
                device,
                memory,
                at: at.cast(),
                bytes: allocated as usize,
            }
        }
    }

    /// The bytes as they are now; the other process writes them only while it carries out a command.
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: the mapping is as long, and lives as long as `self`.
        unsafe { std::slice::from_raw_parts(self.at, self.bytes) }
    }

    /// The bytes, to be read by the other process when it gets its next command.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.at, self.bytes) }
    }
}

impl Drop for ImportedMemory {
    fn drop(&mut self) {
        // SAFETY: nothing of it is used any more.
        unsafe {
            self.device.free_memory(self.memory, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

unsafe fn of_uuid(instance: &ash::Instance, uuid: [u8; 16]) -> vk::PhysicalDevice {
    // SAFETY: the instance is alive.
    unsafe {
        let all = instance.enumerate_physical_devices().unwrap();
        let has_uuid = |device: &vk::PhysicalDevice| {
            let mut ids = vk::PhysicalDeviceIDProperties::default();
            let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
            instance.get_physical_device_properties2(*device, &mut all);
            ids.device_uuid == uuid
        };
        all.into_iter().find(has_uuid).expect("the daemon's device")
    }
}

unsafe fn mappable(instance: &ash::Instance, physical: vk::PhysicalDevice) -> u32 {
    let wanted = vk::MemoryPropertyFlags::DEVICE_LOCAL | vk::MemoryPropertyFlags::HOST_VISIBLE;
    // SAFETY: the instance is alive.
    let known = unsafe { instance.get_physical_device_memory_properties(physical) };
    let kinds = known.memory_types_as_slice().iter();
    let index = kinds
        .clone()
        .position(|kind| kind.property_flags.contains(wanted));
    index.expect("a software driver, whose device memory can be mapped") as u32
}

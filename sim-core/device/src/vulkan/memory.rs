//! Memory: allocated by the driver, or imported from the host.

use super::{Api, Failure, Vulkan};
use crate::allocation::{GRAIN, Residence, USAGES};
use ash::vk;
use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

/// Vulkan's handle of a buffer.
pub(crate) struct Handle(pub vk::Buffer);

/// Mapped memory of a buffer, for as long as the buffer lives.
pub(crate) struct Mapped {
    at: *mut u8,
    bytes: usize,
}

// SAFETY: the memory belongs to the buffer, not to a thread; `RwLock` keeps its readers and writers apart.
unsafe impl Send for Mapped {}
// SAFETY: as above.
unsafe impl Sync for Mapped {}

impl Mapped {
    pub fn slice(&self) -> &[u8] {
        // SAFETY: `at` is mapped for `bytes` until the buffer goes, and no batch writes it while the lock is held.
        unsafe { std::slice::from_raw_parts(self.at, self.bytes) }
    }

    pub fn slice_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above, and the lock is held for writing.
        unsafe { std::slice::from_raw_parts_mut(self.at, self.bytes) }
    }
}

/// A buffer: wgpu's handle, Vulkan's, and the mapping of host memory.
pub(crate) type Made = (wgpu::Buffer, Handle, Option<Mapped>);

impl Vulkan {
    /// A buffer of a multiple of `GRAIN` bytes; its contents are not defined.
    pub fn allocate(
        &self,
        device: &wgpu::Device,
        bytes: u64,
        residence: Residence,
    ) -> Result<Made, Failure> {
        assert_eq!(bytes % GRAIN, 0, "sizes are rounded up");
        // SAFETY: the memory is of a type that the buffer takes and large enough; on failure nothing is left behind.
        unsafe {
            let buffer = self.device.create_buffer(&describe(bytes), None)?;
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let made = self
                .allocate_one_of(&needs, residence)
                .and_then(|memory| self.bind(buffer, memory, bytes, residence));
            match made {
                Ok((memory, mapped)) => Ok(wrap(device, buffer, memory, bytes, mapped)),
                Err(e) => {
                    self.device.destroy_buffer(buffer, None);
                    Err(e.into())
                }
            }
        }
    }

    /// Memory of the first type, in the order of preference, that has room.
    ///
    /// # Safety
    /// None but that the device is alive.
    unsafe fn allocate_one_of(
        &self,
        needs: &vk::MemoryRequirements,
        residence: Residence,
    ) -> Result<vk::DeviceMemory, vk::Result> {
        use vk::MemoryPropertyFlags as Flags;
        let shared = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        let wanted: &[Flags] = match residence {
            Residence::Device => &[Flags::DEVICE_LOCAL, Flags::empty()],
            Residence::Host => &[shared | Flags::HOST_CACHED, shared],
        };
        let mut failure = vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;
        for flags in wanted {
            let Some(kind) = self.memory_type(needs.memory_type_bits, *flags) else {
                continue;
            };
            let request = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(kind);
            // SAFETY: the index is one of the device's types.
            match unsafe { self.device.allocate_memory(&request, None) } {
                Ok(memory) => return Ok(memory),
                Err(e) => failure = e,
            }
        }
        Err(failure)
    }

    /// # Safety
    /// `memory` is of a type and size for `buffer`, and mappable if `residence` is the host; it is freed on failure.
    pub(super) unsafe fn bind(
        &self,
        buffer: vk::Buffer,
        memory: vk::DeviceMemory,
        bytes: u64,
        residence: Residence,
    ) -> Result<(vk::DeviceMemory, Option<Mapped>), vk::Result> {
        // SAFETY: as promised by the caller.
        unsafe {
            let mapped = self
                .device
                .bind_buffer_memory(buffer, memory, 0)
                .and_then(|()| match residence {
                    Residence::Device => Ok(None),
                    Residence::Host => self
                        .device
                        .map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
                        .map(|at| {
                            Some(Mapped {
                                at: at.cast(),
                                bytes: bytes as usize,
                            })
                        }),
                });
            match mapped {
                Ok(mapped) => Ok((memory, mapped)),
                Err(e) => {
                    self.device.free_memory(memory, None);
                    Err(e)
                }
            }
        }
    }

    /// First type among `bits` that has all `flags`.
    pub(super) fn memory_type(&self, bits: u32, flags: vk::MemoryPropertyFlags) -> Option<u32> {
        (0..self.heaps.memory_type_count).find(|&kind| {
            bits >> kind & 1 == 1
                && self.heaps.memory_types[kind as usize]
                    .property_flags
                    .contains(flags)
        })
    }

    /// Pages of the host as a buffer.
    ///
    /// # Safety
    /// `at` is mapped for `bytes`, readable and writable, until the buffer is dropped.
    pub unsafe fn import(
        &self,
        device: &wgpu::Device,
        at: *mut u8,
        bytes: u64,
    ) -> Result<Made, String> {
        let Some(host) = &self.host else {
            return Err("the driver has no VK_EXT_external_memory_host".to_owned());
        };
        let align = self.host_align;
        if !(at as u64).is_multiple_of(align) || !bytes.is_multiple_of(align) || bytes == 0 {
            return Err(format!(
                "address and size must be multiples of {align} bytes"
            ));
        }
        let kind = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;
        // SAFETY: the pages are there as promised by the caller; memory and buffer are made for one another.
        unsafe {
            let mut known = vk::MemoryHostPointerPropertiesEXT::default();
            (host.fp().get_memory_host_pointer_properties_ext)(
                self.device.handle(),
                kind,
                at.cast(),
                &mut known,
            )
            .result()
            .map_err(|e| e.to_string())?;

            let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(kind);
            let buffer = self
                .device
                .create_buffer(&describe(bytes).push_next(&mut external), None)
                .map_err(|e| e.to_string())?;
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let made = self
                .memory_type(
                    known.memory_type_bits & needs.memory_type_bits,
                    vk::MemoryPropertyFlags::HOST_COHERENT,
                )
                .filter(|_| needs.size <= bytes)
                .ok_or_else(|| "no coherent memory type for these pages".to_owned())
                .and_then(|index| {
                    let mut pages = vk::ImportMemoryHostPointerInfoEXT::default()
                        .handle_type(kind)
                        .host_pointer(at.cast());
                    let request = vk::MemoryAllocateInfo::default()
                        .allocation_size(bytes)
                        .memory_type_index(index)
                        .push_next(&mut pages);
                    let memory = self.device.allocate_memory(&request, None);
                    memory
                        .and_then(|memory| self.bind(buffer, memory, bytes, Residence::Device))
                        .map_err(|e| e.to_string())
                });
            match made {
                Ok((memory, _)) => Ok(wrap(device, buffer, memory, bytes, None)),
                Err(e) => {
                    self.device.destroy_buffer(buffer, None);
                    Err(e)
                }
            }
        }
    }

    /// Whether pages of shared memory can be imported, found by importing some.
    pub fn probe(&self, device: &wgpu::Device) -> bool {
        let bytes = self.host_align.max(65536) as usize;
        let Ok(file) = memfd_create("tightloop-probe", MemfdFlags::CLOEXEC) else {
            return false;
        };
        if self.host.is_none() || ftruncate(&file, bytes as u64).is_err() {
            return false;
        }
        // SAFETY: a new mapping, which is taken away after the buffer over it.
        unsafe {
            let access = ProtFlags::READ | ProtFlags::WRITE;
            let at = std::ptr::null_mut();
            let Ok(at) = mmap(at, bytes, access, MapFlags::SHARED, &file, 0) else {
                return false;
            };
            let works = self.import(device, at.cast(), bytes as u64).is_ok();
            let _ = munmap(at, bytes);
            works
        }
    }
}

pub(super) fn describe(bytes: u64) -> vk::BufferCreateInfo<'static> {
    vk::BufferCreateInfo::default().size(bytes).usage(
        vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST,
    )
}

/// Gives a buffer and its memory to wgpu, which frees both when the last handle goes.
///
/// # Safety
/// Both are of `device`, bound to one another, and owned by nobody else.
pub(super) unsafe fn wrap(
    device: &wgpu::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: u64,
    mapped: Option<Mapped>,
) -> Made {
    let usages = wgpu::BufferDescriptor {
        label: None,
        size: bytes,
        usage: USAGES,
        mapped_at_creation: false,
    };
    // SAFETY: as promised by the caller; wgpu takes such a buffer as initialised, so it never zeroes what raw commands wrote.
    let wgpu = unsafe {
        let hal = wgpu::hal::vulkan::Buffer::from_raw_managed(buffer, memory, 0, bytes);
        device.create_buffer_from_hal::<Api>(hal, &usages)
    };
    (wgpu, Handle(buffer), mapped)
}

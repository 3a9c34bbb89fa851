//! The adapters of this computer, and the choice of one.

use crate::error::DeviceError;
use std::cell::Cell;
use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// Kind of an adapter, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with memory of its own.
    Discrete,
    /// Shares memory with the processor.
    Integrated,
    /// A part of a GPU.
    Virtual,
    /// Unknown.
    Other,
    /// A software driver: kernels run on the CPU.
    Software,
}

/// One adapter and its limits.
#[derive(Clone, Debug)]
pub struct AdapterInfo {
    /// Place in the list of `adapters`.
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// Kind of hardware.
    pub kind: AdapterKind,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// Largest heap of device-local memory, where the driver reports it [bytes].
    pub memory: Option<u64>,
    /// Size of the largest range that can be bound [bytes].
    pub binding_max: u64,
    /// Starts of the ranges of bindings are multiples of this [bytes].
    pub binding_align: u64,
    /// Most storage buffers of one program.
    pub bindings_max: u32,
    /// Most threads of a workgroup.
    pub workgroup_max: u32,
    /// Most workgroups of a dispatch.
    pub workgroups_max: u32,
    /// Fewest threads of a subgroup.
    pub subgroup_min: u32,
    /// Most threads of a subgroup.
    pub subgroup_max: u32,
    /// Whether threads of a subgroup can read each other's values (`subgroupShuffle` and its relatives).
    pub shuffles: bool,
    /// Whether programs may have floats of 64 bits.
    pub doubles: bool,
    /// Whether host memory can be imported. In the list: the driver has the extension. Of an open device: a test import succeeded.
    pub imports: bool,
}

thread_local! {
    static OPENS_AS_DISCRETE: Cell<bool> = const { Cell::new(false) };
}

/// Opens the adapters of this thread as cards with memory of their own. For tests of that path on a software driver.
#[doc(hidden)]
pub fn open_as_discrete(yes: bool) {
    OPENS_AS_DISCRETE.set(yes);
}

/// Which adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The first of `adapters`: hardware if there is any.
    First,
    /// By place in the list.
    Index(usize),
    /// By part of its name, in upper or lower case.
    Name(String),
}

/// All adapters: hardware first (discrete, integrated, virtual), software last. Empty where no driver is installed.
pub fn adapters() -> Vec<AdapterInfo> {
    list().into_iter().map(|(_, info)| info).collect()
}

/// The adapters with their handles, in the order of `adapters`.
pub(crate) fn list() -> Vec<(wgpu::Adapter, AdapterInfo)> {
    let mut options = wgpu::InstanceDescriptor::new_without_display_handle();
    options.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    options.flags = wgpu::InstanceFlags::empty();
    let backends = options.backends;
    let instance = wgpu::Instance::new(options);
    let mut adapters: Vec<_> = ready(instance.enumerate_adapters(backends))
        .into_iter()
        .map(|adapter| {
            let info = describe(&adapter);
            (adapter, info)
        })
        .collect();
    adapters.sort_by_key(|(_, info)| info.kind);
    for (index, (_, info)) in adapters.iter_mut().enumerate() {
        info.index = index;
    }
    adapters
}

/// The chosen adapter.
pub(crate) fn choose(choice: &Choice) -> Result<(wgpu::Adapter, AdapterInfo), DeviceError> {
    let mut adapters = list();
    let place = match choice {
        Choice::First => (!adapters.is_empty()).then_some(0),
        Choice::Index(index) => (*index < adapters.len()).then_some(*index),
        Choice::Name(name) => {
            let name = name.to_lowercase();
            adapters
                .iter()
                .position(|(_, info)| info.name.to_lowercase().contains(&name))
        }
    };
    if adapters.is_empty() {
        return Err(DeviceError::NoAdapter);
    }
    let Some(place) = place else {
        let present: Vec<String> = adapters
            .iter()
            .map(|(_, info)| format!("{} `{}`", info.index, info.name))
            .collect();
        return Err(DeviceError::UnknownAdapter {
            wanted: match choice {
                Choice::Name(name) => format!("named `{name}`"),
                Choice::Index(index) => format!("of index {index}"),
                Choice::First => "at all".to_owned(),
            },
            present: present.join(", "),
        });
    };
    let (adapter, mut info) = adapters.swap_remove(place);
    if OPENS_AS_DISCRETE.get() {
        info.kind = AdapterKind::Discrete;
    }
    Ok((adapter, info))
}

fn describe(adapter: &wgpu::Adapter) -> AdapterInfo {
    let info = adapter.get_info();
    let limits = adapter.limits();
    let (memory, imports) = crate::vulkan::properties(adapter);
    AdapterInfo {
        index: 0,
        name: info.name,
        kind: match info.device_type {
            wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
            wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
            wgpu::DeviceType::Cpu => AdapterKind::Software,
            wgpu::DeviceType::Other => AdapterKind::Other,
        },
        backend: info.backend.to_str().to_owned(),
        driver: format!("{} {}", info.driver, info.driver_info)
            .trim()
            .to_owned(),
        memory,
        binding_max: limits.max_storage_buffer_binding_size,
        binding_align: u64::from(limits.min_storage_buffer_offset_alignment),
        bindings_max: limits.max_storage_buffers_per_shader_stage,
        workgroup_max: limits
            .max_compute_invocations_per_workgroup
            .min(limits.max_compute_workgroup_size_x),
        workgroups_max: limits.max_compute_workgroups_per_dimension,
        subgroup_min: info.subgroup_min_size,
        subgroup_max: info.subgroup_max_size,
        // on Vulkan it asks for SHUFFLE and SHUFFLE_RELATIVE in compute (VkPhysicalDeviceSubgroupProperties)
        shuffles: adapter
            .features()
            .contains(wgpu::Features::SUBGROUP | wgpu::Features::SUBGROUP_BARRIER),
        doubles: adapter.features().contains(wgpu::Features::SHADER_F64),
        imports,
    }
}

/// Blocks on a future of wgpu. Outside of browsers they are ready at once.
pub(crate) fn ready<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        std::thread::yield_now();
    }
}

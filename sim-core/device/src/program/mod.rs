//! Compiled programs: what the driver makes of kernel source.

pub(crate) mod portable;
pub(crate) mod workers;

use crate::device::Inner;
use crate::error::DeviceError;
use crate::program::workers::within;
use crate::shader::module::{self, Binding, Module};
use crate::shader::source::Source;
use crate::vulkan;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// A compiled program. Clones name the same one.
#[derive(Clone)]
pub struct Program(pub(crate) Arc<Compiled>);

/// Parts of a program. Field order matters: pipelines are dropped before the device.
pub(crate) struct Compiled {
    pub source: Source,
    pub bindings: Vec<Binding>,
    pub numbers: Vec<u32>,
    /// Vulkan route: the pipeline of recorded batches.
    raw: Option<vulkan::Pipeline>,
    /// The pipeline of encoded batches. On the Vulkan route it is compiled on first use.
    wgpu: OnceLock<Result<wgpu::ComputePipeline, DeviceError>>,
    limit: Duration,
    pub device: Arc<Inner>,
}

impl Program {
    /// Binding numbers of the storage buffers that it uses, ascending.
    pub fn bindings(&self) -> &[u32] {
        &self.0.numbers
    }

    /// Name, for errors.
    pub fn label(&self) -> &str {
        &self.0.source.label
    }
}

impl Compiled {
    /// The pipeline of recorded batches.
    pub fn pipeline(&self) -> &vulkan::Pipeline {
        self.raw.as_ref().expect("recorded on the Vulkan route")
    }

    /// The pipeline of encoded batches.
    pub fn encoded(self: &Arc<Self>) -> Result<&wgpu::ComputePipeline, DeviceError> {
        self.wgpu
            .get_or_init(|| {
                let program = self.clone();
                let label = self.source.label.clone();
                let work = move |_| portable::pipeline(&program.device.wgpu, &program.source);
                let mut done = within(&self.device, vec![label], 1, self.limit, work)?;
                Ok(done.remove(0))
            })
            .as_ref()
            .map_err(Clone::clone)
    }
}

/// Compiles a program, as far as the driver does before the program runs.
pub(crate) fn build(
    device: &Arc<Inner>,
    source: &Source,
    module: Module,
    limit: Duration,
) -> Result<Program, String> {
    let info = &device.info;
    if module.bindings.is_empty() {
        return Err("it uses no storage buffer".to_owned());
    }
    if module.bindings.len() > info.bindings_max as usize {
        let (used, max) = (module.bindings.len(), info.bindings_max);
        return Err(format!(
            "it uses {used} storage buffers, the adapter has {max}"
        ));
    }
    if module.workgroup > info.workgroup_max {
        let (wanted, max) = (module.workgroup, info.workgroup_max);
        return Err(format!(
            "its workgroup is {wanted} threads, the adapter has {max}"
        ));
    }
    let wgpu = OnceLock::new();
    let raw = match &device.vulkan {
        Some(vulkan) => Some(vulkan.pipeline(&module, &source.entry).map_err(|e| {
            let reason = format!("the driver says: {e}");
            let label = source.label.clone();
            device.failed(
                &e,
                DeviceError::Compile {
                    label,
                    reason: reason.clone(),
                },
            );
            reason
        })?),
        None => {
            let _ = wgpu.set(Ok(portable::pipeline(&device.wgpu, source)?));
            None
        }
    };
    Ok(Program(Arc::new(Compiled {
        numbers: module.bindings.iter().map(|b| b.number).collect(),
        bindings: module.bindings,
        source: source.clone(),
        raw,
        wgpu,
        limit,
        device: device.clone(),
    })))
}

/// The SPIR-V of a program: from the cache if it holds it, otherwise translated.
pub(crate) fn read(device: &Inner, source: &Source) -> Result<Module, String> {
    let (shuffles, doubles) = (device.info.shuffles, device.info.doubles);
    let capabilities = module::capabilities(shuffles, doubles);
    // another device may have kept what this one must refuse
    let is_kept = (shuffles || !source.names_subgroups()) && (doubles || !source.names_doubles());
    let Some(cache) = device.cache.as_ref().filter(|_| is_kept) else {
        return module::read(source, device.vulkan.is_some(), capabilities);
    };
    if let Some(module) = cache.module(source) {
        return Ok(module);
    }
    let module = module::read(source, true, capabilities)?;
    cache.keep_module(source, &module);
    Ok(module)
}

//! Pipelines that wgpu compiles: for encoded batches, and for all batches where there is no Vulkan route.

use crate::adapter::ready;
use crate::shader::source::Source;

/// Compiles a program for encoded batches.
pub(crate) fn pipeline(
    device: &wgpu::Device,
    source: &Source,
) -> Result<wgpu::ComputePipeline, String> {
    let scopes = [
        wgpu::ErrorFilter::Internal,
        wgpu::ErrorFilter::OutOfMemory,
        wgpu::ErrorFilter::Validation,
    ]
    .map(|filter| device.push_error_scope(filter));
    let description = wgpu::ShaderModuleDescriptor {
        label: Some(&source.label),
        source: wgpu::ShaderSource::Wgsl(source.plain()),
    };
    // SAFETY: as for recorded batches: the caller guarantees its indices and that its loops end.
    let module = unsafe {
        device.create_shader_module_trusted(description, wgpu::ShaderRuntimeChecks::unchecked())
    };
    let constants: Vec<(&str, f64)> = source
        .constants
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect();
    let made = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(&source.label),
        layout: None,
        module: &module,
        entry_point: Some(&source.entry),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &constants,
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    });
    // scopes are a stack: the last one pushed is popped first
    let mut failure = None;
    for scope in scopes.into_iter().rev() {
        failure = ready(scope.pop()).or(failure);
    }
    match failure {
        Some(e) => Err(e.to_string()),
        None => Ok(made),
    }
}

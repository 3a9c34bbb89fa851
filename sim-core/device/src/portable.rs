//! What goes through wgpu alone: pipelines and encoded batches of every route, staging where host memory cannot be mapped for ever.

use crate::adapter::ready;
use crate::batch::{Command, Groups};
use crate::error::DeviceError;
use crate::memory::{HostBytes, Memory};
use crate::program::Source;
use std::sync::Arc;

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
    let text = wgpu::ShaderModuleDescriptor {
        label: Some(&source.label),
        source: wgpu::ShaderSource::Wgsl(source.wgsl.as_str().into()),
    };
    // SAFETY: as for recorded batches: indices are the caller's, and its loops end.
    let module = unsafe {
        device.create_shader_module_trusted(text, wgpu::ShaderRuntimeChecks::unchecked())
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

/// A bind group for each dispatch, in their order.
pub(crate) fn groups(commands: &[Command]) -> Result<Vec<wgpu::BindGroup>, DeviceError> {
    let mut groups = Vec::new();
    for command in commands {
        let Command::Dispatch { program, slots, .. } = command else {
            continue;
        };
        let entries: Vec<_> = slots
            .iter()
            .map(|slot| wgpu::BindGroupEntry {
                binding: slot.binding,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &slot.buffer.wgpu,
                    offset: slot.range.start,
                    size: wgpu::BufferSize::new(slot.range.end - slot.range.start),
                }),
            })
            .collect();
        groups.push(
            program
                .device
                .wgpu
                .create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(&program.source.label),
                    layout: &program.encoded()?.get_bind_group_layout(0),
                    entries: &entries,
                }),
        );
    }
    Ok(groups)
}

/// Encodes a batch; wgpu puts barriers where a command uses what one before it wrote.
pub(crate) fn encode(
    encoder: &mut wgpu::CommandEncoder,
    commands: &[Command],
    groups: &[wgpu::BindGroup],
) -> Result<(), DeviceError> {
    let mut groups = groups.iter();
    let mut rest = commands;
    while let Some(first) = rest.first() {
        if let Command::Copy {
            from,
            from_at,
            to,
            to_at,
            bytes,
        } = first
        {
            encoder.copy_buffer_to_buffer(&from.wgpu, *from_at, &to.wgpu, *to_at, *bytes);
            rest = &rest[1..];
            continue;
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        while let Some(Command::Dispatch {
            program,
            groups: workgroups,
            ..
        }) = rest.first()
        {
            pass.set_pipeline(program.encoded()?);
            pass.set_bind_group(0, groups.next().expect("a group a dispatch"), &[]);
            match workgroups {
                Groups::Given(groups) => pass.dispatch_workgroups(*groups, 1, 1),
                Groups::Found { buffer, at } => {
                    pass.dispatch_workgroups_indirect(&buffer.wgpu, *at);
                }
            }
            rest = &rest[1..];
        }
    }
    Ok(())
}

/// Sends the host's side of a staging buffer ahead of the next submission.
pub(crate) fn upload(queue: &wgpu::Queue, memory: &Memory, bytes: &HostBytes) {
    if let HostBytes::Copied(words) = bytes {
        queue.write_buffer(&memory.wgpu, 0, bytemuck::cast_slice(words));
    }
}

/// Asks for the device's side of a staging buffer, at the end of a submission.
pub(crate) fn fetch(encoder: &mut wgpu::CommandEncoder, memory: &Memory) {
    if let Some(mirror) = mirror(memory) {
        encoder.copy_buffer_to_buffer(&memory.wgpu, 0, mirror, 0, mirror.size());
    }
}

/// Takes in what `fetch` asked for, once the submission is done.
pub(crate) fn receive(
    device: &wgpu::Device,
    memory: &Arc<Memory>,
    bytes: &mut HostBytes,
) -> Result<(), DeviceError> {
    let Some(mirror) = mirror(memory) else {
        return Ok(());
    };
    let failed = |e: String| DeviceError::Driver {
        reason: format!("mapping `{}`: {e}", memory.label),
    };
    mirror.slice(..).map_async(wgpu::MapMode::Read, |_| ());
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|e| failed(e.to_string()))?;
    let view = mirror
        .slice(..)
        .get_mapped_range()
        .map_err(|e| failed(e.to_string()))?;
    bytes.slice_mut().copy_from_slice(&view);
    drop(view);
    mirror.unmap();
    Ok(())
}

fn mirror(memory: &Memory) -> Option<&wgpu::Buffer> {
    memory.host.as_ref()?.mirror.as_ref()
}

//! Batches that wgpu encodes at every run.

use crate::batch::op::{BatchOp, Groups};
use crate::error::DeviceError;

/// One bind group per dispatch, in order.
pub(crate) fn bind_groups(ops: &[BatchOp]) -> Result<Vec<wgpu::BindGroup>, DeviceError> {
    let mut groups = Vec::new();
    for op in ops {
        let BatchOp::Dispatch { program, slots, .. } = op else {
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

/// Encodes a batch. wgpu inserts a barrier where a command uses what an earlier one wrote.
pub(crate) fn encode(
    encoder: &mut wgpu::CommandEncoder,
    ops: &[BatchOp],
    groups: &[wgpu::BindGroup],
) -> Result<(), DeviceError> {
    let mut groups = groups.iter();
    let mut rest = ops;
    while let Some(first) = rest.first() {
        if let BatchOp::Copy {
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
        while let Some(BatchOp::Dispatch {
            program,
            groups: workgroups,
            ..
        }) = rest.first()
        {
            pass.set_pipeline(program.encoded()?);
            pass.set_bind_group(0, groups.next().expect("one group per dispatch"), &[]);
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

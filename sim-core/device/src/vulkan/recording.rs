//! Commands recorded once, as a secondary command buffer that runs any number of times.
//!
//! wgpu tracks nothing of a recording, so a barrier stands before each command, and one for the host at the end of a run. It waits for all
//! that a command may do; between two programs only for programs.

use super::stamps::Stamps;
use super::{Api, Failure, Handle, Pipeline, Vulkan};
use crate::raw_op::{RawGroups, RawOp};
use ash::vk;

/// A recorded batch.
pub(crate) struct Recording {
    commands: vk::CommandBuffer,
    pool: vk::CommandPool,
    descriptors: vk::DescriptorPool,
    stamps: Option<Stamps>,
    device: ash::Device,
}

impl Vulkan {
    /// Records commands that were checked, with a time stamp after each if `is_timed`. Their buffers and pipelines outlive the recording.
    pub fn record(
        &self,
        ops: &[RawOp<'_, Pipeline, Handle>],
        is_timed: bool,
    ) -> Result<Box<Recording>, Failure> {
        let device = &self.device;
        let mut made = Box::new(Recording {
            commands: vk::CommandBuffer::null(),
            pool: vk::CommandPool::null(),
            descriptors: vk::DescriptorPool::null(),
            stamps: match is_timed {
                true => Stamps::new(device, self.clock, ops.len())?,
                false => None,
            },
            device: device.clone(),
        });
        // SAFETY: all handles are of this device and alive; pools are this recording's own, and go with it.
        unsafe {
            made.pool = device.create_command_pool(
                &vk::CommandPoolCreateInfo::default().queue_family_index(self.family),
                None,
            )?;
            let sets = self.sets(&mut made, ops)?;
            made.commands = device.allocate_command_buffers(
                &vk::CommandBufferAllocateInfo::default()
                    .command_pool(made.pool)
                    .level(vk::CommandBufferLevel::SECONDARY)
                    .command_buffer_count(1),
            )?[0];
            let inherited = vk::CommandBufferInheritanceInfo::default();
            device.begin_command_buffer(
                made.commands,
                &vk::CommandBufferBeginInfo::default()
                    .flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE)
                    .inheritance_info(&inherited),
            )?;
            if let Some(stamps) = &made.stamps {
                // a stamp after the wait for earlier batches, not before it
                barrier(device, made.commands, Before::Any, Next::Work);
                stamps.begin(made.commands);
            }
            let mut sets = sets.into_iter();
            let mut before = Before::Any;
            for (number, op) in ops.iter().enumerate() {
                // also before the first: it waits for earlier batches and for wgpu's own commands
                barrier(device, made.commands, before, Next::from_op(op));
                before = Before::from_op(op);
                match op {
                    RawOp::Dispatch {
                        pipeline, groups, ..
                    } => {
                        let compute = vk::PipelineBindPoint::COMPUTE;
                        let set = [sets.next().expect("one set per dispatch")];
                        device.cmd_bind_pipeline(made.commands, compute, pipeline.pipeline);
                        device.cmd_bind_descriptor_sets(
                            made.commands,
                            compute,
                            pipeline.layout,
                            0,
                            &set,
                            &[],
                        );
                        match groups {
                            RawGroups::Given(groups) => {
                                device.cmd_dispatch(made.commands, *groups, 1, 1);
                            }
                            RawGroups::Found(buffer, at) => {
                                device.cmd_dispatch_indirect(made.commands, buffer.0, *at);
                            }
                        }
                    }
                    RawOp::Copy {
                        from,
                        from_at,
                        to,
                        to_at,
                        bytes,
                    } => {
                        let region = [vk::BufferCopy {
                            src_offset: *from_at,
                            dst_offset: *to_at,
                            size: *bytes,
                        }];
                        device.cmd_copy_buffer(made.commands, from.0, to.0, &region);
                    }
                }
                if let Some(stamps) = &made.stamps {
                    stamps.note(made.commands, number);
                }
            }
            device.end_command_buffer(made.commands)?;
        }
        Ok(made)
    }

    /// Descriptor sets, one per dispatch.
    ///
    /// # Safety
    /// The handles in `ops` are alive.
    unsafe fn sets(
        &self,
        made: &mut Recording,
        ops: &[RawOp<'_, Pipeline, Handle>],
    ) -> Result<Vec<vk::DescriptorSet>, vk::Result> {
        let dispatches: Vec<_> = ops
            .iter()
            .filter_map(|op| match op {
                RawOp::Dispatch {
                    pipeline, slots, ..
                } => Some((pipeline, slots)),
                RawOp::Copy { .. } => None,
            })
            .collect();
        if dispatches.is_empty() {
            return Ok(Vec::new());
        }
        let buffers: usize = dispatches.iter().map(|(_, slots)| slots.len()).sum();
        let sizes = [vk::DescriptorPoolSize {
            ty: vk::DescriptorType::STORAGE_BUFFER,
            descriptor_count: buffers as u32,
        }];
        let layouts: Vec<_> = dispatches.iter().map(|(p, _)| p.set).collect();
        // SAFETY: the pool has room for exactly these sets; each binding of a layout is written once.
        unsafe {
            made.descriptors = self.device.create_descriptor_pool(
                &vk::DescriptorPoolCreateInfo::default()
                    .max_sets(dispatches.len() as u32)
                    .pool_sizes(&sizes),
                None,
            )?;
            let sets = self.device.allocate_descriptor_sets(
                &vk::DescriptorSetAllocateInfo::default()
                    .descriptor_pool(made.descriptors)
                    .set_layouts(&layouts),
            )?;
            for (set, (_, slots)) in sets.iter().zip(dispatches) {
                for (binding, buffer, range) in slots {
                    let range = [vk::DescriptorBufferInfo {
                        buffer: buffer.0,
                        offset: range.start,
                        range: range.end - range.start,
                    }];
                    let write = vk::WriteDescriptorSet::default()
                        .dst_set(*set)
                        .dst_binding(*binding)
                        .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                        .buffer_info(&range);
                    self.device.update_descriptor_sets(&[write], &[]);
                }
            }
            Ok(sets)
        }
    }

    /// What the commands took in the last run [s]; empty where they are not timed or have not run.
    pub fn seconds(&self, recording: &Recording) -> Vec<f64> {
        let stamps = recording.stamps.as_ref();
        stamps.map_or_else(Vec::new, Stamps::seconds)
    }

    /// A run of a recording is done.
    #[expect(clippy::unused_self, reason = "as `seconds`, which asks for one")]
    pub fn done(&self, recording: &Recording) {
        if let Some(stamps) = &recording.stamps {
            stamps.written();
        }
    }

    /// Puts recordings into an encoder of wgpu, which holds nothing else; what they write is seen by all that follows, the host too.
    ///
    /// `false` where wgpu has no encoder to put them into: the device is lost.
    pub fn execute(&self, encoder: &mut wgpu::CommandEncoder, recordings: &[&Recording]) -> bool {
        let commands: Vec<_> = recordings.iter().map(|r| r.commands).collect();
        // SAFETY: the recordings are of this device and live until `run` has waited; wgpu records nothing beside them.
        unsafe {
            encoder.as_hal_mut::<Api, _, _>(|encoder| {
                let Some(encoder) = encoder else {
                    return false;
                };
                let primary = encoder.raw_handle();
                if !commands.is_empty() {
                    self.device.cmd_execute_commands(primary, &commands);
                }
                barrier(&self.device, primary, Before::Any, Next::Host);
                true
            })
        }
    }
}

/// What comes before a barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Before {
    /// Any work.
    Any,
    /// A program, which has waited for all before it.
    Program,
}

impl Before {
    fn from_op<P, B>(op: &RawOp<'_, P, B>) -> Before {
        match op {
            RawOp::Dispatch { .. } => Before::Program,
            RawOp::Copy { .. } => Before::Any,
        }
    }
}

/// What comes after a barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// A program.
    Program,
    /// A program or a copy.
    Work,
    /// A program whose number of workgroups another program may have written.
    Found,
    /// The end of a run: any work, and the host.
    Host,
}

impl Next {
    fn from_op<P, B>(op: &RawOp<'_, P, B>) -> Next {
        match op {
            RawOp::Dispatch {
                groups: RawGroups::Found(..),
                ..
            } => Next::Found,
            RawOp::Dispatch { .. } => Next::Program,
            RawOp::Copy { .. } => Next::Work,
        }
    }
}

/// What was written before is seen after: by programs and copies, and by what comes next.
///
/// # Safety
/// `commands` is being recorded.
unsafe fn barrier(device: &ash::Device, commands: vk::CommandBuffer, before: Before, next: Next) {
    use vk::AccessFlags as Access;
    use vk::PipelineStageFlags as Stage;
    let work = Stage::COMPUTE_SHADER | Stage::TRANSFER;
    let written = Access::SHADER_WRITE | Access::TRANSFER_WRITE;
    let used = written | Access::SHADER_READ | Access::TRANSFER_READ;
    let programs = (
        Stage::COMPUTE_SHADER,
        Access::SHADER_READ | Access::SHADER_WRITE,
    );
    let (from, written) = match (before, next) {
        (Before::Program, Next::Program) => (Stage::COMPUTE_SHADER, Access::SHADER_WRITE),
        _ => (work, written),
    };
    let (to, reads) = match next {
        Next::Program if before == Before::Program => programs,
        Next::Program | Next::Work => (work, used),
        Next::Found => (
            work | Stage::DRAW_INDIRECT,
            used | Access::INDIRECT_COMMAND_READ,
        ),
        Next::Host => (work | Stage::HOST, used | Access::HOST_READ),
    };
    let memory = [vk::MemoryBarrier::default()
        .src_access_mask(written)
        .dst_access_mask(reads)];
    let flags = vk::DependencyFlags::empty();
    // SAFETY: as promised by the caller.
    unsafe { device.cmd_pipeline_barrier(commands, from, to, flags, &memory, &[], &[]) };
}

impl Drop for Recording {
    fn drop(&mut self) {
        // SAFETY: `run` waited for its end; null handles are passed over.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_descriptor_pool(self.descriptors, None);
        }
    }
}

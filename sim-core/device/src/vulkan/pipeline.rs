//! Pipelines of the driver, from SPIR-V.
//!
//! # Robust buffer access
//! wgpu opens devices with robust buffer access, which makes a driver compare every index with the size of its buffer. Our own pipelines
//! go without it where the driver has `VK_EXT_pipeline_robustness`, since their indices are in range:
//!
//! - A batch is checked when it is built: every range that a program sees lies in its buffer (`batch`).
//! - The owner of a program sizes the buffers by the numbers that the program is made of. sim-engine says which in `backend/gpu/tile.rs`.
//! - A number that becomes an index is 0 where it is not a number (`spirv`).

use super::{Failure, Vulkan};
use crate::shader::module::Module;
use ash::vk;
use std::ffi::CString;

/// A compiled program and the layout of its buffers.
pub(crate) struct Pipeline {
    pub pipeline: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set: vk::DescriptorSetLayout,
    device: ash::Device,
}

impl Vulkan {
    /// Compiles; takes as long as the driver takes.
    pub fn pipeline(&self, module: &Module, entry: &str) -> Result<Pipeline, Failure> {
        let slots: Vec<_> = module
            .bindings
            .iter()
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.number)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let entry = CString::new(entry).expect("the name of a WGSL function");
        let mut made = Pipeline {
            pipeline: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set: vk::DescriptorSetLayout::null(),
            device: self.device.clone(),
        };
        // SAFETY: the words are naga's, written from a module it found valid; the layout names the module's bindings.
        // What was made before a failure goes with `made`.
        unsafe {
            let description = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
            made.set = self
                .device
                .create_descriptor_set_layout(&description, None)?;
            let sets = [made.set];
            let description = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            made.layout = self.device.create_pipeline_layout(&description, None)?;
            let code = vk::ShaderModuleCreateInfo::default().code(&module.spirv);
            let shader = self.device.create_shader_module(&code, None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(shader)
                .name(&entry);
            let mut unchecked = vk::PipelineRobustnessCreateInfoEXT::default()
                .storage_buffers(vk::PipelineRobustnessBufferBehaviorEXT::DISABLED)
                .uniform_buffers(vk::PipelineRobustnessBufferBehaviorEXT::DISABLED);
            let mut description = vk::ComputePipelineCreateInfo::default()
                .layout(made.layout)
                .stage(stage);
            if self.trusts_pipelines {
                description = description.push_next(&mut unchecked);
            }
            let result = self
                .device
                .create_compute_pipelines(self.cache, &[description], None);
            self.device.destroy_shader_module(shader, None);
            made.pipeline = result.map_err(|(_, e)| e)?[0];
        }
        Ok(made)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: batches keep their programs, and runs wait for their end, so nothing uses it; null handles are passed over.
        unsafe {
            self.device.destroy_pipeline(self.pipeline, None);
            self.device.destroy_pipeline_layout(self.layout, None);
            self.device.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

//! Translates WGSL to SPIR-V: reads and validates it, resolves overrides, and writes it.

use crate::shader::source::Source;
use crate::shader::spirv;
use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// A storage buffer that a program uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Binding {
    /// Number in group 0.
    pub number: u32,
    /// Declared without `read_write`.
    pub read_only: bool,
}

/// A program before the driver compiles it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Module {
    /// Storage buffers that the entry point uses, in ascending order.
    pub bindings: Vec<Binding>,
    /// Threads of a workgroup.
    pub workgroup: u32,
    /// SPIR-V; empty if it was not requested.
    pub spirv: Vec<u32>,
}

/// What a program may have where the device has subgroup operations, and floats of 64 bits.
pub(crate) fn capabilities(shuffles: bool, doubles: bool) -> Capabilities {
    let mut capabilities = Capabilities::empty();
    let subgroups = Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER;
    capabilities.set(subgroups, shuffles);
    capabilities.set(Capabilities::FLOAT64, doubles);
    capabilities
}

/// Reads a program, with its overrides resolved.
///
/// `spirv` requests SPIR-V for Vulkan; the other drivers get the WGSL through wgpu.
pub(crate) fn read(
    source: &Source,
    spirv: bool,
    capabilities: Capabilities,
) -> Result<Module, String> {
    let wgsl = source.plain();
    let module = naga::front::wgsl::parse_str(&wgsl).map_err(|e| e.emit_to_string(&wgsl))?;
    // what threads do together, the branches around it must let them do: naga cannot know which threads share a world
    let flags = ValidationFlags::all() - ValidationFlags::CONTROL_FLOW_UNIFORMITY;
    let info = Validator::new(flags, capabilities)
        .validate(&module)
        .map_err(|e| e.emit_to_string(&wgsl))?;
    let stage = naga::ShaderStage::Compute;
    let known = |entry: &naga::EntryPoint| entry.name == source.entry && entry.stage == stage;
    if !module.entry_points.iter().any(known) {
        return Err(format!("it has no @compute function `{}`", source.entry));
    }
    let mut constants = naga::back::PipelineConstants::default();
    constants.extend(source.constants.iter().cloned());
    let (module, info) = naga::back::pipeline_constants::process_overrides(
        &module,
        &info,
        Some((stage, &source.entry)),
        &constants,
    )
    .map_err(|e| chain(&e))?;
    let place = module
        .entry_points
        .iter()
        .position(known)
        .expect("overrides keep the entry point");

    let uses = info.get_entry_point(place);
    let mut bindings = Vec::new();
    for (handle, global) in module.global_variables.iter() {
        if uses[handle].is_empty() {
            continue;
        }
        let (naga::AddressSpace::Storage { access }, Some(at)) = (global.space, global.binding)
        else {
            if global.binding.is_some() {
                let name = global.name.as_deref().unwrap_or("?");
                return Err(format!("`{name}` is bound, but no storage buffer"));
            }
            continue;
        };
        if at.group != 0 {
            return Err(format!("group {} is bound; only group 0 may be", at.group));
        }
        bindings.push(Binding {
            number: at.binding,
            read_only: !access.contains(naga::StorageAccess::STORE),
        });
    }
    bindings.sort_by_key(|binding| binding.number);

    Ok(Module {
        bindings,
        workgroup: module.entry_points[place].workgroup_size.iter().product(),
        spirv: if spirv {
            words(&module, &info, &source.entry)?
        } else {
            Vec::new()
        },
    })
}

/// A program as Vulkan's drivers get it, for tools and tests that have no device. `shuffles`: it may have subgroup operations.
///
/// # Errors
/// What is wrong with its source.
pub fn translated(source: &Source, shuffles: bool) -> Result<Vec<u32>, String> {
    Ok(read(source, true, capabilities(shuffles, false))?.spirv)
}

/// An error and its causes, in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

/// Writes SPIR-V without run-time checks: the caller guarantees its indices.
fn words(
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    entry: &str,
) -> Result<Vec<u32>, String> {
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        bounds_check_policies: naga::proc::BoundsCheckPolicies::default(),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ..spv::Options::default()
    };
    let pipeline = spv::PipelineOptions {
        shader_stage: naga::ShaderStage::Compute,
        entry_point: entry.to_owned(),
    };
    let words =
        spv::write_vec(module, info, &options, Some(&pipeline)).map_err(|e| e.to_string())?;
    Ok(spirv::patched(&words))
}

//! From WGSL to SPIR-V: kernel source, its translation, and a folder of translated programs.

pub(crate) mod cache;
pub(crate) mod module;
pub(crate) mod source;
mod spirv;

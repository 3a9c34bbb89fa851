//! The device against its word: on Vulkan and through wgpu alone, recorded and encoded.

mod common;
mod compile;
mod layer;
mod memory;
mod refusals;
mod run;
mod shared;
mod spirv;
mod validation;

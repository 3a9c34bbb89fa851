//! An accelerator without physics: adapters, memory, programs, and batches of commands that are recorded once and run often.
//!
//!     let device = Device::open(&Choice::First, None)?;
//!     let programs = device.programs(&[source], Duration::from_secs(60))?;
//!     let mut builder = device.batch(Replay::Recorded);
//!     builder.dispatch(&programs[0], &[(0, &state, 0..state.bytes())], worlds.div_ceil(32));
//!     let batch = builder.finish()?;
//!     device.run(&[&batch])?;
//!
//! Two routes lead to a driver. On Vulkan, memory, pipelines and recorded commands are its own (`vulkan`), and wgpu
//! opens the device and submits; elsewhere all goes through wgpu (`portable`). Both have the same interface and the same tests.

#![cfg_attr(
    not(target_os = "linux"),
    allow(dead_code, reason = "what only the Vulkan route uses")
)]

mod adapter;
mod ahead;
mod batch;
mod cache;
mod device;
mod error;
mod leave;
mod memory;
mod module;
mod portable;
mod program;
#[cfg_attr(not(target_os = "linux"), path = "vulkan_absent.rs")]
mod vulkan;
mod warm;

pub use adapter::{AdapterInfo, AdapterKind, Choice, adapters};
pub use batch::{Batch, BatchBuilder, Replay};
pub use device::{Device, lose_after};
pub use error::DeviceError;
#[doc(hidden)]
pub use leave::compiling;
pub use leave::leave;
pub use memory::{Buffer, Read, Staging, Write};
pub use program::{Program, Source};

//! Access to an accelerator, without physics: adapters, memory, programs, and batches of commands that are recorded once and run often.
//!
//!     let device = Device::open(&Choice::First, None)?;
//!     let programs = device.programs(&[source], Duration::from_secs(60))?;
//!     let mut builder = device.batch(Replay::Recorded);
//!     builder.dispatch(&programs[0], &[(0, &state, 0..state.bytes())], worlds.div_ceil(32));
//!     let batch = builder.finish()?;
//!     device.run(&[&batch])?;
//!
//! # Two routes
//! On Linux a device is opened and submitted to by wgpu, while memory, pipelines and recorded commands are Vulkan's own (`vulkan`).
//! Elsewhere, and in tests, everything goes through wgpu (`program::portable`, `batch::encode`, `memory::staging`). Both routes have the same interface, and
//! one test suite runs over both, with recorded and with encoded batches.
//!
//! # Batches
//! A recorded batch is a secondary command buffer. An encoder of wgpu that holds nothing else executes it. wgpu tracks nothing of it, so
//! a barrier of all work stands before each command, and one for the host at the end of a run. Programs check nothing at run time: a
//! batch is checked when it is built. The exception is the number of workgroups that a program computes (`dispatch_found`), which the program
//! must keep within the adapter's limit.
//!
//! # Rounding
//! On Vulkan every sum, product and `fma` is rounded as written (`NoContraction`), as on the CPU, so that a compensated sum keeps its
//! remainder.
//! On Metal and DirectX wgpu writes the driver's language, and the driver may contract sums: naga writes neither `precise` nor a pragma,
//! and wgpu 30 compiles Metal with fast mathematics and HLSL without IEEE strictness, with no option for either. Passing our own source
//! through wgpu would avoid that. It has not been tried for lack of such a system.
//!
//! # Memory
//! wgpu zeroes memory lazily where it has not seen a write. It takes imported buffers as written, so this crate clears every buffer
//! that it makes. A staging buffer is locked while a batch that names it runs. Pages of the host that are imported stay mapped as long
//! as the buffer over them, which owns them too ([`HostPages`]).
//!
//! # Failures
//! Out of memory, a lost device and a driver that compiles too long are errors, never panics. Code that exists for Mesa's software
//! driver is in `software`.
//!
//! # Tests
//! Every test that uses a GPU runs under Vulkan's validation layer with synchronization checks, and fails on any message of it
//! (`tests/device/layer.rs`).

#![cfg_attr(
    not(target_os = "linux"),
    allow(dead_code, reason = "items that only the Vulkan route uses")
)]

mod adapter;
mod allocation;
mod batch;
mod compile;
mod device;
mod error;
mod host_pages;
mod memory;
mod program;
mod raw_op;
mod shader;
mod software;
#[cfg_attr(not(target_os = "linux"), path = "vulkan_absent.rs")]
mod vulkan;

#[doc(hidden)]
pub use adapter::open_as_discrete;
pub use adapter::{AdapterInfo, AdapterKind, Choice, adapters};
pub use batch::run::lose_after;
pub use batch::{Batch, BatchBuilder, Replay};
pub use device::Device;
pub use error::DeviceError;
pub use host_pages::HostPages;
#[doc(hidden)]
pub use memory::allocate_at_most;
pub use memory::shared::{Descriptor, Moment, SharedBuffer, Timeline};
pub use memory::{Buffer, Read, Staging, Write};
pub use program::Program;
#[doc(hidden)]
pub use program::workers::compiling;
pub use shader::cache::bound;
pub use shader::module::translated;
pub use shader::source::Source;
pub use software::{leave, leave_at_once};

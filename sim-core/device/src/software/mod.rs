//! Mesa's software driver (lavapipe, whose compiler is llvmpipe): all code of this crate that exists for its sake.
//!
//! lavapipe runs kernels on the CPU through LLVM. It differs from hardware drivers in four ways:
//!
//! - **It compiles late.** A pipeline is compiled when it first runs, on the queue's single thread, one program after another. A
//!   grasp has dozens of kernels, each of which takes up to four seconds.
//! - **It writes its disk cache late**, when a device closes.
//! - **It is slow to compile long kernels.** LLVM recurses over chains of statements, so compile threads need large stacks
//!   (`workers`).
//! - **It cannot be stopped.** A thread that exceeds its limit is abandoned inside the driver. Exit handlers that unload the driver's
//!   libraries then crash that thread.
//!
//! What follows from that:
//!
//! | function | remedy | used for |
//! |---|---|---|
//! | [`precompile`] | opens one device per core; each compiles its share of the new programs and leaves the result in Mesa's disk cache | lavapipe |
//! | [`run_empty`] | runs every program once without workgroups, within the caller's compile limit | all Vulkan drivers, some of which finish compiling in the first run |
//! | [`leave`] | exits without exit handlers while an abandoned thread compiles | all drivers |
//!
//! Nothing here changes results. Without this module the same programs run with the same bits, and only the first frame takes longer.

mod exit;
mod first_run;
mod precompile;

pub use exit::{leave, leave_at_once};
pub(crate) use first_run::run_empty;
pub(crate) use precompile::precompile;

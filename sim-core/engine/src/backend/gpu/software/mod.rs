//! Mesa's software driver (lavapipe): all code of this backend that exists for its sake.
//!
//! lavapipe runs kernels on the CPU. It compiles every access to memory to a loop over the lanes, and its compile time grows with the
//! square of the accesses in a kernel. The grasp's Newton loop as one kernel takes it longer than four minutes. So:
//!
//! - kernels are small, and the solver's loop is split inside ([`LIMITS`]);
//! - a split loop is dispatched once per iteration, over a list of its active worlds (`active_worlds`);
//! - its memory is the computer's: what the driver reports is a constant ([`memory`]).
//!
//! `sim_device` has a module of the same name for what the driver needs when it compiles.

mod active_worlds;

pub(super) use active_worlds::{ActiveWorlds, Compaction, loops, sources};

use crate::backend::available_memory;
use sim_device::{AdapterInfo, AdapterKind};
use sim_record::split::{Limits, Prices};

/// Limits of kernels for the software driver. The grasp's Newton loop compiles in three kernels like the others. What crosses from one
/// kernel to the next costs about a tenth of a step, so they are few.
pub(super) const LIMITS: Limits = Limits {
    kernel: 16_000,
    repeated: 20_000,
    repeated_dispatch: 4_000,
    dispatch: 0,
    prices: Prices::SOFTWARE,
};

/// Limits of kernels, if the adapter is a software driver.
pub(super) fn limits(info: &AdapterInfo) -> Option<Limits> {
    is_software(info).then_some(LIMITS)
}

/// Words of a frame that a thread copies: one on hardware. The software driver starts a workgroup in the time of some words.
pub(super) fn show_words(info: &AdapterInfo) -> u32 {
    if is_software(info) { 16 } else { 1 }
}

/// Whether the adapter is a software driver.
pub(super) fn is_software(info: &AdapterInfo) -> bool {
    info.kind == AdapterKind::Software
}

/// Memory that worlds may take: the computer's [bytes].
pub(super) fn memory() -> Option<u64> {
    available_memory()
}

//! Threads per workgroup. Nothing has been measured on hardware GPUs.

use super::software;
use sim_device::AdapterInfo;

/// Threads of a subgroup of most GPUs, and of the software driver's workgroups of physics.
pub(super) const SUBGROUP: u32 = 32;

/// Bookkeeping and output.
pub(super) const BOOKKEEPING: u32 = 64;

/// Kernels of physics need many registers: a workgroup is one subgroup, so that none waits for another and no thread of it idles.
/// A driver that does not tell its subgroups reports at most 128 threads; more than 64 no GPU has.
pub(super) fn physics(info: &AdapterInfo) -> u32 {
    match software::is_software(info) {
        true => SUBGROUP,
        false => info.subgroup_max.clamp(SUBGROUP, BOOKKEEPING),
    }
}

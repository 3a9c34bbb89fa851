//! Threads per workgroup. Both are guesses: nothing has been measured on hardware GPUs.

/// Kernels of physics: they need many registers.
pub(super) const PHYSICS: u32 = 32;
/// Bookkeeping and output.
pub(super) const BOOKKEEPING: u32 = 64;

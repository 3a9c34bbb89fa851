//! What macOS and Windows share: the crate `sysinfo` asks them.

pub mod memory;
pub mod process;

//! What macOS and Windows share. The crate `sysinfo` asks them of memory and processes.

pub mod memory;
pub mod process;
pub mod storage;

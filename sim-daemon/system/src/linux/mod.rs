//! Linux.

mod cgroup;
pub mod clock;
pub mod cores;
pub mod memory;
pub(crate) mod places;
pub mod process;
pub mod storage;

pub use crate::unix::{faults, files, forks, open_files, signals, streams};

//! Linux.

mod cgroup;
pub mod clock;
pub mod cores;
pub mod memory;
mod places;
pub mod process;
pub mod storage;

pub use crate::unix::{faults, forks, open_files, signals, streams};

pub mod files {
    //! Files and folders of one user, locks on them, and where shared memory is.

    pub use super::places::{SHARED_MEMORY_CURE, folded, shared_memory};
    pub use crate::unix::files::*;
}

//! macOS. On Linux it runs as well, by the feature `macos-on-linux`, so that its tests do.
//!
//! There is no file system in memory: files of shared memory are on the disk, and the system writes changed pages back when it
//! likes. No program chooses its cores, locks all of its memory, or sleeps until an absolute time.

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

//! macOS. On Linux it runs as well, by the feature `macos-on-linux`, so that its tests do.
//!
//! There is no file system in memory: files of shared memory are on the disk, and the system writes changed pages back when it
//! likes. No program chooses its cores, locks all of its memory, or sleeps until an absolute time.

pub mod clock;
pub mod cores;
pub mod memory;
pub(crate) mod places;
pub mod process;
pub mod storage;

pub use crate::unix::{faults, files, forks, open_files, signals, streams};

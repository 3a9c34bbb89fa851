//! What differs between operating systems, for the protocol, the daemon and its clients.
//!
//! Each system is one module with the same functions: `linux`, `macos`, `windows`. The first two share `unix`, the last two
//! `portable`. The compiler compares them: every function here has a caller that is compiled on each system.
//!
//! | module | what it does |
//! |---|---|
//! | `clock` | a monotonic clock that all processes share, and sleep until a time on it |
//! | `cores` | which core a thread runs on, and may run on |
//! | `faults` | pages of a mapped file that somebody cut |
//! | `files` | private files and folders, locks, pipes, where shared memory is |
//! | `forks` | how often this process was forked |
//! | `memory` | memory that is free, and memory that stays |
//! | `open_files` | the limit of open files |
//! | `process` | other processes: whether they live, their age and memory |
//! | `signals` | requests to stop, and threads with a priority |
//! | `storage` | files that get a name when they are complete |
//! | `streams` | the standard streams, past their locks |

#[cfg(any(not(target_os = "linux"), feature = "macos-on-linux"))]
mod portable;
#[cfg(all(target_os = "linux", not(feature = "macos-on-linux")))]
#[path = "linux/mod.rs"]
mod system;
#[cfg(any(target_os = "macos", feature = "macos-on-linux"))]
#[path = "macos/mod.rs"]
mod system;
#[cfg(windows)]
#[path = "windows/mod.rs"]
mod system;
#[cfg(unix)]
mod unix;

#[cfg(not(any(target_os = "linux", target_os = "macos", windows)))]
compile_error!(
    "tightloop runs on Linux, macOS and Windows; another system needs a module like `macos` in sim-system"
);

pub use system::{
    clock, cores, faults, files, forks, memory, open_files, process, signals, storage, streams,
};

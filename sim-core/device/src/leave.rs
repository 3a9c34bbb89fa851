//! The end of a process in which a driver may still compile.

use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Threads of this process that compile, for any device.
pub(crate) static COMPILING: AtomicUsize = AtomicUsize::new(0);

// SAFETY: as C has it: it takes any number, and never returns.
unsafe extern "C" {
    safe fn _exit(code: i32) -> !;
}

/// Threads that compile. For tests, which end as libraries are taken apart and wait for them.
#[doc(hidden)]
pub fn compiling() -> usize {
    COMPILING.load(Ordering::Relaxed)
}

/// Ends the process with this code if a driver that was given up still compiles; else it returns.
///
/// The usual end of a process takes apart the driver's libraries, and threads that are in them crash.
pub fn leave(code: i32) {
    if COMPILING.load(Ordering::Relaxed) > 0 {
        let _ = std::io::stdout().flush();
        _exit(code);
    }
}

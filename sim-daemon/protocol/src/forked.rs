//! Which process this is, without a system call: what a fork copies is not the child's.

use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// Forks between the first process of this program and this one.
static FORKS: AtomicU32 = AtomicU32::new(0);
static COUNT: Once = Once::new();

/// The process in which something was made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maker {
    pid: u32,
    forks: u32,
}

impl Maker {
    /// This process.
    pub(crate) fn this() -> Maker {
        COUNT.call_once(|| {
            // SAFETY: the handler stores a number and does nothing else, as a child of a process with threads must.
            let failed = unsafe { libc::pthread_atfork(None, None, Some(count)) };
            assert_eq!(failed, 0, "memory for a handler of forks");
        });
        Maker {
            pid: std::process::id(),
            forks: FORKS.load(Ordering::Relaxed),
        }
    }

    /// Whether this process is the one, and not a fork of it.
    pub(crate) fn is_this(self) -> bool {
        FORKS.load(Ordering::Relaxed) == self.forks
    }

    /// Its number.
    pub(crate) fn pid(self) -> u32 {
        self.pid
    }
}

extern "C" fn count() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

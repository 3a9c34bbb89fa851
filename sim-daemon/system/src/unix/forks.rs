//! Forks, counted without a system call.

use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

static FORKS: AtomicU32 = AtomicU32::new(0);
static COUNT: Once = Once::new();

/// Counts forks from now on.
pub fn start_to_count() {
    COUNT.call_once(|| {
        // SAFETY: the handler stores a number and does nothing else, as a child of a process with threads must.
        let failed = unsafe { libc::pthread_atfork(None, None, Some(count)) };
        assert_eq!(failed, 0, "memory for a handler of forks");
    });
}

/// Forks between the process that began to count and this one.
pub fn count_so_far() -> u32 {
    FORKS.load(Ordering::Relaxed)
}

extern "C" fn count() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

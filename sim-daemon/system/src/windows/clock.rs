//! The monotonic clock, in nanoseconds, and sleep until a time on it.

use std::sync::OnceLock;
use std::time::Duration;

use windows_sys::Win32::System::Performance::{QueryPerformanceCounter, QueryPerformanceFrequency};

const SECOND: u128 = 1_000_000_000;

/// Time of the monotonic clock, which all processes share [ns].
pub fn now() -> u64 {
    static FREQUENCY: OnceLock<i64> = OnceLock::new();
    let read = |call: unsafe extern "system" fn(*mut i64) -> i32| {
        let mut value = 0;
        // SAFETY: the call writes one number, and never fails on the systems that Rust runs on.
        unsafe { call(&raw mut value) };
        value
    };
    let frequency = *FREQUENCY.get_or_init(|| read(QueryPerformanceFrequency));
    (read(QueryPerformanceCounter) as u128 * SECOND / frequency as u128) as u64
}

/// Sleeps until that time. The system may wake the thread late.
pub fn sleep_until(at: u64) {
    std::thread::sleep(Duration::from_nanos(at.saturating_sub(now())));
}

//! The monotonic clock, in nanoseconds, and sleep until a time on it.

use std::num::NonZeroU64;

use rustix::thread::{
    ClockId, clock_nanosleep_absolute, current_timer_slack, set_current_timer_slack,
};
use rustix::time::{Timespec, clock_gettime};

const SECOND: u64 = 1_000_000_000;

/// Time of the monotonic clock, which all processes share [ns].
pub fn now() -> u64 {
    let time = clock_gettime(rustix::time::ClockId::Monotonic);
    time.tv_sec as u64 * SECOND + time.tv_nsec as u64
}

/// Sleeps until that time. A signal ends it early, and the system may wake the thread late.
pub fn sleep_until(at: u64) {
    let time = Timespec {
        tv_sec: (at / SECOND) as i64,
        tv_nsec: (at % SECOND) as i64,
    };
    // the system may wake us later by the slack of the thread, 50 µs unless somebody chose otherwise
    let slack = current_timer_slack().ok().and_then(NonZeroU64::new);
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    // what a signal cuts short the caller waits for by other means
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
    let _ = set_current_timer_slack(slack);
}

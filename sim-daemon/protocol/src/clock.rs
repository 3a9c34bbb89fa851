//! The monotonic clock, in nanoseconds, and sleep until a time on it.

use std::num::NonZeroU64;

use rustix::thread::{
    ClockId, clock_nanosleep_absolute, current_timer_slack, set_current_timer_slack,
};
use rustix::time::{Timespec, clock_gettime};

const SECOND: u64 = 1_000_000_000;
/// Waking takes tens of microseconds, on some machines hundreds: a thread sleeps so much less, and spins for the rest [ns].
const MARGIN_MIN: u64 = 100_000;
const MARGIN_MAX: u64 = 300_000;
/// Share of the margin that goes with each sleep that it was enough for.
const FORGET: u64 = 512;

/// Time of the monotonic clock, which all processes share [ns].
pub(crate) fn now() -> u64 {
    let time = clock_gettime(rustix::time::ClockId::Monotonic);
    time.tv_sec as u64 * SECOND + time.tv_nsec as u64
}

/// Sleeps until times on the monotonic clock, and learns how late the system wakes the thread.
#[derive(Debug)]
pub(crate) struct Alarm {
    margin: u64,
}

impl Alarm {
    pub(crate) fn new() -> Alarm {
        Alarm { margin: MARGIN_MIN }
    }

    /// Sleeps until shortly before that time, so that the caller can look for what comes then. A signal ends it early.
    pub(crate) fn sleep_until_shortly_before(&mut self, at: u64) {
        let until = at.saturating_sub(self.margin);
        if until <= now() {
            return;
        }
        let time = Timespec {
            tv_sec: (until / SECOND) as i64,
            tv_nsec: (until % SECOND) as i64,
        };
        // the system may wake us later by the slack of the thread, 50 µs unless somebody chose otherwise
        let slack = current_timer_slack().ok().and_then(NonZeroU64::new);
        let _ = set_current_timer_slack(NonZeroU64::new(1));
        // what a signal cuts short the caller waits for by other means
        let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
        let _ = set_current_timer_slack(slack);
        let needed = 2 * now().saturating_sub(until);
        let kept = self.margin - self.margin / FORGET;
        self.margin = needed.max(kept).clamp(MARGIN_MIN, MARGIN_MAX);
    }

    /// Waits until that time: sleeps, then spins.
    pub(crate) fn wait_until(&mut self, at: u64) {
        self.sleep_until_shortly_before(at);
        while now() < at {
            std::hint::spin_loop();
        }
    }
}

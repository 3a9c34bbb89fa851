//! The monotonic clock, in nanoseconds, and waiting for a time on it.

pub(crate) use crate::doors::system::clock::now;

/// Waking takes tens of microseconds, on some machines hundreds: a thread sleeps so much less, and spins for the rest [ns].
const MARGIN_MIN: u64 = 100_000;
const MARGIN_MAX: u64 = 300_000;
/// Share of the margin that goes with each sleep that it was enough for.
const FORGET: u64 = 512;

/// Sleeps until times on the monotonic clock, and learns how late the system wakes the thread.
#[derive(Debug)]
pub(crate) struct Alarm {
    margin: u64,
}

impl Alarm {
    pub(crate) fn new() -> Alarm {
        Alarm { margin: MARGIN_MIN }
    }

    /// Sleeps until shortly before that time, so that the caller can look for what comes then. On Linux a signal ends it early.
    pub(crate) fn sleep_until_shortly_before(&mut self, at: u64) {
        let until = at.saturating_sub(self.margin);
        if until <= now() {
            return;
        }
        crate::doors::system::clock::sleep_until(until);
        let needed = 2 * now().saturating_sub(until);
        let kept = self.margin - self.margin / FORGET;
        self.margin = needed.max(kept).clamp(MARGIN_MIN, MARGIN_MAX);
    }

    /// Waits until that time: sleeps, then spins.
    pub(crate) fn wait_until(&mut self, at: u64) {
        self.sleep_until_shortly_before(at);
        while now() < at {
            crate::doors::thread::spin_loop();
        }
    }
}

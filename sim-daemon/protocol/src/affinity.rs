//! Core affinity: client and daemon on a core each, where there are two.
//!
//! Waking the other side through a socket makes the system expect that the waker sleeps next, so it may put both on one core,
//! and leaves them there. Each side therefore says where it runs; when that is the same core, nobody spins, and the daemon
//! moves away once in a while.

use std::time::{Duration, Instant};

use rustix::thread::{sched_getaffinity, sched_getcpu, sched_setaffinity};

/// Asking where we run is a system call: once in so many commands is enough.
const ASK_PERIOD: u32 = 16;
/// Shortest and longest time between two moves. If the system moves us back, it may have a reason.
const PAUSE_MIN: Duration = Duration::from_millis(20);
const PAUSE_MAX: Duration = Duration::from_secs(5);

/// Where one side runs.
#[derive(Debug)]
pub(crate) struct CoreAffinity {
    core: usize,
    asked: u32,
    moved: Instant,
    pause: Duration,
}

impl CoreAffinity {
    pub(crate) fn new() -> CoreAffinity {
        CoreAffinity {
            core: sched_getcpu(),
            asked: 0,
            moved: Instant::now(),
            pause: PAUSE_MIN,
        }
    }

    /// The core we run on, or ran on a few commands ago.
    pub(crate) fn core(&mut self) -> u64 {
        self.asked += 1;
        if self.asked == ASK_PERIOD {
            (self.asked, self.core) = (0, sched_getcpu());
        }
        self.core as u64
    }

    /// Moves this thread off `core` if it may run elsewhere; it may come back at once if the system thinks so. Returns
    /// whether it moved.
    pub(crate) fn leave(&mut self, core: u64) -> bool {
        let since = self.moved.elapsed();
        if since < self.pause {
            return false;
        }
        self.pause = if since < 4 * self.pause {
            (2 * self.pause).min(PAUSE_MAX)
        } else {
            PAUSE_MIN
        };
        self.moved = Instant::now();
        let (Ok(allowed), core) = (sched_getaffinity(None), core as usize) else {
            return false;
        };
        let mut others = allowed;
        others.unset(core);
        if sched_getcpu() != core
            || others.count() == 0
            || sched_setaffinity(None, &others).is_err()
        {
            return false;
        }
        // where we may run stays the user's choice; that failed only if it was changed meanwhile
        let _ = sched_setaffinity(None, &allowed);
        self.core = sched_getcpu();
        self.core != core
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_leaves_a_core_and_keeps_its_choice_of_cores() {
        let allowed = sched_getaffinity(None).unwrap();
        if allowed.count() < 2 {
            return; // nowhere to go
        }
        let mut affinity = CoreAffinity::new();
        std::thread::sleep(PAUSE_MIN);
        let core = sched_getcpu();
        let left = Instant::now();
        // the system may move us between the two lines: then there is nothing to leave
        assert!(affinity.leave(core as u64) || sched_getcpu() != core);
        assert_eq!(sched_getaffinity(None).unwrap(), allowed);
        // on a busy machine the pause may be over before the second attempt
        let again = affinity.leave(sched_getcpu() as u64);
        assert!(!again || left.elapsed() >= PAUSE_MIN, "not twice in a row");
    }
}

//! Core affinity: client and daemon on a core each, where there are two.
//!
//! Waking the other side through a socket makes the system expect that the waker sleeps next, so it may put both on one core,
//! and leaves them there. Each side therefore says where it runs; when that is the same core, nobody spins, and the daemon
//! moves away once in a while.

use std::time::Duration;

use crate::doors::system::cores;
use crate::doors::time::Instant;

/// Asking where we run is a system call: once in so many commands is enough.
const ASK_PERIOD: u32 = 16;
/// Shortest and longest time between two moves. If the system moves us back, it may have a reason.
const PAUSE_MIN: Duration = Duration::from_millis(20);
const PAUSE_MAX: Duration = Duration::from_secs(5);

/// Where the system tells no core, a side has a number that is no core's, and none of another process.
const UNKNOWN: u64 = 1 << 32;

/// Where one side runs.
#[derive(Debug)]
pub(crate) struct CoreAffinity {
    core: u64,
    asked: u32,
    moved: Instant,
    pause: Duration,
}

impl CoreAffinity {
    pub(crate) fn new() -> CoreAffinity {
        CoreAffinity {
            core: core_or_unknown(),
            asked: 0,
            moved: Instant::now(),
            pause: PAUSE_MIN,
        }
    }

    /// The core we run on, or ran on a few commands ago.
    pub(crate) fn core(&mut self) -> u64 {
        self.asked += 1;
        if self.asked == ASK_PERIOD {
            (self.asked, self.core) = (0, core_or_unknown());
        }
        self.core
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
        let moved = core < UNKNOWN && cores::leave(core as usize);
        self.core = core_or_unknown();
        moved
    }
}

fn core_or_unknown() -> u64 {
    // two sides whose cores are unknown are not on one core
    cores::current().map_or(UNKNOWN | u64::from(crate::doors::process::id()), |core| {
        core as u64
    })
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    #[test]
    fn a_side_moves_once_in_a_pause_and_never_off_a_core_that_is_unknown() {
        let mut affinity = CoreAffinity::new();
        std::thread::sleep(PAUSE_MIN);
        if cores::current().is_none() {
            assert!(affinity.core() > UNKNOWN && !affinity.leave(affinity.core));
            return;
        }
        assert!(!affinity.leave(UNKNOWN));
        let mut affinity = CoreAffinity::new();
        std::thread::sleep(PAUSE_MIN);
        let left = Instant::now();
        let first = affinity.leave(core_or_unknown());
        // on a busy machine the pause may be over before the second attempt
        let again = affinity.leave(core_or_unknown());
        assert!(
            !(first && again) || left.elapsed() >= PAUSE_MIN,
            "twice in a row"
        );
    }
}

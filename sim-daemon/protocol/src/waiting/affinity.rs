//! Core affinity: client and daemon on a core each, where there are two.
//!
//! Waking the other side through a socket makes the system expect that the waker sleeps next, so it may put both on one core,
//! and leaves them there. Each side therefore says where it runs; when that is the same core, nobody spins, and the daemon
//! moves away once in a while. A daemon with a pace stays away: late frames cost more than a core that it does not use.

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
    away: Option<cores::Away>,
}

impl CoreAffinity {
    pub(crate) fn new() -> CoreAffinity {
        CoreAffinity {
            core: core_or_unknown(),
            asked: 0,
            moved: Instant::now(),
            pause: PAUSE_MIN,
            away: None,
        }
    }

    /// The core we run on, or ran on a few commands ago. With a pace there is time to ask at every command.
    pub(crate) fn core(&mut self, is_paced: bool) -> u64 {
        self.asked += 1;
        if is_paced || self.asked >= ASK_PERIOD {
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

    /// Keeps this thread off `core` if it is there, until [`CoreAffinity::stay`] or a call for another core. Returns whether
    /// it is elsewhere now.
    pub(crate) fn keep_off(&mut self, core: u64) -> bool {
        // the core of before may be the only other one
        self.away = None;
        if core < UNKNOWN {
            self.away = cores::keep_off(core as usize);
        }
        self.core = core_or_unknown();
        self.core != core
    }

    /// Ends [`CoreAffinity::keep_off`].
    pub(crate) fn stay(&mut self) {
        self.away = None;
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
            assert!(affinity.core(true) > UNKNOWN && !affinity.leave(affinity.core));
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

    #[cfg(target_os = "linux")]
    #[test]
    fn a_side_that_keeps_off_a_core_stays_off_until_it_need_not() {
        use std::thread::available_parallelism;

        let allowed = available_parallelism().unwrap();
        let mut affinity = CoreAffinity::new();
        // from one core to the next, and back where there are two
        for _ in 0..3 {
            let core = core_or_unknown();
            assert_eq!(affinity.keep_off(core), core_or_unknown() != core);
            // the system may have moved us before the call, which has nothing to do then
            if affinity.away.is_some() {
                std::thread::sleep(Duration::from_millis(2));
                assert_ne!(core_or_unknown(), core);
                assert!(available_parallelism().unwrap() < allowed);
            }
        }
        affinity.stay();
        assert_eq!(available_parallelism().unwrap(), allowed);
    }
}

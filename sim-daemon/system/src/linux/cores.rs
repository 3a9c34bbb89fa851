//! Cores of a thread.

use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// The core that this thread runs on; none where the system does not tell.
pub fn current() -> Option<usize> {
    Some(sched_getcpu())
}

/// Moves this thread off `core` if it is there and may run elsewhere, and says whether it moved. It may come back at once if
/// the system thinks so; where it may run stays the user's choice.
pub fn leave(core: usize) -> bool {
    keep_off(core).is_some_and(|away| {
        drop(away);
        sched_getcpu() != core
    })
}

/// Moves this thread, and those that it starts, off `core` if it is there and may run elsewhere, until the value is dropped,
/// on the same thread. None where it did not.
pub fn keep_off(core: usize) -> Option<Away> {
    let allowed = sched_getaffinity(None).ok()?;
    let mut others = allowed;
    others.unset(core);
    if sched_getcpu() != core || others.count() == 0 {
        return None;
    }
    sched_setaffinity(None, &others).ok()?;
    Some(Away { allowed, others })
}

/// A core that a thread keeps off.
#[derive(Debug)]
pub struct Away {
    allowed: CpuSet,
    others: CpuSet,
}

impl Drop for Away {
    fn drop(&mut self) {
        // another choice that was made meanwhile stays
        if sched_getaffinity(None).is_ok_and(|now| now == self.others) {
            let _ = sched_setaffinity(None, &self.allowed);
        }
    }
}

/// Keeps this thread, and those that it starts, on some cores.
///
/// # Errors
/// Why not, and what to do.
pub fn keep_to(cores: &[usize]) -> Result<(), String> {
    let mut set = CpuSet::new();
    for &core in cores {
        if core >= CpuSet::MAX_CPU {
            return Err(format!(
                "core {core}: numbers end at {}",
                CpuSet::MAX_CPU - 1
            ));
        }
        set.set(core);
    }
    sched_setaffinity(None, &set)
        .map_err(|error| format!("{error}; /proc/cpuinfo lists the processors"))
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
        let core = sched_getcpu();
        // the system may move us between the two lines: then there is nothing to leave
        assert!(leave(core) || sched_getcpu() != core);
        assert_eq!(sched_getaffinity(None).unwrap(), allowed);
        let core = sched_getcpu();
        if let Some(away) = keep_off(core) {
            std::thread::yield_now();
            assert_ne!(sched_getcpu(), core);
            drop(away);
            assert_eq!(sched_getaffinity(None).unwrap(), allowed);
        }
        assert!(!leave(CpuSet::MAX_CPU - 1), "it is not there");
    }
}

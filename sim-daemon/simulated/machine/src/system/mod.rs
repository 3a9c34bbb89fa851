//! What `sim_system` is in production, as on Linux.

pub mod files;
pub mod open_files;
pub mod process;
pub mod signals;

use std::collections::BTreeMap;

use crate::sync::Arc;
use crate::sync::atomic::AtomicBool;

/// Memory of the machine, unless a scenario changes it [bytes].
const MEMORY: u64 = 16 << 30;

/// What the system keeps besides files and processes.
#[derive(Debug)]
pub(crate) struct System {
    /// Memory that files and processes share [bytes].
    memory: u64,
    /// Files that a process may have open, before and after it raises the limit.
    soft: u64,
    hard: u64,
    /// By process that has raised it.
    limits: BTreeMap<u32, u64>,
    /// What a signal sets, by process.
    flags: BTreeMap<u32, Vec<Arc<AtomicBool>>>,
    /// On which core a thread runs.
    cores: BTreeMap<usize, usize>,
}

impl System {
    pub(crate) fn new() -> System {
        System {
            memory: MEMORY,
            soft: 1024,
            hard: 1 << 20,
            limits: BTreeMap::new(),
            flags: BTreeMap::new(),
            cores: BTreeMap::new(),
        }
    }

    /// Files that a process may have open.
    pub(crate) fn limit(&self, process: u32) -> u64 {
        self.limits.get(&process).copied().unwrap_or(self.soft)
    }

    /// Lets go of what it keeps for a dead process.
    pub(crate) fn release(&mut self, process: u32) {
        self.limits.remove(&process);
        self.flags.remove(&process);
    }
}

/// The monotonic clock.
pub mod clock {
    use crate::world::{is_on, step};

    pub use crate::time::now;

    /// Sleeps until that time [ns].
    pub fn sleep_until(at: u64) {
        step("sleeps");
        if is_on() {
            crate::thread::sleep_until(at);
        }
    }
}

/// Cores of a thread.
pub mod cores {
    use crate::world::{World, me, step, with};

    /// Once in so many looks a thread has been moved.
    const MOVES: u32 = 16;

    /// The core that this thread runs on.
    pub fn current() -> Option<usize> {
        step("looks at its core");
        Some(with(core))
    }

    /// Moves this thread off `core` if it is there and there are others, and says whether it moved.
    pub fn leave(core: usize) -> bool {
        step("leaves a core");
        with(|world| {
            if self::core(world) != core || world.cores < 2 {
                return false;
            }
            let other = (core + world.rng.usize(1..world.cores)) % world.cores;
            world.system.cores.insert(me(), other);
            true
        })
    }

    /// The same. The system may move the thread back, as it may after [`leave`].
    pub fn keep_off(core: usize) -> Option<Away> {
        leave(core).then_some(Away)
    }

    /// A core that a thread keeps off.
    #[derive(Debug)]
    pub struct Away;

    fn core(world: &mut World) -> usize {
        let there = world.system.cores.get(&me()).copied();
        match there {
            Some(core) if world.rng.u32(0..MOVES) > 0 => core,
            _ => {
                let core = world.rng.usize(0..world.cores);
                world.system.cores.insert(me(), core);
                core
            }
        }
    }
}

/// Memory of the machine.
pub mod memory {
    use crate::world::{system_call, with};

    /// Memory that can be taken [bytes]; the largest number where that is not known.
    pub fn available() -> u64 {
        match system_call("asks for free memory") {
            Ok(()) => with(|world| world.system.memory.saturating_sub(world.files.used())),
            Err(_) => u64::MAX,
        }
    }

    /// For a scenario: the machine has so much, shared memory included [bytes].
    pub fn set_available(bytes: u64) {
        with(|world| world.system.memory = bytes);
    }
}

/// Forks, of which there are none.
pub mod forks {
    /// Counts forks from now on.
    pub fn start_to_count() {}

    /// Forks between the process that began to count and this one.
    pub fn count_so_far() -> u32 {
        0
    }
}

/// Files whose pages are taken.
pub mod storage {
    use std::io;

    use crate::fs::File;

    /// What one call takes of a file [bytes].
    const TAKEN_AT_ONCE: u64 = 16 << 20;

    /// Takes the pages of a file now, so that later writes cannot fail.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn reserve(file: &File, bytes: u64) -> io::Result<()> {
        let mut taken = 0;
        while taken < bytes {
            taken = bytes.min(taken + TAKEN_AT_ONCE);
            file.reserve(taken)?;
        }
        Ok(())
    }
}

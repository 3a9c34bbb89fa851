//! Which process this is, without a system call: what a fork copies is not the child's.

use crate::doors::process;
use crate::doors::system::forks;

/// The process in which something was made.
#[derive(Debug, Clone, Copy)]
pub struct Maker {
    pid: u32,
    forks: u32,
}

impl Maker {
    /// This process.
    #[must_use]
    pub fn this() -> Maker {
        forks::start_to_count();
        Maker {
            pid: process::id(),
            forks: forks::count_so_far(),
        }
    }

    /// Whether this process is the one, and not a fork of it.
    pub fn is_this(self) -> bool {
        forks::count_so_far() == self.forks
    }

    /// Its number.
    pub fn pid(self) -> u32 {
        self.pid
    }
}

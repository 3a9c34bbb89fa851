//! Memory of the machine and of this process's control groups.

use std::fs;
use std::path::Path;

use rustix::mm::{MlockAllFlags, mlockall};

use super::cgroup;

/// Memory that can be taken without swapping, of the machine or of our control groups, whichever has least [bytes]; the
/// largest number where that is not known.
pub fn available() -> u64 {
    let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("MemAvailable:"))?;
        Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
    });
    let group = cgroup::free_memory(Path::new("/"));
    [machine, group]
        .into_iter()
        .flatten()
        .fold(u64::MAX, u64::min)
}

/// Keeps the pages that are in use now in memory.
///
/// # Errors
/// Why that was not granted, and what to do.
pub fn lock() -> Result<(), String> {
    mlockall(MlockAllFlags::CURRENT).map_err(|error| {
        format!("({error}): run as root, or raise `memlock` in /etc/security/limits.conf")
    })
}

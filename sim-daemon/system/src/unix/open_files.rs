//! The limit of open files of this process.

use std::fs;
use std::io;

use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// What macOS grants a process whose hard limit is none, from its `sys/syslimits.h`.
const OPEN_MAX: u64 = 10_240;

/// Files that this process may have open.
pub fn limit() -> u64 {
    getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX)
}

/// Files that this process has open; none where that cannot be counted.
pub fn count() -> Option<u64> {
    let mut folders = ["/proc/self/fd", "/dev/fd"].into_iter();
    Some(
        folders
            .find_map(|folder| fs::read_dir(folder).ok())?
            .count() as u64,
    )
}

/// Raises the limit as far as this process may.
pub fn raise_limit() {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    if setrlimit(Resource::Nofile, raised).is_err() {
        let most = limit.maximum.unwrap_or(u64::MAX).min(OPEN_MAX);
        let raised = Rlimit {
            current: limit.current.max(Some(most)),
            ..limit
        };
        // where the hard limit is reached too, the file that cannot be opened tells
        let _ = setrlimit(Resource::Nofile, raised);
    }
}

/// Whether a call failed since too many files are open.
pub fn is_exhausted(error: &io::Error) -> bool {
    matches!(
        Errno::from_io_error(error),
        Some(Errno::MFILE | Errno::NFILE)
    )
}

/// Opens a file and closes it.
///
/// # Errors
/// Why this process can open no file now.
pub fn try_one() -> io::Result<()> {
    fs::File::open("/").map(|_| ())
}

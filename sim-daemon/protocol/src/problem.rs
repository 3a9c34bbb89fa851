//! Why shared memory could not be made or opened: the transport's own errors rarely know.

use std::cell::RefCell;
use std::fs::File;
use std::path::Path;

use rustix::fs::{Access, access, statvfs};
use rustix::io::Errno;

/// Where POSIX shared memory is on Linux.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// With less than this left, what the transport writes beside its memory does not fit either [bytes].
pub(crate) const FREE_MIN: u64 = 64 << 10;

/// Why the last call of this thread failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Problem {
    /// The file system is full.
    Full {
        /// Its folder.
        folder: String,
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// The file is not the one that was made.
    Damaged {
        /// The file.
        path: String,
    },
    /// The system refuses, for example since there are too many open files.
    System(Errno),
}

thread_local! {
    static PROBLEM: RefCell<Option<Problem>> = const { RefCell::new(None) };
}

/// Why the last storage that this thread made or opened failed; once.
pub(crate) fn take_problem() -> Option<Problem> {
    PROBLEM.take()
}

/// The problem of a call that made a file without us, if there is one with the file system.
pub(crate) fn other_problem() -> Option<Problem> {
    match File::open("/") {
        Err(error) => Errno::from_io_error(&error).map(Problem::System),
        Ok(_) => no_room(FREE_MIN),
    }
}

/// The problem of a shared memory with less than so many bytes left.
pub(crate) fn no_room(needed: u64) -> Option<Problem> {
    let problem = Problem::full(SHARED_MEMORY, needed);
    matches!(problem, Problem::Full { free, .. } if free < needed).then_some(problem)
}

/// What to do about a folder that cannot be used. Frames go through [`SHARED_MEMORY`] wherever the root folder is.
pub(crate) fn folder_cure(folder: &Path) -> &'static str {
    let writable = access(SHARED_MEMORY, Access::WRITE_OK | Access::EXEC_OK).is_ok();
    if folder.starts_with(SHARED_MEMORY) && !writable {
        "frames go through /dev/shm, which must be writable for this user: mount memory there, by \
         `mount -t tmpfs -o mode=1777 tmpfs /dev/shm`"
    } else {
        "set TIGHTLOOP_ROOT to a folder of your own"
    }
}

/// Notes why a call fails.
pub(crate) fn failed(problem: Problem) {
    PROBLEM.replace(Some(problem));
}

/// Bytes free on the file system of a folder; 0 where that cannot be asked.
pub(crate) fn free_bytes(folder: &str) -> u64 {
    statvfs(folder).map_or(0, |status| status.f_bavail * status.f_frsize)
}

impl Problem {
    /// The file system of a folder is full.
    pub(crate) fn full(folder: &str, needed: u64) -> Problem {
        Problem::Full {
            folder: folder.to_owned(),
            free: free_bytes(folder),
            needed,
        }
    }
}

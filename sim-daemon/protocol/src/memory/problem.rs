//! Why shared memory could not be made or opened: the transport's own errors rarely know.
#![cfg_attr(simulated, allow(dead_code))] // of memory that only the real transport has

use std::cell::RefCell;
use std::io;
use std::path::Path;

use crate::doors::system::files::{SHARED_MEMORY_CURE, free_bytes, is_writable, shared_memory};
use crate::doors::system::open_files;

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
    System {
        /// What it says.
        error: SystemError,
        /// The file, where it is known.
        path: Option<String>,
    },
}

/// What the system says, as it can be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SystemError {
    Code(i32),
    /// Of an error that is none of the system's.
    Kind(io::ErrorKind),
}

impl From<io::Error> for SystemError {
    fn from(error: io::Error) -> SystemError {
        let kind = SystemError::Kind(error.kind());
        error.raw_os_error().map_or(kind, SystemError::Code)
    }
}

impl From<SystemError> for io::Error {
    fn from(error: SystemError) -> io::Error {
        match error {
            SystemError::Code(code) => io::Error::from_raw_os_error(code),
            SystemError::Kind(kind) => kind.into(),
        }
    }
}

crate::doors::thread_local! {
    static PROBLEM: RefCell<Option<Problem>> = const { RefCell::new(None) };
}

/// Why the last storage that this thread made or opened failed; once.
pub(crate) fn take_problem() -> Option<Problem> {
    PROBLEM.with(RefCell::take)
}

/// The problem of a call that made a file without us, if there is one with the file system.
pub(crate) fn other_problem() -> Option<Problem> {
    match open_files::try_one() {
        Err(error) => Some(Problem::System {
            error: error.into(),
            path: None,
        }),
        Ok(()) => no_room(FREE_MIN),
    }
}

/// The problem of a shared memory with less than so many bytes left.
pub(crate) fn no_room(needed: u64) -> Option<Problem> {
    let problem = Problem::full(Path::new(shared_memory()), needed);
    matches!(problem, Problem::Full { free, .. } if free < needed).then_some(problem)
}

/// What to do about a folder that cannot be used. Frames go through [`shared_memory`] wherever the root folder is.
pub(crate) fn folder_cure(folder: &Path) -> &'static str {
    let shared = Path::new(shared_memory());
    if folder.starts_with(shared) && !is_writable(shared) {
        SHARED_MEMORY_CURE
    } else {
        "set TIGHTLOOP_ROOT to a folder of your own"
    }
}

/// Notes why a call fails.
pub(crate) fn failed(problem: Problem) {
    PROBLEM.with(|last| last.replace(Some(problem)));
}

impl Problem {
    /// The system refuses a file.
    pub(crate) fn of_file(path: &Path, error: io::Error) -> Problem {
        Problem::System {
            error: error.into(),
            path: Some(path.to_string_lossy().into_owned()),
        }
    }

    /// The file system of a folder is full.
    pub(crate) fn full(folder: &Path, needed: u64) -> Problem {
        Problem::Full {
            folder: folder.to_string_lossy().into_owned(),
            free: free_bytes(folder),
            needed,
        }
    }
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    #[test]
    fn errors_keep_their_code_or_their_kind() {
        for error in [
            io::Error::from_raw_os_error(13),
            io::ErrorKind::OutOfMemory.into(),
        ] {
            let text = error.to_string();
            assert_eq!(io::Error::from(SystemError::from(error)).to_string(), text);
        }
    }
}

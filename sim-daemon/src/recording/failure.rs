//! Errors of recordings.

use std::path::Path;

use crate::error::DaemonError;

/// The recording cannot be made, or not go on.
pub(super) fn failed(path: &Path, problem: impl Into<String>) -> DaemonError {
    DaemonError::Recording {
        path: path.to_owned(),
        problem: problem.into(),
    }
}

/// The recording cannot be replayed, or not further.
pub(super) fn unreadable(path: &Path, problem: impl Into<String>) -> DaemonError {
    DaemonError::Replay {
        path: path.to_owned(),
        problem: problem.into(),
    }
}

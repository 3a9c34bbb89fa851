//! Room for the open files of a node: sockets and locks, since mappings keep none.

use std::fs;

use rustix::process::{Resource, getrlimit, setrlimit};

use crate::ProtocolError;

/// Open files of a client or of a group of worlds, with all of its clients, rounded up.
const OF_A_NODE: u64 = 128;

/// Open files of a daemon without groups or clients, and of each group, as counted in `/proc/PID/fd`.
const OF_A_DAEMON: u64 = 16;
const OF_A_GROUP: u64 = 21;

/// Raises this process's soft limit of open files to the hard one when it is near. It never lowers it.
pub(crate) fn make_room() {
    let limit = getrlimit(Resource::Nofile);
    let Some(soft) = limit.current else {
        return;
    };
    // a list that cannot be opened is one too many
    let open = fs::read_dir("/proc/self/fd").map_or(soft, |files| files.count() as u64);
    if open + OF_A_NODE > soft {
        raise_limit();
    }
}

/// Makes room for the open files of a daemon, whose groups begin all at once: raises the soft limit to the hard one.
///
/// # Errors
/// [`ProtocolError::Descriptors`] when that is not enough.
pub fn make_room_for(groups: usize) -> Result<(), ProtocolError> {
    raise_limit();
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    if limit < OF_A_DAEMON + OF_A_GROUP * groups as u64 {
        return Err(ProtocolError::descriptors(format!(
            "begin with {groups} groups"
        )));
    }
    Ok(())
}

fn raise_limit() {
    let limit = getrlimit(Resource::Nofile);
    let raised = rustix::process::Rlimit {
        current: limit.maximum,
        ..limit
    };
    // where the hard limit is reached too, the file that cannot be opened tells
    let _ = setrlimit(Resource::Nofile, raised);
}

//! Room for the open files of a node: sockets and locks, since mappings keep none.

use std::fs;

use rustix::process::{Resource, getrlimit, setrlimit};

/// Open files of a client or of a group of worlds, with all of its clients, rounded up.
const OF_A_NODE: u64 = 128;

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

/// Raises this process's soft limit of open files to the hard one: in a daemon, whose groups begin all at once, at its start.
pub fn raise_limit() {
    let limit = getrlimit(Resource::Nofile);
    let raised = rustix::process::Rlimit {
        current: limit.maximum,
        ..limit
    };
    // where the hard limit is reached too, the file that cannot be opened tells
    let _ = setrlimit(Resource::Nofile, raised);
}

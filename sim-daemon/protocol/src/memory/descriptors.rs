//! Room for the open files of a node: sockets and locks, since mappings keep none.

use sim_system::open_files;

use crate::ProtocolError;

/// Open files of a client or of a group of worlds, with all of its clients, rounded up.
const OF_A_NODE: u64 = 128;

/// Open files of a daemon without groups or clients, and of each group, as counted in `/proc/PID/fd`.
const OF_A_DAEMON: u64 = 16;
const OF_A_GROUP: u64 = 21;

/// Raises this process's soft limit of open files to the hard one when it is near. It never lowers it.
pub(crate) fn make_room() {
    let limit = open_files::limit();
    // a list that cannot be opened is one too many
    let open = open_files::count().unwrap_or(limit);
    if open.saturating_add(OF_A_NODE) > limit {
        open_files::raise_limit();
    }
}

/// Makes room for the open files of a daemon, whose groups begin all at once: raises the soft limit to the hard one.
///
/// # Errors
/// [`ProtocolError::Descriptors`] when that is not enough.
pub fn make_room_for(groups: usize) -> Result<(), ProtocolError> {
    open_files::raise_limit();
    if open_files::limit() < OF_A_DAEMON + OF_A_GROUP * groups as u64 {
        return Err(ProtocolError::descriptors(format!(
            "begin with {groups} groups"
        )));
    }
    Ok(())
}

//! What a daemon says of itself in files of its folder: its description, which may be large and which every client reads once,
//! that its shared memory is damaged, and which ports of clients it cannot reach.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use crate::doors::exists;
use crate::doors::fs;
use crate::doors::system::files::private;
use crate::presence::paths::DaemonPaths;
use crate::{Description, ProtocolError};

/// Longest description that a client reads [bytes].
const BYTES_MAX: u64 = 1 << 28;
/// Longest reason that a client reads [bytes].
const REASON_MAX: u64 = 4096;

fn path(paths: &DaemonPaths, session: u64) -> PathBuf {
    paths
        .shared_folder()
        .join(format!("{session:016x}.description"))
}

/// Writes the description of a run.
pub(crate) fn write(paths: &DaemonPaths, description: &Description) -> Result<(), ProtocolError> {
    let text = serde_json::to_vec(description).expect("descriptions are plain data");
    let file = private()
        .create_new(true)
        .open(path(paths, description.session));
    file.and_then(|mut file| file.write_all(&text))
        .map_err(|error| ProtocolError::transport("write the description", error))
}

/// Reads the description of a run.
pub(crate) fn read(paths: &DaemonPaths, session: u64) -> Result<Description, ProtocolError> {
    let path = path(paths, session);
    let failed = |error| ProtocolError::transport("read the description", error);
    let file = private().open(&path).map_err(failed)?;
    let mut text = Vec::new();
    // what is no file has no end
    if file.metadata().map_err(failed)?.is_file() {
        file.take(BYTES_MAX)
            .read_to_end(&mut text)
            .map_err(failed)?;
    }
    parse(&text).ok_or_else(|| ProtocolError::Damaged {
        action: "read the description".to_owned(),
        path: path.display().to_string(),
    })
}

/// A description from its JSON; none where it is damaged, or its counts and ranges do not fit each other.
pub(crate) fn parse(text: &[u8]) -> Option<Description> {
    let description: Description = serde_json::from_slice(text).ok()?;
    description.is_consistent().then_some(description)
}

/// What of shared memory another program has changed.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Damage {
    /// That of the daemon.
    Daemon,
    /// That of a client, while somebody held this lease.
    Lease(u64),
}

/// The file whose presence is that mark. Its name takes longer to make than to look for.
pub(crate) fn mark(paths: &DaemonPaths, session: u64, damage: Damage) -> PathBuf {
    let name = match damage {
        Damage::Daemon => format!("{session:016x}.damaged"),
        Damage::Lease(epoch) => format!("{session:016x}.{epoch}.damaged"),
    };
    paths.shared_folder().join(name)
}

/// Tells clients of a damage.
pub(crate) fn mark_damaged(paths: &DaemonPaths, session: u64, damage: Damage) {
    // one that cannot be notified finds out, or waits for as long as it does
    let _ = private()
        .create(true)
        .truncate(false)
        .open(mark(paths, session, damage));
}

/// Whether the daemon has found a damage. A few microseconds.
pub(crate) fn is_damaged(paths: &DaemonPaths, session: u64, damage: Damage) -> bool {
    exists(&mark(paths, session, damage))
}

/// The file in which the daemon says why it cannot reach a port.
pub(crate) fn unreached(paths: &DaemonPaths, session: u64, port: u128) -> PathBuf {
    // as the transport names what belongs to a port, so that it goes when the port is gone
    let name = format!("{session:016x}_{port}.unreached");
    paths.shared_folder().join(name)
}

/// Tells a client why the daemon cannot reach its port.
pub(crate) fn mark_unreached(
    paths: &DaemonPaths,
    session: u64,
    port: u128,
    reason: &ProtocolError,
) {
    let path = unreached(paths, session, port);
    let unnamed = path.with_extension("unreached_new");
    // without room for the file, the client waits for as long as it does
    if let Ok(mut file) = private().create(true).truncate(true).open(&unnamed) {
        let _ = file.write_all(reason.to_string().as_bytes());
        let _ = fs::rename(unnamed, path);
    }
}

/// Why the daemon cannot reach the port of an [`unreached`] file, where it cannot. A microsecond.
pub(crate) fn why_unreached(path: &Path) -> Option<String> {
    if !exists(path) {
        return None;
    }
    let mut reason = String::new();
    if let Ok(file) = private().open(path) {
        let _ = file.take(REASON_MAX).read_to_string(&mut reason);
    }
    // there was no room for it
    let unknown = || format!("see {}", path.display());
    Some(if reason.is_empty() { unknown() } else { reason })
}

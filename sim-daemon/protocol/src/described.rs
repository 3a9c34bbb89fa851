//! The description of a daemon: a file in its folder, since it may be large and every client reads it once.

use std::io::{Read, Write};
use std::path::PathBuf;

use crate::paths::{DaemonPaths, private};
use crate::{Description, ProtocolError};

/// Longest description that a client reads [bytes].
const BYTES_MAX: u64 = 1 << 28;

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
    serde_json::from_slice(&text).map_err(|_| ProtocolError::Damaged {
        action: "read the description".to_owned(),
        path: path.display().to_string(),
    })
}

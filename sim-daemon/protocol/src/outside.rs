//! What this crate reads of bytes from outside, for tests that give it any bytes: fuzz targets, and `tests/corpora.rs`.
//! Commands and field tables are not here: [`crate::host::Inbox`] and [`crate::Table`] are public anyway.

use crate::presence::paths::presence_of;
use crate::presence::{described, paths::Presence};
use crate::wire::control::{Request, Response};
use crate::{Description, JournalHeader};

fn written(message: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(message).expect("messages are plain data")
}

/// Reads a control request as the daemon does, and writes it as a client does.
///
/// # Errors
/// What the daemon answers.
pub fn request(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let request: Request = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    Ok(written(&request))
}

/// Reads an answer to a control request as a client does, and writes it as the daemon does.
///
/// # Errors
/// What the client reports.
pub fn response(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let response: Response = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    Ok(written(&response))
}

/// Reads a daemon's description as a client does; none where it is damaged.
pub fn description(bytes: &[u8]) -> Option<Description> {
    described::parse(bytes)
}

/// What a lock file of these bytes says of its holder.
pub fn presence(bytes: &[u8]) -> Presence {
    presence_of(bytes)
}

/// Bytes of command or piece, of digests and of arrays in an entry of a journal; none where they do not fit.
pub fn journal_parts(header: &JournalHeader, payload_bytes: usize) -> Option<[usize; 3]> {
    header.parts(payload_bytes)
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    const DAEMON: &str = include_str!("../../../tests/fuzz/corpus/description/daemon.json");

    /// The description of a daemon with one entry changed.
    fn changed(pointer: &str, value: Value) -> Option<Description> {
        let mut daemon: Value = serde_json::from_str(DAEMON).unwrap();
        *daemon.pointer_mut(pointer).unwrap() = value;
        description(daemon.to_string().as_bytes())
    }

    #[test]
    fn a_description_whose_counts_overflow_or_whose_ranges_leave_their_lists_is_damaged() {
        assert!(changed("/worlds", json!(1000)).is_some());
        for (pointer, value) in [
            ("/worlds", json!(u64::MAX)),
            ("/groups", json!(u64::MAX)),
            ("/first_world", json!(u64::MAX)),
            ("/commands/0/columns", json!(u64::MAX)),
            ("/writes/0/columns", json!(1u64 << 62)),
            ("/fields/0/shape", json!([1u64 << 32, 1u64 << 32])),
            ("/known_fields/0/shape", json!([u64::MAX, 2])),
            ("/robots/0/dofs", json!([0, 3])),
            ("/robots/0/coords", json!([2, 1])),
            ("/robots/0/bodies", json!([u64::MAX, u64::MAX])),
            ("/robots/0/actuators", json!([0, 1])),
        ] {
            assert!(changed(pointer, value).is_none(), "{pointer}");
        }
    }
}

//! Shared memory of a daemon: how much it will take, whether that is there, and taking it for certain.

use std::io::ErrorKind;
use std::path::Path;

use crate::doors::fs::{self, OpenOptions};
use crate::doors::system::files::{free_bytes, shared_memory};
use crate::transport::{COMMAND_SLOTS, frame_slots, watch_slots};
use crate::wire::command::command_bytes;
use crate::{Description, Dtype, ProtocolError, Table};

/// What the transport puts before a payload [bytes]: its header, ours, alignment.
const SLOT_HEAD: usize = 256;
/// Everything that does not grow with the worlds: services, connections, control messages.
const FIXED: usize = 4 << 20;

/// Room for a refusal's sentence, whatever the size of a frame [bytes].
const REFUSAL: usize = 2048;

/// Payload of a slot of the controller's service [bytes].
pub(crate) fn slot_bytes(frame: &Table) -> usize {
    frame.total_bytes().max(REFUSAL)
}

/// Bytes of one lease: frames, and the commands that its holder will send.
pub(crate) fn lease_bytes(description: &Description, frame: &Table) -> usize {
    let frames = frame_slots(description.frames_held) * (slot_bytes(frame) + SLOT_HEAD);
    frames + COMMAND_SLOTS * (command_bytes(description) + SLOT_HEAD)
}

/// Bytes of a journal.
pub(crate) fn journal_bytes(slot: usize, slots: usize) -> usize {
    slots * (slot + SLOT_HEAD)
}

/// What observers see of a frame: the first worlds, and last their state.
pub(crate) fn watch_table(description: &Description, frame: &Table) -> Table {
    let seen = frame.rows().iter().map(|row| {
        let mut shape = row.shape.clone();
        shape[0] = shape[0].min(description.watch_worlds);
        (row.name.clone(), row.dtype, shape, 0)
    });
    let state = vec![description.watch_state_bytes as usize];
    Table::lay_out(seen.chain([("state".to_owned(), Dtype::U8, state, 0)]))
}

/// Bytes of everything.
pub(crate) fn all_bytes(description: &Description, frame: &Table) -> usize {
    let watch = watch_slots(description.frames_held)
        * (watch_table(description, frame).total_bytes() + SLOT_HEAD);
    lease_bytes(description, frame) + watch + FIXED
}

/// Bytes that the daemon's process takes itself for commands: the copy of the last one, its mask.
pub(crate) fn own_bytes(description: &Description) -> usize {
    command_bytes(description) + description.worlds
}

/// What can still be taken [bytes].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Free {
    /// Of the file system that holds shared memory.
    shared: u64,
    /// Of the machine and of our control groups, whichever has least; shared memory counts there, too.
    pub(crate) memory: u64,
}

/// Refuses when `shared` bytes, and 5 % for what is not counted, do not fit, or not together with `process_bytes` of
/// other memory: past the end, shared memory kills instead of failing.
pub(crate) fn check(
    free: Free,
    shared: usize,
    process_bytes: u64,
    what: &str,
) -> Result<(), ProtocolError> {
    let needed = shared as u64 + shared as u64 / 20;
    if needed > free.shared {
        return Err(ProtocolError::SharedMemory {
            path: shared_memory().to_owned(),
            free: free.shared,
            needed,
            what: what.to_owned(),
        });
    }
    let needed = needed.saturating_add(process_bytes);
    if needed > free.memory {
        return Err(ProtocolError::Memory {
            free: free.memory,
            needed,
            what: what.to_owned(),
        });
    }
    Ok(())
}

/// What can be taken now.
pub(crate) fn free() -> Free {
    Free {
        shared: free_bytes(Path::new(shared_memory())),
        memory: crate::doors::system::memory::available(),
    }
}

/// Takes the pages of a journal's memory now, so that nobody else can: later writes cannot fail.
pub(crate) fn reserve(folder: &Path, port: u128, what: &str) -> Result<(), ProtocolError> {
    let failed =
        |error: &dyn std::fmt::Debug| ProtocolError::transport(format!("reserve {what}"), error);
    let ending = format!("_{port}.data");
    let is_ours = |name: &str| name.ends_with(&ending);
    let path = fs::read_dir(folder)
        .map_err(|error| failed(&error))?
        .flatten()
        .find(|entry| entry.file_name().to_str().is_some_and(is_ours))
        .ok_or_else(|| failed(&format!("no file *{ending}")))?
        .path();
    let file = OpenOptions::new()
        .write(true)
        .open(&path)
        .map_err(|error| failed(&error))?;
    let needed = file.metadata().map_err(|error| failed(&error))?.len();
    crate::doors::system::storage::reserve(&file, needed).map_err(|error| match error.kind() {
        ErrorKind::StorageFull => full(needed, what),
        _ => failed(&error),
    })
}

/// The file system of shared memory has no room for what was asked of it.
pub(crate) fn full(needed: u64, what: &str) -> ProtocolError {
    ProtocolError::SharedMemory {
        path: shared_memory().to_owned(),
        free: free().shared,
        needed,
        what: what.to_owned(),
    }
}

/// Size of all files in a daemon's folder [bytes]; for tests and the log.
pub(crate) fn used(folder: &Path) -> u64 {
    let Ok(entries) = fs::read_dir(folder) else {
        return 0;
    };
    let lengths = entries.flatten().filter_map(|entry| {
        let status = entry.metadata().ok()?;
        status.is_file().then_some(status.len())
    });
    lengths.sum()
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::*;

    #[test]
    fn what_fits_each_memory_alone_but_not_both_together_is_refused() {
        let free = Free {
            shared: 1000,
            memory: 1500,
        };
        assert!(check(free, 900, 555, "worlds").is_ok());
        let Err(ProtocolError::Memory {
            free: left, needed, ..
        }) = check(free, 900, 556, "worlds")
        else {
            panic!("945 shared and 556 of our own are more than 1500");
        };
        assert_eq!((left, needed), (1500, 1501));
        let shared = check(free, 960, 0, "worlds");
        assert!(matches!(
            shared,
            Err(ProtocolError::SharedMemory {
                free: 1000,
                needed: 1008,
                ..
            })
        ));
        let overflowing = check(free, 900, u64::MAX, "worlds");
        assert!(matches!(overflowing, Err(ProtocolError::Memory { .. })));
    }
}

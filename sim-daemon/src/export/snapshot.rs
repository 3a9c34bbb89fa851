//! Snapshots as files: written as a whole or not at all, and read only when there is room.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

use sim_engine::simulation::Simulation;
use sim_model::files::{self, FileError};
use sim_protocol::RefusalKind;
use sim_protocol::host::{Inbox, free_memory};
use sim_system::files::is_nameless;
use sim_system::process;

use crate::export::refusal::{Refusal, refusal};
use crate::output;

const MB: u64 = 1 << 20;

/// Writes all worlds into the file that the command names.
pub(crate) fn save(simulation: &Simulation, inbox: &Inbox) -> Result<(), Refusal> {
    let path = path(inbox)?;
    let refuse = |problem: String| refused(path, &problem);
    let Some(folder) = path.parent() else {
        return Err(refuse("is no file; give the path of one".to_owned()));
    };
    // a device or a pipe would be replaced by a file
    if fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        return Err(refuse(
            "is there and no file; give the path of one".to_owned(),
        ));
    }
    // the bytes, and the file where it lies in memory too
    check_room(2 * simulation.snapshot_bytes(simulation.worlds()) as u64).map_err(refuse)?;
    let bytes = simulation.snapshot();
    if let Some(lost) = simulation.lost() {
        return Err(refusal(RefusalKind::Backend, lost.to_string()));
    }
    if let Some(mut file) = nameless(path) {
        let written = file.write_all(&bytes);
        return written.map_err(|problem| refuse(format!("cannot be written: {problem}")));
    }
    output::write(path, &bytes).map_err(|problem| {
        refuse(match problem.kind() {
            ErrorKind::NotFound => {
                format!("there is no folder {}; make it first", folder.display())
            }
            _ => format!("cannot be written: {problem}"),
        })
    })
}

/// An empty file without a name, which another process holds open for us: `/proc/PID/fd/N`. It goes with that process.
///
/// A process that gave up waiting may have another file at that number by now: one that holds something, or has a name.
fn nameless(path: &Path) -> Option<File> {
    if !process::is_open_file_of_another(path) || !fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let file = OpenOptions::new().write(true).open(path).ok()?;
    let status = file.metadata().ok()?;
    (status.is_file() && is_nameless(&status) && status.len() == 0).then_some(file)
}

/// Sets the worlds of the mask to those of the file that the command names, or to one of them.
pub(crate) fn restore(
    simulation: &mut Simulation,
    inbox: &Inbox,
    mask: Option<&[bool]>,
) -> Result<(), Refusal> {
    let from_world = match inbox.from_world() {
        None => None,
        Some(&[world]) => Some(usize::try_from(world).unwrap_or(usize::MAX)),
        Some(worlds) => {
            let problem = format!("from_world has {} entries; give one", worlds.len());
            return Err(refusal(RefusalKind::Malformed, problem));
        }
    };
    let path = path(inbox)?;
    let bytes = read(path).map_err(|problem| refused(path, &problem))?;
    let restored = simulation.restore(&bytes, mask, from_world);
    restored.map_err(|error| refused(path, &error.to_string()))
}

/// The bytes of a file.
fn read(path: &Path) -> Result<Vec<u8>, String> {
    let failed = |problem: std::io::Error| format!("cannot be read: {problem}");
    let file = files::open(path).map_err(|error| match error {
        FileError::NotAFile => "is no file; give the file of a snapshot".to_owned(),
        error => error.to_string(),
    })?;
    let length = file.metadata().map_err(failed)?.len();
    check_room(length)?;
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Refuses what would not fit: memory that is missing kills instead of failing.
pub(crate) fn check_room(needed: u64) -> Result<(), String> {
    let free = free_memory();
    if needed > free {
        return Err(format!(
            "needs {} MB of memory and {} MB are available; end other programs",
            needed.div_ceil(MB),
            free / MB
        ));
    }
    Ok(())
}

/// The path that a command names.
pub(crate) fn path(inbox: &Inbox) -> Result<&Path, Refusal> {
    let malformed = |problem: &str| refusal(RefusalKind::Malformed, problem.to_owned());
    let path = inbox.path().ok_or_else(|| malformed("path is missing"))?;
    let path = std::str::from_utf8(path).map_err(|_| malformed("path is not UTF-8"))?;
    if !Path::new(path).is_absolute() {
        let problem = "is relative, and the daemon runs elsewhere; give an absolute path";
        return Err(refused(Path::new(path), problem));
    }
    Ok(Path::new(path))
}

fn refused(path: &Path, problem: &str) -> Refusal {
    refusal(
        RefusalKind::Snapshot,
        format!("{}: {problem}", path.display()),
    )
}

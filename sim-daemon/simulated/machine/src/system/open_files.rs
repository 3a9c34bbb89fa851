//! The limit of open files of this process.

use std::io;
use std::path::Path;

use crate::fs::code::EMFILE;
use crate::fs::{File, read_dir};
use crate::world::{step, with};

/// The same on every system, and not of a process: no file of the whole machine can be opened.
const ENFILE: i32 = 23;

/// Files that this process may have open.
pub fn limit() -> u64 {
    step("asks for its limit of open files");
    with(|world| world.system.limit(world.process()))
}

/// Files that this process has open; none where that cannot be counted.
pub fn count() -> Option<u64> {
    // the folder that lists them is one of them
    let folder = read_dir(Path::new("/")).ok()?;
    let count = with(|world| world.files.count(world.process()));
    drop(folder);
    Some(count)
}

/// Raises the limit as far as this process may.
pub fn raise_limit() {
    step("raises its limit of open files");
    with(|world| {
        let (process, hard) = (world.process(), world.system.hard);
        world.system.limits.insert(process, hard);
    });
}

/// Whether a call failed since too many files are open.
pub fn is_exhausted(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(EMFILE | ENFILE))
}

/// Opens a file and closes it.
///
/// # Errors
/// Why this process can open no file now.
pub fn try_one() -> io::Result<()> {
    File::open("/").map(drop)
}

/// For a scenario: how many files a process may have open, before and after it raises the limit.
pub fn set_limits(soft: u64, hard: u64) {
    with(|world| (world.system.soft, world.system.hard) = (soft, hard));
}

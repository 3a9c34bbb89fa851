//! Files that get a name when they are complete: a process that is killed before leaves nothing.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use rustix::fs::{AtFlags, CWD, FallocateFlags, OFlags, fallocate, linkat};

use crate::unix::files::uninterrupted;

/// What one call takes of a file: short enough that signals, which undo a call, leave one to end [bytes].
const TAKEN_AT_ONCE: u64 = 16 << 20;

/// A file of this user without a name.
#[derive(Debug)]
pub struct NewFile(File);

impl NewFile {
    /// Makes a file of so many bytes in a folder, and takes its pages now, so that nobody else can: all of them, or so many
    /// bytes at each end.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn create(folder: &Path, bytes: u64, ends: Option<u64>) -> io::Result<NewFile> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).mode(0o600);
        let flags = OFlags::TMPFILE.bits() as i32;
        let file = options.custom_flags(flags).open(folder)?;
        match ends {
            None => take(&file, 0, bytes)?,
            Some(end) => {
                take(&file, 0, end)?;
                take(&file, bytes - end, end)?;
            }
        }
        Ok(NewFile(file))
    }

    /// The file.
    pub fn file(&self) -> &File {
        &self.0
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// Those of the system; the kind is `AlreadyExists` where another file has the name.
    pub fn publish(&self, path: &Path) -> io::Result<()> {
        let made = format!("/proc/self/fd/{}", self.0.as_raw_fd());
        linkat(CWD, made, CWD, path, AtFlags::SYMLINK_FOLLOW)?;
        Ok(())
    }
}

/// Takes the pages of a file now, so that later writes cannot fail.
///
/// # Errors
/// Those of the system; the kind is `StorageFull` where the pages are not there.
pub fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    take(file, 0, bytes)
}

fn take(file: &File, first: u64, bytes: u64) -> io::Result<()> {
    let end = first + bytes;
    for start in (first..end).step_by(TAKEN_AT_ONCE as usize) {
        let length = TAKEN_AT_ONCE.min(end - start);
        uninterrupted(|| Ok(fallocate(file, FallocateFlags::empty(), start, length)?))?;
    }
    Ok(())
}

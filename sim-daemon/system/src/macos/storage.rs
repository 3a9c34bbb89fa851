//! How new files take their pages and get their names.

use std::fs;
use std::io;
use std::path::Path;

use rustix::fs::{FallocateFlags, fallocate};

use super::files::private;
pub use crate::portable::storage::{NewFile, reserve};
use crate::unix::files::uninterrupted;

impl NewFile {
    /// Makes a file of so many bytes in a folder, and takes their pages now, so that nobody else can: all of them, since this
    /// system takes what follows the end of a file, and not a part of it.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn create(folder: &Path, bytes: u64, _ends: Option<u64>) -> io::Result<NewFile> {
        let new = NewFile::empty(folder, &mut private())?;
        uninterrupted(|| Ok(fallocate(new.file(), FallocateFlags::empty(), 0, bytes)?))?;
        Ok(new)
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// Those of the system; the kind is `AlreadyExists` where another file has the name.
    pub fn publish(&self, path: &Path) -> io::Result<()> {
        // renaming would replace the other file; the first name goes when this is dropped
        fs::hard_link(&self.path, path)
    }
}

//! Files that get a name when they are complete. Until then they have one that nobody looks for.

use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};

use rustix::fs::{FallocateFlags, fallocate};

use super::files::private;

/// A file of this user that is not complete. A process that is killed here leaves the file; it goes with its folder.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    path: PathBuf,
}

impl NewFile {
    /// Makes a file of so many bytes in a folder, and takes their pages now, so that nobody else can: all of them, since this
    /// system takes what follows the end of a file, and not a part of it.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn create(folder: &Path, bytes: u64, _ends: Option<u64>) -> io::Result<NewFile> {
        let number = RandomState::new().build_hasher().finish();
        let path = folder.join(format!(".new-{number:016x}"));
        let file = private().create_new(true).open(&path)?;
        let new = NewFile { file, path };
        fallocate(&new.file, FallocateFlags::empty(), 0, bytes)?;
        Ok(new)
    }

    /// The file.
    pub fn file(&self) -> &File {
        &self.file
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

impl Drop for NewFile {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// Takes the pages of a file, which [`NewFile::create`] has done.
///
/// # Errors
/// None here.
pub fn reserve(_file: &File, _bytes: u64) -> io::Result<()> {
    Ok(())
}

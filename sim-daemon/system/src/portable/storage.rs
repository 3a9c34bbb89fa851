//! Files that get a name when they are complete. Until then they have one that nobody looks for.

use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};

/// A file of this user that is not complete. A process that is killed here leaves the file; it goes with its folder.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    pub(crate) path: PathBuf,
}

impl NewFile {
    /// Makes an empty file in a folder.
    pub(crate) fn empty(folder: &Path, options: &mut OpenOptions) -> io::Result<NewFile> {
        let number = RandomState::new().build_hasher().finish();
        let path = folder.join(format!(".new-{number:016x}"));
        let file = options.create_new(true).open(&path)?;
        Ok(NewFile { file, path })
    }

    /// The file.
    pub fn file(&self) -> &File {
        &self.file
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

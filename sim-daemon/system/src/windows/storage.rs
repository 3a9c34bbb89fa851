//! Files that get a name when they are complete. Until then they have one that nobody looks for.

use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::os::windows::ffi::OsStrExt;
use std::os::windows::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use windows_sys::Win32::Storage::FileSystem::{FILE_ATTRIBUTE_TEMPORARY, MoveFileExW};

use super::files::private;

/// A file of this user that is not complete. A process that is killed here leaves the file; it goes with its folder.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    path: PathBuf,
}

impl NewFile {
    /// Makes a file of so many bytes in a folder, with all of its pages.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn create(folder: &Path, bytes: u64, _ends: Option<u64>) -> io::Result<NewFile> {
        let number = RandomState::new().build_hasher().finish();
        let path = folder.join(format!(".new-{number:016x}"));
        let mut options = private();
        // the system writes pages of such a file to the disk only when memory is short
        options
            .create_new(true)
            .attributes(FILE_ATTRIBUTE_TEMPORARY);
        let file = options.open(&path)?;
        let new = NewFile { file, path };
        new.file.set_len(bytes)?;
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
        let wide =
            |path: &Path| -> Vec<u16> { path.as_os_str().encode_wide().chain([0]).collect() };
        // a file that is mapped may be renamed, but not removed
        // SAFETY: both names end with zero. Without flags the call replaces nothing.
        match unsafe { MoveFileExW(wide(&self.path).as_ptr(), wide(path).as_ptr(), 0) } {
            0 => Err(io::Error::last_os_error()),
            _ => Ok(()),
        }
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

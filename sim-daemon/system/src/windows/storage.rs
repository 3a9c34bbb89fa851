//! How new files take their pages and get their names.

use std::io;
use std::os::windows::ffi::OsStrExt;
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;

use windows_sys::Win32::Storage::FileSystem::{FILE_ATTRIBUTE_TEMPORARY, MoveFileExW};

use super::files::private;
pub use crate::portable::storage::{NewFile, reserve};

impl NewFile {
    /// Makes a file of so many bytes in a folder, with all of its pages.
    ///
    /// # Errors
    /// Those of the system; the kind is `StorageFull` where the pages are not there.
    pub fn create(folder: &Path, bytes: u64, _ends: Option<u64>) -> io::Result<NewFile> {
        // the system writes pages of such a file to the disk only when memory is short
        let new = NewFile::empty(folder, private().attributes(FILE_ATTRIBUTE_TEMPORARY))?;
        new.file().set_len(bytes)?;
        Ok(new)
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

//! The limit of open files of this process, which this system does not have.

use std::io;

use windows_sys::Win32::Foundation::ERROR_TOO_MANY_OPEN_FILES;

/// Files that this process may have open.
pub fn limit() -> u64 {
    u64::MAX
}

/// Files that this process has open; none where that cannot be counted.
pub fn count() -> Option<u64> {
    None
}

/// Raises the limit as far as this process may.
pub fn raise_limit() {}

/// Whether a call failed since too many files are open.
pub fn is_exhausted(error: &io::Error) -> bool {
    error.raw_os_error() == Some(ERROR_TOO_MANY_OPEN_FILES as i32)
}

/// Opens a file and closes it, which a process here always can.
///
/// # Errors
/// None here.
pub fn try_one() -> io::Result<()> {
    Ok(())
}

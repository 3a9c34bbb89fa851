//! Other processes.

use std::io;
use std::os::windows::io::{AsRawHandle, FromRawHandle, OwnedHandle};
use std::sync::OnceLock;

use windows_sys::Win32::Foundation::{ERROR_ACCESS_DENIED, WAIT_TIMEOUT};
use windows_sys::Win32::System::Threading::{
    OpenProcess, PROCESS_SYNCHRONIZE, WaitForSingleObject,
};

pub use crate::portable::process::{
    age, is_open_file_of_another, memory, memory_shared, missing, threads,
};

/// Whether there is a process of this number, which has not ended.
pub fn exists(pid: u32) -> bool {
    match open(pid) {
        Ok(process) => runs(&process),
        // one of another user is there
        Err(error) => error.raw_os_error() == Some(ERROR_ACCESS_DENIED as i32),
    }
}

/// Whether a process is gone. `beside` is another process, which may have other numbers for processes in containers: there
/// are none here.
pub fn is_gone(pid: u32, _beside: u32) -> bool {
    !exists(pid)
}

/// Whether `parent`, which started this process, has ended.
pub fn is_orphan(parent: u32) -> bool {
    // while its handle is open, no other process gets its number
    static PARENT: OnceLock<Option<OwnedHandle>> = OnceLock::new();
    let handle = PARENT.get_or_init(|| open(parent).ok());
    !handle.as_ref().is_some_and(runs)
}

fn open(pid: u32) -> io::Result<OwnedHandle> {
    // SAFETY: the call has no preconditions.
    let handle = unsafe { OpenProcess(PROCESS_SYNCHRONIZE, 0, pid) };
    if handle.is_null() {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the handle was opened just now, and nobody else has it.
    Ok(unsafe { OwnedHandle::from_raw_handle(handle) })
}

fn runs(process: &OwnedHandle) -> bool {
    // SAFETY: the handle is open.
    unsafe { WaitForSingleObject(process.as_raw_handle(), 0) == WAIT_TIMEOUT }
}

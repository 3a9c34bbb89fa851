//! Files and folders of one user, and locks on them.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io;
use std::os::windows::ffi::OsStrExt;
use std::os::windows::fs::FileExt;
use std::os::windows::io::AsRawHandle;
use std::path::{Path, PathBuf};
use std::ptr::null_mut;
use std::sync::OnceLock;
use std::time::Duration;

use windows_sys::Win32::Foundation::{
    ERROR_IO_PENDING, ERROR_LOCK_VIOLATION, ERROR_SHARING_VIOLATION,
};
use windows_sys::Win32::Storage::FileSystem::{
    GetDiskFreeSpaceExW, LOCKFILE_EXCLUSIVE_LOCK, LOCKFILE_FAIL_IMMEDIATELY, LockFileEx,
    UnlockFileEx,
};
use windows_sys::Win32::System::IO::OVERLAPPED;

/// Where the locked byte of a file is: no file has so many, so a lock keeps nobody from reading.
const LOCKED: u32 = 1 << 30;
/// Longest folder that leaves room for the names of files in it [bytes].
const FOLDER_MAX: usize = 120;

/// What to do when files cannot be made in the folder of shared memory.
pub const SHARED_MEMORY_CURE: &str = "frames go through the temporary folder; set TEMP to one that is writable, \
     with fewer than 120 characters, all of them ASCII";

/// The folder of files that processes map: the user's temporary folder.
pub fn shared_memory() -> &'static str {
    static FOLDER: OnceLock<String> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir();
        let folder = folder.to_string_lossy();
        folder.trim_end_matches('\\').to_owned()
    })
}

/// The name of a folder of this user in [`shared_memory`], which is the user's own already.
pub fn own_folder_name() -> String {
    "tightloop".to_owned()
}

/// How a file of this user is opened.
pub fn private() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    options
}

/// Lets a file that these options make be read by its user only, as its folder has it.
pub fn make_private(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Makes a folder, and those around it.
///
/// # Errors
/// Those of the system.
pub fn make_private_folder(path: &Path) -> io::Result<()> {
    fs::create_dir_all(path)
}

/// The absolute path of a file or folder that is there, as users write it.
///
/// # Errors
/// Those of the system.
pub fn absolute(path: &Path) -> io::Result<PathBuf> {
    std::path::absolute(path)
}

/// Whether a folder could not be made since somebody else makes or removes it right now.
pub fn is_passing(error: &io::Error) -> bool {
    use io::ErrorKind::{AlreadyExists, NotFound, PermissionDenied};
    matches!(error.kind(), NotFound | AlreadyExists | PermissionDenied)
        || error.raw_os_error() == Some(ERROR_SHARING_VIOLATION as i32)
}

/// Why others could change what is in a folder; this system has no modes that would tell.
pub fn exposed(_folder: &Metadata) -> Option<String> {
    None
}

/// Whether a file belongs to the user of this process: those that a user can open here do.
pub fn is_own(_file: &Metadata) -> bool {
    true
}

/// Takes a folder of this user from everybody else, who do not have it.
pub fn close_to_others(_folder: &Path) {}

/// Whether the owner may only write a file; there are no such modes here.
pub fn is_write_only(_file: &Metadata) -> bool {
    false
}

/// Whether a file has no name any more; there are no such files here.
pub fn is_nameless(_file: &Metadata) -> bool {
    false
}

/// Whether a path still names an open file.
///
/// # Errors
/// Those of the system.
pub fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let handle = same_file::Handle::from_file(file.try_clone()?)?;
    Ok(same_file::Handle::from_path(path).is_ok_and(|there| there == handle))
}

/// Reads from a place of a file that others may hold a lock of.
///
/// # Errors
/// Those of the system.
pub fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    file.seek_read(bytes, at)
}

/// Writes to a place of a file.
///
/// # Errors
/// Those of the system.
pub fn write_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
    let mut written = 0;
    while written < bytes.len() {
        match file.seek_write(&bytes[written..], at + written as u64)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            more => written += more,
        }
    }
    Ok(())
}

/// Takes the lock of a file if nobody has it, and says whether it did. The lock ends with the file.
///
/// # Errors
/// Those of the system.
pub fn try_lock(file: &File) -> io::Result<bool> {
    lock(file, LOCKFILE_EXCLUSIVE_LOCK)
}

/// Takes a share of the lock if nobody has it for himself, and says whether it did.
///
/// # Errors
/// Those of the system.
pub fn try_lock_shared(file: &File) -> io::Result<bool> {
    lock(file, 0)
}

/// Gives the lock back.
///
/// # Errors
/// Those of the system.
pub fn unlock(file: &File) -> io::Result<()> {
    let mut place = locked();
    // SAFETY: the handle is open, and the structure is ours and outlives the call, which does not wait.
    match unsafe { UnlockFileEx(file.as_raw_handle(), 0, 1, 0, &raw mut place) } {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

fn lock(file: &File, how: u32) -> io::Result<bool> {
    let (mut place, how) = (locked(), how | LOCKFILE_FAIL_IMMEDIATELY);
    // SAFETY: as above.
    if unsafe { LockFileEx(file.as_raw_handle(), how, 0, 1, 0, &raw mut place) } != 0 {
        return Ok(true);
    }
    let error = io::Error::last_os_error();
    let is_taken = |code| [ERROR_LOCK_VIOLATION, ERROR_IO_PENDING].contains(&(code as u32));
    match error.raw_os_error().is_some_and(is_taken) {
        true => Ok(false),
        false => Err(error),
    }
}

/// The byte that a lock covers.
fn locked() -> OVERLAPPED {
    let mut place = OVERLAPPED::default();
    place.Anonymous.Anonymous.OffsetHigh = LOCKED;
    place
}

/// The bytes that stand for a path in a file.
pub fn path_to_bytes(path: &Path) -> Vec<u8> {
    path.to_string_lossy().into_owned().into_bytes()
}

/// The path that such bytes stand for; none for what is no path.
pub fn path_from_bytes(bytes: &[u8]) -> Option<PathBuf> {
    str::from_utf8(bytes).ok().map(PathBuf::from)
}

/// Opens what is written piece by piece.
///
/// # Errors
/// Those of the system.
pub fn open_to_write(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    options.open(path)
}

/// Why the transport cannot use [`shared_memory`], if it cannot: it opens files by names of single bytes.
pub fn transport_problem() -> Option<&'static str> {
    let folder = shared_memory();
    (!folder.is_ascii() || folder.len() >= FOLDER_MAX)
        .then_some("its name is too long, or has characters outside ASCII")
}

/// What tells names apart that name one file: the system ignores case.
pub fn folded(name: &str) -> String {
    name.to_lowercase()
}

/// Whether this user may make files in a folder.
pub fn is_writable(folder: &Path) -> bool {
    fs::metadata(folder).is_ok_and(|folder| !folder.permissions().readonly())
        && transport_problem().is_none()
}

/// Bytes free on the file system of a folder; 0 where that cannot be asked.
pub fn free_bytes(folder: &Path) -> u64 {
    let name: Vec<u16> = folder.as_os_str().encode_wide().chain([0]).collect();
    let mut free = 0;
    // SAFETY: the name ends with zero, and the place of the result is ours.
    let is_known =
        unsafe { GetDiskFreeSpaceExW(name.as_ptr(), &raw mut free, null_mut(), null_mut()) };
    if is_known == 0 { 0 } else { free }
}

/// Waits until a socket can be read. Returns `None`, since the transport numbers its own descriptors here.
///
/// # Safety
/// None is needed here.
///
/// # Errors
/// None here.
pub unsafe fn wait_readable(_descriptor: i32, _timeout: Duration) -> Option<io::Result<bool>> {
    None
}

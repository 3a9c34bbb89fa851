//! Files and folders of one user, and locks on them.

use std::ffi::OsString;
use std::fs::{self, DirBuilder, File, Metadata, OpenOptions, Permissions, TryLockError};
use std::io;
use std::os::fd::BorrowedFd;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Access, OFlags, access, fcntl_getfl, fcntl_setfl, statvfs};
use rustix::io::Errno;
use rustix::time::Timespec;

/// The name of a folder of this user in the folder of shared memory.
pub fn own_folder_name() -> String {
    format!("tightloop-{}", rustix::process::getuid().as_raw())
}

/// How a file of this user is opened, made with mode 0600, and not through a link.
pub fn private() -> OpenOptions {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let mut options = OpenOptions::new();
    options.read(true).write(true).mode(0o600);
    options.custom_flags(flags.bits() as i32);
    options
}

/// Lets a file that these options make be read by its user only.
pub fn make_private(options: &mut OpenOptions) -> &mut OpenOptions {
    options.mode(0o600)
}

/// Makes a folder that this user alone may use, and those around it.
///
/// # Errors
/// Those of the system.
pub fn make_private_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// The absolute path of a file or folder that is there, without links.
///
/// # Errors
/// Those of the system.
pub fn absolute(path: &Path) -> io::Result<PathBuf> {
    fs::canonicalize(path)
}

/// Whether a folder could not be made since somebody else makes or removes it right now.
pub fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::NotFound | io::ErrorKind::AlreadyExists
    )
}

/// Why others could change what is in a folder, if they can.
pub fn exposed(folder: &Metadata) -> Option<String> {
    if !is_own(folder) {
        return Some(format!("it belongs to user {}", folder.uid()));
    }
    (folder.mode() & 0o022 != 0).then(|| "others may write in it".to_owned())
}

/// Whether a file belongs to the user of this process.
pub fn is_own(file: &Metadata) -> bool {
    file.uid() == rustix::process::geteuid().as_raw()
}

/// Takes a folder of this user from everybody else. One that cannot be changed stays as it is.
pub fn close_to_others(folder: &Path) {
    let _ = fs::set_permissions(folder, Permissions::from_mode(0o700));
}

/// Whether nobody but the owner may read or write a file, and the owner may only write it.
pub fn is_write_only(file: &Metadata) -> bool {
    file.mode() & 0o777 == 0o200
}

/// Whether a file has no name any more.
pub fn is_nameless(file: &Metadata) -> bool {
    file.nlink() == 0
}

/// Whether a path still names an open file.
///
/// # Errors
/// Those of the system.
pub fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let (metadata, there) = (file.metadata()?, fs::metadata(path));
    Ok(there.is_ok_and(|there| (there.ino(), there.dev()) == (metadata.ino(), metadata.dev())))
}

/// Reads from a place of a file that others may hold a lock of.
///
/// # Errors
/// Those of the system.
pub fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    uninterrupted(|| file.read_at(bytes, at))
}

/// Writes to a place of a file.
///
/// # Errors
/// Those of the system.
pub fn write_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
    file.write_all_at(bytes, at)
}

/// Takes the lock of a file if nobody has it, and says whether it did. The lock ends with the file.
///
/// # Errors
/// Those of the system.
pub fn try_lock(file: &File) -> io::Result<bool> {
    uninterrupted(|| taken(file.try_lock()))
}

/// Takes a share of the lock if nobody has it for himself, and says whether it did.
///
/// # Errors
/// Those of the system.
pub fn try_lock_shared(file: &File) -> io::Result<bool> {
    uninterrupted(|| taken(file.try_lock_shared()))
}

/// Gives the lock back.
///
/// # Errors
/// Those of the system.
pub fn unlock(file: &File) -> io::Result<()> {
    uninterrupted(|| file.unlock())
}

/// Repeats a call of the system that a signal handler interrupts; the standard library does so for most others.
pub(crate) fn uninterrupted<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match call() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

fn taken(lock: Result<(), TryLockError>) -> io::Result<bool> {
    match lock {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// The bytes that stand for a path in a file.
pub fn path_to_bytes(path: &Path) -> Vec<u8> {
    path.as_os_str().as_bytes().to_vec()
}

/// The path that such bytes stand for; none for what is no path.
pub fn path_from_bytes(bytes: &[u8]) -> Option<PathBuf> {
    Some(OsString::from_vec(bytes.to_vec()).into())
}

/// Opens what is written piece by piece. A pipe without a reader is an error, and not waited for.
///
/// # Errors
/// Those of the system.
pub fn open_to_write(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
    let file = options.custom_flags(flags.bits() as i32).open(path)?;
    // writes to a slow reader do wait
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(file)
}

/// Why the transport cannot use the folder of shared memory, if it cannot.
pub fn transport_problem() -> Option<&'static str> {
    None
}

/// Whether this user may make files in a folder.
pub fn is_writable(folder: &Path) -> bool {
    access(folder, Access::WRITE_OK | Access::EXEC_OK).is_ok()
}

/// Bytes free on the file system of a folder; 0 where that cannot be asked.
pub fn free_bytes(folder: &Path) -> u64 {
    statvfs(folder).map_or(0, |status| status.f_bavail * status.f_frsize)
}

/// Waits until a socket can be read or the time is over, and says whether it can. A signal ends the wait early. Returns
/// `None` where the transport numbers its own descriptors.
///
/// # Safety
/// The descriptor stays open meanwhile.
///
/// # Errors
/// Those of the system.
pub unsafe fn wait_readable(descriptor: i32, timeout: Duration) -> Option<io::Result<bool>> {
    // SAFETY: as the caller proves.
    let socket = unsafe { BorrowedFd::borrow_raw(descriptor) };
    let timeout = Timespec {
        tv_sec: timeout.as_secs() as i64,
        tv_nsec: timeout.subsec_nanos().into(),
    };
    Some(
        match poll(&mut [PollFd::new(&socket, PollFlags::IN)], Some(&timeout)) {
            Ok(0) | Err(Errno::INTR) => Ok(false),
            Ok(_) => Ok(true),
            Err(error) => Err(error.into()),
        },
    )
}

//! Files and folders of one user, and locks on them.

use std::ffi::OsString;
use std::io;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Component, Path, PathBuf};
use std::time::Duration;

use crate::fs::{File, Files, Lock, Metadata, OpenOptions, SHARED_MEMORY, call, make_folders};
use crate::world::{step, system_call, with};

/// Room of the file systems whose room never ends [bytes].
const ROOM: u64 = 1 << 40;

/// What to do when files cannot be made in the folder of shared memory.
pub const SHARED_MEMORY_CURE: &str = "frames go through /dev/shm, which must be writable for this user: mount memory there, by \
                                      `mount -t tmpfs -o mode=1777 tmpfs /dev/shm`";

/// The folder of shared memory: a file system in memory.
pub const fn shared_memory() -> &'static str {
    SHARED_MEMORY
}

/// What tells names apart that name one file.
pub fn folded(name: &str) -> String {
    name.to_owned()
}

/// The name of a folder of this user in the folder of shared memory.
pub fn own_folder_name() -> String {
    "tightloop-1000".to_owned()
}

/// How a file of this user is opened, made with mode 0600.
pub fn private() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).write(true).mode(0o600);
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
    make_folders(path, 0o700)
}

/// The absolute path of a file or folder that is there.
///
/// # Errors
/// Those of the system.
pub fn absolute(path: &Path) -> io::Result<PathBuf> {
    let door = format_args!("asks where {} is", path.display());
    call(door, |files: &mut Files| files.is_shared(path))?;
    let mut absolute = PathBuf::from("/");
    for part in path.components() {
        match part {
            Component::Normal(name) => absolute.push(name),
            Component::ParentDir => drop(absolute.pop()),
            _ => {}
        }
    }
    Ok(absolute)
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
    (folder.mode & 0o022 != 0).then(|| "others may write in it".to_owned())
}

/// Whether a file belongs to the user of this process: there is no other one.
pub fn is_own(_file: &Metadata) -> bool {
    true
}

/// Takes a folder of this user from everybody else. One that cannot be changed stays as it is.
pub fn close_to_others(folder: &Path) {
    let door = format_args!("closes folder {} to others", folder.display());
    let _ = call(door, |files: &mut Files| files.set_mode(folder, 0o700));
}

/// Whether nobody but the owner may read or write a file, and the owner may only write it.
pub fn is_write_only(file: &Metadata) -> bool {
    file.mode & 0o777 == 0o200
}

/// Whether a file has no name any more.
pub fn is_nameless(file: &Metadata) -> bool {
    file.links == 0
}

/// Whether a path still names an open file.
///
/// # Errors
/// Those of the system.
pub fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let (metadata, there) = (file.metadata()?, crate::fs::metadata(path));
    Ok(there.is_ok_and(|there| there.inode == metadata.inode))
}

/// Reads from a place of a file.
///
/// # Errors
/// Those of the system.
pub fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    file.read_at(bytes, at)
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
    file.try_lock(Lock::Exclusive)
}

/// Takes a share of the lock if nobody has it for himself, and says whether it did.
///
/// # Errors
/// Those of the system.
pub fn try_lock_shared(file: &File) -> io::Result<bool> {
    file.try_lock(Lock::Shared)
}

/// Gives the lock back.
///
/// # Errors
/// Those of the system.
pub fn unlock(file: &File) -> io::Result<()> {
    file.unlock()
}

/// The bytes that stand for a path in a file.
pub fn path_to_bytes(path: &Path) -> Vec<u8> {
    path.as_os_str().as_bytes().to_vec()
}

/// The path that such bytes stand for; none for what is no path.
pub fn path_from_bytes(bytes: &[u8]) -> Option<PathBuf> {
    Some(OsString::from_vec(bytes.to_vec()).into())
}

/// Why the transport cannot use the folder of shared memory, if it cannot.
pub fn transport_problem() -> Option<&'static str> {
    None
}

/// Whether this user may make files in a folder.
pub fn is_writable(folder: &Path) -> bool {
    step(format_args!(
        "asks whether {} takes files",
        folder.display()
    ));
    with(|world| world.files.mode(folder)).is_ok_and(|mode| mode & 0o300 == 0o300)
}

/// Bytes free on the file system of a folder; 0 where that cannot be asked.
pub fn free_bytes(folder: &Path) -> u64 {
    let door = format_args!("asks how much is free in {}", folder.display());
    system_call(door)
        .and_then(|()| with(|world| world.files.is_shared(folder)))
        .map_or(0, |is_shared| match is_shared {
            true => with(|world| world.files.free()),
            false => ROOM,
        })
}

/// Nothing: the transport numbers its own descriptors, and waits itself.
///
/// # Safety
/// None is needed.
pub unsafe fn wait_readable(_descriptor: i32, _timeout: Duration) -> Option<io::Result<bool>> {
    None
}

//! Files, as `std::fs`: in memory, on a file system with room for so much.
//!
//! Each call of the system is one door and then one step that nobody comes between. A file lives on without a name as long as
//! it is open; what a process has open goes with it, and so do its locks.

mod file;
mod folder;
mod opened;
mod options;
mod put;
mod store;

use std::fmt::Display;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use crate::time::SystemTime;
use crate::world::{system_call, with};

pub use file::File;
pub use folder::{DirEntry, FileType, ReadDir, create_dir, create_dir_all, remove_dir_all};
pub use options::OpenOptions;

pub(crate) use folder::make_folders;
pub(crate) use opened::Lock;
pub(crate) use store::Files;

/// The folder of shared memory: a file system of its own, and the only one whose room ends.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Codes of errors, those of Linux.
pub(crate) mod code {
    pub(crate) const ENOENT: i32 = 2;
    pub(crate) const EBADF: i32 = 9;
    pub(crate) const EACCES: i32 = 13;
    pub(crate) const EBUSY: i32 = 16;
    pub(crate) const EEXIST: i32 = 17;
    pub(crate) const EXDEV: i32 = 18;
    pub(crate) const ENOTDIR: i32 = 20;
    pub(crate) const EISDIR: i32 = 21;
    pub(crate) const EINVAL: i32 = 22;
    pub(crate) const EMFILE: i32 = 24;
    pub(crate) const ENOSPC: i32 = 28;
    pub(crate) const ENOTEMPTY: i32 = 39;
}

pub(crate) fn err<T>(code: i32) -> io::Result<T> {
    Err(io::Error::from_raw_os_error(code))
}

/// A call of the system: others may go on first, then it fails at random, or has its effect at once.
pub(crate) fn call<R>(
    door: impl Display,
    effect: impl FnOnce(&mut Files) -> io::Result<R>,
) -> io::Result<R> {
    system_call(&door)?;
    with(|world| {
        let done = effect(&mut world.files);
        if let Err(error) = &done {
            world.line(|| format!("{door}: {error}"));
        }
        done
    })
}

/// As `std::fs::Metadata`.
#[derive(Debug, Clone)]
pub struct Metadata {
    pub(crate) inode: u64,
    pub(crate) mode: u32,
    pub(crate) links: u64,
    length: u64,
    is_dir: bool,
    modified: SystemTime,
}

#[allow(clippy::len_without_is_empty, reason = "as in the standard library")]
impl Metadata {
    /// Length of a file [bytes].
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Whether it is a folder.
    pub fn is_dir(&self) -> bool {
        self.is_dir
    }

    /// Whether it is a file.
    pub fn is_file(&self) -> bool {
        !self.is_dir
    }

    /// Never: there are no links.
    pub fn is_symlink(&self) -> bool {
        false
    }

    /// When a file was written, or an entry of a folder made or removed.
    ///
    /// # Errors
    /// None.
    pub fn modified(&self) -> io::Result<SystemTime> {
        Ok(self.modified)
    }
}

/// Whether a path names something.
pub fn exists(path: &Path) -> bool {
    metadata(path).is_ok()
}

/// What the system knows of a file or folder.
///
/// # Errors
/// Those of the system.
pub fn metadata(path: impl AsRef<Path>) -> io::Result<Metadata> {
    let path = path.as_ref();
    call(
        format_args!("looks at {}", path.display()),
        |files: &mut Files| files.find(path).map(|inode| files.metadata(inode)),
    )
}

/// The same.
///
/// # Errors
/// Those of the system.
pub fn symlink_metadata(path: impl AsRef<Path>) -> io::Result<Metadata> {
    metadata(path)
}

/// What is in a folder.
///
/// # Errors
/// Those of the system.
pub fn read_dir(path: impl AsRef<Path>) -> io::Result<ReadDir> {
    ReadDir::open(path.as_ref())
}

/// What is in a file.
///
/// # Errors
/// Those of the system.
pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Takes the name of a file.
///
/// # Errors
/// Those of the system.
pub fn remove_file(path: impl AsRef<Path>) -> io::Result<()> {
    let path = path.as_ref();
    call(
        format_args!("removes file {}", path.display()),
        |files: &mut Files| files.unlink(files.place(path)?),
    )
}

/// Removes an empty folder.
///
/// # Errors
/// Those of the system.
pub fn remove_dir(path: impl AsRef<Path>) -> io::Result<()> {
    let path = path.as_ref();
    call(
        format_args!("removes folder {}", path.display()),
        |files: &mut Files| files.remove_folder(files.place(path)?),
    )
}

/// Gives a file or folder another name, in place of what has it.
///
/// # Errors
/// Those of the system.
pub fn rename(from: impl AsRef<Path>, to: impl AsRef<Path>) -> io::Result<()> {
    let (from, to) = (from.as_ref(), to.as_ref());
    call(
        format_args!("renames {} to {}", from.display(), to.display()),
        |files: &mut Files| files.rename(from, to),
    )
}

/// Copies what is in a file, and who may use it; returns its length.
///
/// # Errors
/// Those of the system.
pub fn copy(from: impl AsRef<Path>, to: impl AsRef<Path>) -> io::Result<u64> {
    let mut source = File::open(from)?;
    let status = source.metadata()?;
    if status.is_dir() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    let mut copied = options.mode(status.mode).open(to)?;
    copied.set_mode(status.mode)?;
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes)?;
    copied.write_all(&bytes)?;
    Ok(bytes.len() as u64)
}

/// For a scenario: how much room the file system of shared memory has [bytes].
pub fn set_capacity(bytes: u64) {
    with(|world| world.files.set_capacity(bytes));
}

/// Leaves so many bytes of it.
pub fn set_free(bytes: u64) {
    with(|world| {
        let used = world.files.used();
        world.files.set_capacity(used + bytes);
    });
}

/// For a scenario: who may do what with a file or folder; says whether it is there.
pub fn set_mode(path: &Path, mode: u32) -> bool {
    with(|world| world.files.set_mode(path, mode)).is_ok()
}

/// For a scenario: all files and folders below one, sorted.
pub fn list(path: &Path) -> Vec<PathBuf> {
    with(|world| world.files.below(path))
}

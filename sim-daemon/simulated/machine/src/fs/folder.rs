//! What is in folders, and making and removing many.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::vec::IntoIter;

use super::code::*;
use super::options::{folder, opened};
use super::store::Files;
use super::{File, Metadata, call, err, metadata, symlink_metadata};

/// A folder that is open.
#[derive(Debug)]
struct Folder {
    file: File,
    path: PathBuf,
}

/// As `std::fs::ReadDir`.
#[derive(Debug)]
pub struct ReadDir {
    folder: Arc<Folder>,
    /// None before the system was asked.
    left: Option<IntoIter<(OsString, u64, bool)>>,
}

/// As `std::fs::DirEntry`.
#[derive(Debug)]
pub struct DirEntry {
    folder: Arc<Folder>,
    name: OsString,
    is_dir: bool,
}

/// As `std::fs::FileType`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileType {
    is_dir: bool,
}

impl Folder {
    fn inode(&self, files: &Files) -> io::Result<u64> {
        Ok(files.by_number(self.file.0)?.inode)
    }
}

/// Where something is: by its path, or by its name in an open folder, whatever became of that one's name.
fn place<'a>(
    files: &Files,
    within: Option<&Folder>,
    path: &'a Path,
) -> io::Result<(u64, &'a OsStr)> {
    match within {
        None => files.place(path),
        Some(folder) => Ok((folder.inode(files)?, path.file_name().unwrap_or_default())),
    }
}

fn open(within: Option<&Folder>, path: &Path) -> io::Result<Folder> {
    let door = format_args!("opens folder {}", path.display());
    let file = opened(door, |files, process| {
        let inode = match within {
            None => files.find(path)?,
            Some(_) => {
                let (folder, name) = place(files, within, path)?;
                files.child(folder, name)?
            }
        };
        match files.metadata(inode).is_dir() {
            true => files.open(inode, process, [true, false]),
            false => err(ENOTDIR),
        }
    })?;
    let path = path.to_owned();
    Ok(Folder { file, path })
}

impl ReadDir {
    pub(super) fn open(path: &Path) -> io::Result<ReadDir> {
        let folder = Arc::new(open(None, path)?);
        Ok(ReadDir { folder, left: None })
    }
}

impl Iterator for ReadDir {
    type Item = io::Result<DirEntry>;

    fn next(&mut self) -> Option<io::Result<DirEntry>> {
        let folder = &self.folder;
        if self.left.is_none() {
            let door = format_args!("lists {}", folder.path.display());
            let listed = call(door, |files: &mut Files| files.listed(folder.inode(files)?));
            match listed {
                Ok(listed) => self.left = Some(listed.into_iter()),
                Err(error) => {
                    self.left = Some(IntoIter::default());
                    return Some(Err(error));
                }
            }
        }
        let (name, _, is_dir) = self.left.as_mut()?.next()?;
        let folder = Arc::clone(folder);
        Some(Ok(DirEntry {
            folder,
            name,
            is_dir,
        }))
    }
}

impl DirEntry {
    /// Where it is.
    pub fn path(&self) -> PathBuf {
        self.folder.path.join(&self.name)
    }

    /// Its name.
    pub fn file_name(&self) -> OsString {
        self.name.clone()
    }

    /// What it was when the folder was listed.
    ///
    /// # Errors
    /// None.
    pub fn file_type(&self) -> io::Result<FileType> {
        let is_dir = self.is_dir;
        Ok(FileType { is_dir })
    }

    /// What the system knows of it now.
    ///
    /// # Errors
    /// Those of the system.
    pub fn metadata(&self) -> io::Result<Metadata> {
        let path = self.path();
        call(
            format_args!("looks at {}", path.display()),
            |files: &mut Files| {
                let inode = files.child(self.folder.inode(files)?, &self.name)?;
                Ok(files.metadata(inode))
            },
        )
    }
}

impl FileType {
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
}

/// Makes a folder.
///
/// # Errors
/// Those of the system.
pub fn create_dir(path: impl AsRef<Path>) -> io::Result<()> {
    make_folder(path.as_ref(), 0o755)
}

/// Makes a folder, and those around it that are missing.
///
/// # Errors
/// Those of the system.
pub fn create_dir_all(path: impl AsRef<Path>) -> io::Result<()> {
    make_folders(path.as_ref(), 0o755)
}

fn make_folder(path: &Path, mode: u32) -> io::Result<()> {
    call(
        format_args!("makes folder {}", path.display()),
        |files: &mut Files| match files.find(path) {
            Ok(_) => err(EEXIST),
            Err(_) => files.make(files.place(path)?, folder(), mode).map(drop),
        },
    )
}

/// In the order of the standard library, which makes the innermost first.
pub(crate) fn make_folders(path: &Path, mode: u32) -> io::Result<()> {
    let is_dir = |path: &Path| metadata(path).is_ok_and(|status| status.is_dir());
    match make_folder(path, mode) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(_) if is_dir(path) => return Ok(()),
        made => return made,
    }
    make_folders(path.parent().map_or(err(ENOENT), Ok)?, mode)?;
    match make_folder(path, mode) {
        Err(_) if is_dir(path) => Ok(()),
        made => made,
    }
}

/// Removes a folder and all that is in it.
///
/// # Errors
/// Those of the system.
pub fn remove_dir_all(path: impl AsRef<Path>) -> io::Result<()> {
    let path = path.as_ref();
    symlink_metadata(path)?;
    remove_tree(None, path)
}

/// In the order of the standard library, which keeps each folder open while it removes what is in it.
fn remove_tree(within: Option<&Folder>, path: &Path) -> io::Result<()> {
    let folder = match open(within, path) {
        Err(error) if within.is_some() && error.kind() == io::ErrorKind::NotADirectory => {
            return remove_entry(within, path);
        }
        folder => Arc::new(folder?),
    };
    let entries = ReadDir {
        folder: Arc::clone(&folder),
        left: None,
    };
    for entry in entries {
        let entry = entry?;
        let path = entry.path();
        let removed = match entry.is_dir {
            true => remove_tree(Some(&folder), &path),
            false => remove_entry(Some(&folder), &path),
        };
        unless_gone(removed)?;
    }
    drop(folder);
    let door = format_args!("removes folder {}", path.display());
    unless_gone(call(door, |files: &mut Files| {
        files.remove_folder(place(files, within, path)?)
    }))
}

fn remove_entry(within: Option<&Folder>, path: &Path) -> io::Result<()> {
    let door = format_args!("removes file {}", path.display());
    call(door, |files: &mut Files| {
        files.unlink(place(files, within, path)?)
    })
}

fn unless_gone(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

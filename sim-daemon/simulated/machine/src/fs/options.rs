//! How a file is opened.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use super::code::*;
use super::store::{Content, Files, Kind};
use super::{File, err};
use crate::world::{World, system_call, with};

/// As `std::fs::OpenOptions`.
#[derive(Debug, Clone)]
pub struct OpenOptions {
    read: bool,
    write: bool,
    truncate: bool,
    create: bool,
    create_new: bool,
    mode: u32,
}

impl Default for OpenOptions {
    fn default() -> OpenOptions {
        OpenOptions::new()
    }
}

impl OpenOptions {
    /// Nothing is wanted yet.
    pub fn new() -> OpenOptions {
        OpenOptions {
            read: false,
            write: false,
            truncate: false,
            create: false,
            create_new: false,
            mode: 0o644,
        }
    }

    /// To read it.
    pub fn read(&mut self, read: bool) -> &mut OpenOptions {
        self.read = read;
        self
    }

    /// To write it.
    pub fn write(&mut self, write: bool) -> &mut OpenOptions {
        self.write = write;
        self
    }

    /// Empty from now on.
    pub fn truncate(&mut self, truncate: bool) -> &mut OpenOptions {
        self.truncate = truncate;
        self
    }

    /// Made if it is missing.
    pub fn create(&mut self, create: bool) -> &mut OpenOptions {
        self.create = create;
        self
    }

    /// Made, or an error if it is there.
    pub fn create_new(&mut self, create_new: bool) -> &mut OpenOptions {
        self.create_new = create_new;
        self
    }

    /// Who may use it if it is made here.
    pub fn mode(&mut self, mode: u32) -> &mut OpenOptions {
        self.mode = mode;
        self
    }

    /// Opens a file.
    ///
    /// # Errors
    /// Those of the system.
    pub fn open(&self, path: impl AsRef<Path>) -> io::Result<File> {
        let path = path.as_ref();
        let makes = self.create || self.create_new;
        if !self.write && (!self.read || makes || self.truncate) {
            return err(EINVAL);
        }
        let door = format_args!("opens {}", path.display());
        opened(door, |files, process| {
            let inode = match files.find(path) {
                Ok(_) if self.create_new => return err(EEXIST),
                Ok(inode) if (self.write || makes) && files.metadata(inode).is_dir() => {
                    return err(EISDIR);
                }
                Err(error) if makes && error.raw_os_error() == Some(ENOENT) => {
                    let place = files.place(path)?;
                    files.make(place, Kind::File(Content::default()), self.mode)?
                }
                found => found?,
            };
            let number = files.open(inode, process, [self.read, self.write])?;
            if self.truncate {
                files.resize(inode, 0)?;
            }
            Ok(number)
        })
    }
}

/// A call that opens something for a process, which may have no more open.
pub(super) fn opened(
    door: std::fmt::Arguments<'_>,
    open: impl FnOnce(&mut Files, u32) -> io::Result<u64>,
) -> io::Result<File> {
    system_call(door)?;
    with(|world: &mut World| {
        let process = world.process();
        let number = match world.files.count(process) < world.system.limit(process) {
            true => open(&mut world.files, process),
            false => err(EMFILE),
        };
        if let Err(error) = &number {
            world.line(|| format!("{door}: {error}"));
        }
        number.map(File)
    })
}

/// An empty folder.
pub(super) fn folder() -> Kind {
    Kind::Folder(BTreeMap::new())
}

//! Names and what they stand for. Nothing here passes a door: a call of the system is one of these functions.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io;
use std::path::{Component, Path};

use super::code::*;
use super::opened::Opened;
use super::{Metadata, SHARED_MEMORY, err};
use crate::time::SystemTime;

pub(super) const ROOT: u64 = 1;
/// Room of the file system of shared memory, unless a scenario changes it [bytes].
const CAPACITY: u64 = 4 << 30;

/// All files of the machine.
#[derive(Debug)]
pub(crate) struct Files {
    pub(super) inodes: BTreeMap<u64, Inode>,
    pub(super) opened: BTreeMap<u64, Opened>,
    /// Numbers are not used again.
    pub(super) last: u64,
    /// Room of the file system of shared memory, and what is taken of it [bytes].
    pub(super) capacity: u64,
    pub(super) used: u64,
    /// Decides in which order folders are listed.
    order: u64,
    /// The clock of the calendar [ns].
    pub(crate) clock: i64,
    /// Changes that other processes can see, those of the transport's lists included.
    pub(crate) changes: u64,
}

/// A file or a folder.
#[derive(Debug)]
pub(super) struct Inode {
    pub(super) mode: u32,
    pub(super) modified: i64,
    /// Names that it has: one or none.
    pub(super) links: u64,
    /// Whether it is on the file system of shared memory.
    pub(super) is_shared: bool,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) enum Kind {
    Folder(BTreeMap<OsString, u64>),
    File(Content),
}

/// What is in a file.
#[derive(Debug, Default)]
pub(super) struct Content {
    pub(super) length: u64,
    /// Pages that it takes of its file system [bytes].
    pub(super) held: u64,
    /// Its first bytes; the rest are zeros.
    pub(super) bytes: Vec<u8>,
}

impl Files {
    /// A machine with the usual folders.
    pub(crate) fn new(order: u64) -> Files {
        let folder = |links| Inode {
            mode: 0o777,
            modified: 0,
            links,
            is_shared: false,
            kind: Kind::Folder(BTreeMap::new()),
        };
        let mut files = Files {
            inodes: BTreeMap::from([(ROOT, folder(1))]),
            opened: BTreeMap::new(),
            last: ROOT,
            capacity: CAPACITY,
            used: 0,
            order,
            clock: 0,
            changes: 0,
        };
        for path in ["/tmp", "/run", SHARED_MEMORY] {
            let made = files.put_folder(Path::new(path)).expect("it is new");
            let inode = files.inode_mut(made);
            (inode.mode, inode.is_shared) = (0o777, path == SHARED_MEMORY);
        }
        files
    }

    pub(crate) fn set_capacity(&mut self, bytes: u64) {
        self.capacity = bytes;
    }

    /// What is taken of the file system of shared memory [bytes].
    pub(crate) fn used(&self) -> u64 {
        self.used
    }

    pub(crate) fn mode(&self, path: &Path) -> io::Result<u32> {
        self.find(path).map(|number| self.inode(number).mode)
    }

    /// Whether something is on the file system of shared memory.
    pub(crate) fn is_shared(&self, path: &Path) -> io::Result<bool> {
        self.find(path).map(|number| self.inode(number).is_shared)
    }

    pub(super) fn inode(&self, number: u64) -> &Inode {
        &self.inodes[&number]
    }

    pub(super) fn inode_mut(&mut self, number: u64) -> &mut Inode {
        self.inodes.get_mut(&number).expect("it is used")
    }

    pub(super) fn entries(&self, folder: u64) -> io::Result<&BTreeMap<OsString, u64>> {
        match &self.inode(folder).kind {
            Kind::Folder(entries) => Ok(entries),
            Kind::File(_) => err(ENOTDIR),
        }
    }

    /// The entries of a folder that are about to change.
    fn changed(&mut self, folder: u64) -> io::Result<&mut BTreeMap<OsString, u64>> {
        let clock = self.clock;
        self.changes += 1;
        let inode = self.inode_mut(folder);
        match &mut inode.kind {
            Kind::File(_) => err(ENOTDIR),
            Kind::Folder(_) if inode.links == 0 => err(ENOENT),
            Kind::Folder(_) if inode.mode & 0o200 == 0 => err(EACCES),
            Kind::Folder(entries) => {
                inode.modified = clock;
                Ok(entries)
            }
        }
    }

    /// What a folder has under a name.
    pub(super) fn child(&self, folder: u64, name: &OsStr) -> io::Result<u64> {
        self.entries(folder)?
            .get(name)
            .copied()
            .map_or(err(ENOENT), Ok)
    }

    /// The folders from the root to what a path names, and that.
    fn walk(&self, path: &Path) -> io::Result<Vec<u64>> {
        if path.as_os_str().is_empty() {
            return err(ENOENT);
        }
        let mut passed = vec![ROOT];
        for part in path.components() {
            let here = passed[passed.len() - 1];
            match part {
                Component::Normal(name) => passed.push(self.child(here, name)?),
                Component::ParentDir if passed.len() > 1 => {
                    self.entries(here)?;
                    passed.pop();
                }
                _ => {}
            }
        }
        Ok(passed)
    }

    /// What a path names.
    pub(super) fn find(&self, path: &Path) -> io::Result<u64> {
        self.walk(path).map(|passed| passed[passed.len() - 1])
    }

    /// The folder of a path, and the name in it.
    pub(super) fn place<'a>(&self, path: &'a Path) -> io::Result<(u64, &'a OsStr)> {
        match (path.parent(), path.file_name()) {
            (Some(folder), Some(name)) if folder.as_os_str().is_empty() => Ok((ROOT, name)),
            (Some(folder), Some(name)) => {
                let number = self.find(folder)?;
                self.entries(number).map(|_| (number, name))
            }
            _ => self.find(path).and_then(|_| err(EBUSY)),
        }
    }

    /// Makes a file or a folder.
    pub(super) fn make(
        &mut self,
        (folder, name): (u64, &OsStr),
        kind: Kind,
        mode: u32,
    ) -> io::Result<u64> {
        if self.child(folder, name).is_ok() {
            return err(EEXIST);
        }
        let number = self.last + 1;
        self.changed(folder)?.insert(name.to_owned(), number);
        self.last = number;
        let inode = Inode {
            mode,
            modified: self.clock,
            links: 1,
            is_shared: self.inode(folder).is_shared,
            kind,
        };
        self.inodes.insert(number, inode);
        Ok(number)
    }

    /// Takes the name of a file, which lives on as long as it is open.
    pub(super) fn unlink(&mut self, (folder, name): (u64, &OsStr)) -> io::Result<()> {
        let number = self.child(folder, name)?;
        if matches!(self.inode(number).kind, Kind::Folder(_)) {
            return err(EISDIR);
        }
        self.changed(folder)?.remove(name);
        self.lose_name(number);
        Ok(())
    }

    /// Removes an empty folder.
    pub(super) fn remove_folder(&mut self, (folder, name): (u64, &OsStr)) -> io::Result<()> {
        let number = self.child(folder, name)?;
        if !self.entries(number)?.is_empty() {
            return err(ENOTEMPTY);
        }
        self.changed(folder)?.remove(name);
        self.lose_name(number);
        Ok(())
    }

    /// Gives something another name, and takes that from what had it.
    pub(super) fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        let ((old, old_name), (new, new_name)) = (self.place(from)?, self.place(to)?);
        let moved = self.child(old, old_name)?;
        let is_folder = self.entries(moved).is_ok();
        if self.inode(moved).is_shared != self.inode(new).is_shared {
            return err(EXDEV);
        }
        if self.walk(to.parent().unwrap_or(to))?.contains(&moved) {
            return err(EINVAL);
        }
        let replaced = self.child(new, new_name).ok();
        if let Some(number) = replaced {
            if self.walk(from.parent().unwrap_or(from))?.contains(&number) {
                return err(ENOTEMPTY);
            }
            match (is_folder, self.entries(number)) {
                _ if number == moved => return Ok(()),
                (true, Err(_)) => return err(ENOTDIR),
                (false, Ok(_)) => return err(EISDIR),
                (true, Ok(entries)) if !entries.is_empty() => return err(ENOTEMPTY),
                _ => {}
            }
        }
        self.changed(new)?;
        self.changed(old)?.remove(old_name);
        self.changed(new)?.insert(new_name.to_owned(), moved);
        if let Some(number) = replaced {
            self.lose_name(number);
        }
        Ok(())
    }

    fn lose_name(&mut self, number: u64) {
        self.inode_mut(number).links = 0;
        self.settle(number);
    }

    /// Gives back what has neither a name nor an open file.
    pub(super) fn settle(&mut self, number: u64) {
        let is_open = self.opened.values().any(|opened| opened.inode == number);
        if self.inode(number).links > 0 || is_open {
            return;
        }
        let gone = self.inodes.remove(&number).expect("it is used");
        if let Kind::File(content) = gone.kind
            && gone.is_shared
        {
            self.used -= content.held;
        }
    }

    pub(super) fn metadata(&self, number: u64) -> Metadata {
        let inode = self.inode(number);
        let (is_dir, length) = match &inode.kind {
            Kind::Folder(_) => (true, 0),
            Kind::File(content) => (false, content.length),
        };
        Metadata {
            inode: number,
            mode: inode.mode,
            links: inode.links,
            length,
            is_dir,
            modified: SystemTime(inode.modified),
        }
    }

    /// Names in a folder with what they stand for, and whether those are folders, in an order that follows the seed.
    pub(super) fn listed(&self, folder: u64) -> io::Result<Vec<(OsString, u64, bool)>> {
        let entries = self.entries(folder)?.iter();
        let mut listed: Vec<_> = entries
            .map(|(name, &number)| (name.clone(), number, self.entries(number).is_ok()))
            .collect();
        listed.sort_by_cached_key(|(name, ..)| self.rank(name));
        Ok(listed)
    }

    fn rank(&self, name: &OsStr) -> u64 {
        let mixed = |rank: u64, &byte: &u8| (rank ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        // multiplied once more, the last byte counts in all digits
        name.as_encoded_bytes()
            .iter()
            .fold(self.order, mixed)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .rotate_left(32)
    }
}

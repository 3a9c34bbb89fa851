//! Open files, their locks, and what is in them. Nothing here passes a door.

use std::io;

use super::code::*;
use super::err;
use super::store::{Content, Files, Kind};

/// What file systems hand out and take back at once [bytes].
const PAGE: u64 = 4096;

/// An open file: what two processes or two calls opened is two of them.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) inode: u64,
    process: u32,
    /// Where the next read or write begins.
    pub(super) at: u64,
    pub(super) is_readable: bool,
    pub(super) is_writable: bool,
    lock: Option<Lock>,
}

/// A lock that an open file has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lock {
    Shared,
    Exclusive,
}

impl Files {
    /// Opens something, to read or write it if its mode allows that.
    pub(super) fn open(
        &mut self,
        inode: u64,
        process: u32,
        [is_readable, is_writable]: [bool; 2],
    ) -> io::Result<u64> {
        let mode = self.inode(inode).mode;
        if is_readable && mode & 0o400 == 0 || is_writable && mode & 0o200 == 0 {
            return err(EACCES);
        }
        self.last += 1;
        let opened = Opened {
            inode,
            process,
            at: 0,
            is_readable,
            is_writable,
            lock: None,
        };
        self.opened.insert(self.last, opened);
        Ok(self.last)
    }

    /// Closes it, which gives its lock back. One that went with its process is closed already.
    pub(super) fn close(&mut self, number: u64) {
        if let Some(opened) = self.opened.remove(&number) {
            self.settle(opened.inode);
        }
    }

    /// Lets go of what a dead process had open.
    pub(crate) fn release(&mut self, process: u32) {
        let opened = self.opened.iter();
        let its: Vec<u64> = opened
            .filter(|(_, opened)| opened.process == process)
            .map(|(number, _)| *number)
            .collect();
        its.into_iter().for_each(|number| self.close(number));
    }

    /// How many files a process has open.
    pub(crate) fn count(&self, process: u32) -> u64 {
        let opened = self.opened.values();
        opened.filter(|opened| opened.process == process).count() as u64
    }

    pub(super) fn by_number(&self, number: u64) -> io::Result<&Opened> {
        self.opened.get(&number).map_or(err(EBADF), Ok)
    }

    pub(super) fn of_mut(&mut self, number: u64) -> io::Result<&mut Opened> {
        self.opened.get_mut(&number).map_or(err(EBADF), Ok)
    }

    /// Takes a lock unless another open file has one that excludes it, and says whether it did.
    pub(super) fn lock(&mut self, number: u64, lock: Lock) -> io::Result<bool> {
        let opened = self.of_mut(number)?;
        if opened.lock == Some(lock) {
            return Ok(true);
        }
        // as Linux does it: a lock of the other kind is given back first, and is lost if the new one cannot be had
        opened.lock = None;
        let inode = opened.inode;
        let mut others = self.opened.values().filter(|other| other.inode == inode);
        let is_free = others.all(|other| match other.lock {
            None => true,
            Some(held) => held == Lock::Shared && lock == Lock::Shared,
        });
        if is_free {
            self.changes += 1;
            self.of_mut(number)?.lock = Some(lock);
        }
        Ok(is_free)
    }

    pub(super) fn unlock(&mut self, number: u64) -> io::Result<()> {
        self.of_mut(number)?.lock = None;
        Ok(())
    }

    pub(super) fn content(&self, inode: u64) -> io::Result<&Content> {
        match &self.inode(inode).kind {
            Kind::File(content) => Ok(content),
            Kind::Folder(_) => err(EISDIR),
        }
    }

    fn content_mut(&mut self, inode: u64) -> io::Result<&mut Content> {
        match &mut self.inode_mut(inode).kind {
            Kind::File(content) => Ok(content),
            Kind::Folder(_) => err(EISDIR),
        }
    }

    /// Free room of the file system of shared memory [bytes].
    pub(crate) fn free(&self) -> u64 {
        self.capacity.saturating_sub(self.used)
    }

    /// Takes the pages of the first bytes of a file.
    pub(super) fn take(&mut self, inode: u64, bytes: u64) -> io::Result<()> {
        let more = pages(bytes).saturating_sub(self.content(inode)?.held);
        if self.inode(inode).is_shared {
            if more > self.free() {
                return err(ENOSPC);
            }
            self.used += more;
        }
        self.content_mut(inode)?.held += more;
        Ok(())
    }

    /// Makes a file as long as that, if it is shorter.
    pub(super) fn lengthen(&mut self, inode: u64, length: u64) -> io::Result<()> {
        let clock = self.clock;
        self.changes += 1;
        let content = self.content_mut(inode)?;
        content.length = content.length.max(length);
        self.inode_mut(inode).modified = clock;
        Ok(())
    }

    /// Cuts a file, or makes it longer.
    pub(super) fn resize(&mut self, inode: u64, length: u64) -> io::Result<()> {
        self.take(inode, length)?;
        let content = self.content_mut(inode)?;
        let given_back = content.held - pages(length);
        content.held -= given_back;
        content.length = length;
        content.bytes.truncate(length as usize);
        if self.inode(inode).is_shared {
            self.used -= given_back;
        }
        self.lengthen(inode, length)
    }

    /// Writes as much as there is room for, and returns how much.
    pub(super) fn write(&mut self, inode: u64, bytes: &[u8], at: u64) -> io::Result<usize> {
        let content = self.content(inode)?;
        let room = match self.inode(inode).is_shared {
            true => (content.held + self.free() / PAGE * PAGE).saturating_sub(at),
            false => u64::MAX,
        };
        let written = bytes.len().min(usize::try_from(room).unwrap_or(usize::MAX));
        if bytes.is_empty() {
            return Ok(0);
        }
        if written == 0 {
            return err(ENOSPC);
        }
        self.take(inode, at + written as u64)?;
        let (first, end) = (at as usize, at as usize + written);
        let there = &mut self.content_mut(inode)?.bytes;
        there.resize(there.len().max(end), 0);
        there[first..end].copy_from_slice(&bytes[..written]);
        self.lengthen(inode, end as u64)?;
        Ok(written)
    }

    /// Reads what is there, and returns how much.
    pub(super) fn read(&self, inode: u64, bytes: &mut [u8], at: u64) -> io::Result<usize> {
        let content = self.content(inode)?;
        let left = content.length.saturating_sub(at);
        let read = bytes.len().min(left as usize);
        let there = content.bytes.get(at as usize..).unwrap_or_default();
        let copied = read.min(there.len());
        bytes[..copied].copy_from_slice(&there[..copied]);
        bytes[copied..read].fill(0);
        Ok(read)
    }
}

fn pages(bytes: u64) -> u64 {
    bytes.next_multiple_of(PAGE)
}

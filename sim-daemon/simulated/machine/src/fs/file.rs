//! Open files.

use std::io::{self, Read, Write};
use std::path::Path;

use super::code::*;
use super::opened::Lock;
use super::store::Files;
use super::{Metadata, OpenOptions, call, err};
use crate::world::{step, try_with, with};

/// A write that is longer may be seen, or left by a kill, in part [bytes]. No system tears one that fits a sector.
const WHOLE: usize = 512;

/// As `std::fs::File`.
#[derive(Debug)]
pub struct File(pub(super) u64);

impl Drop for File {
    fn drop(&mut self) {
        step("closes a file");
        // outside of a run there is nothing to close
        try_with(|world| world.files.close(self.0));
    }
}

impl File {
    /// Opens a file to read it.
    ///
    /// # Errors
    /// Those of the system.
    pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
        OpenOptions::new().read(true).open(path)
    }

    /// Makes a file, or empties the one that is there, to write it.
    ///
    /// # Errors
    /// Those of the system.
    pub fn create(path: impl AsRef<Path>) -> io::Result<File> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true).open(path)
    }

    /// How a file is opened.
    pub fn options() -> OpenOptions {
        OpenOptions::new()
    }

    /// What the system knows of it.
    ///
    /// # Errors
    /// Those of the system.
    pub fn metadata(&self) -> io::Result<Metadata> {
        call("looks at an open file", |files: &mut Files| {
            Ok(files.metadata(files.by_number(self.0)?.inode))
        })
    }

    /// Cuts it, or makes it longer.
    ///
    /// # Errors
    /// Those of the system.
    pub fn set_len(&self, length: u64) -> io::Result<()> {
        call(
            format_args!("sets a length of {length}"),
            |files: &mut Files| {
                // the only call that calls it so
                let inode = self.written(files).or(err(EINVAL))?;
                files.resize(inode, length)
            },
        )
    }

    /// Takes the pages of its first bytes, and makes it as long.
    pub(crate) fn reserve(&self, bytes: u64) -> io::Result<()> {
        call(format_args!("takes {bytes} bytes"), |files: &mut Files| {
            let inode = self.written(files)?;
            files.take(inode, bytes)?;
            files.lengthen(inode, bytes)
        })
    }

    pub(crate) fn set_mode(&self, mode: u32) -> io::Result<()> {
        call("sets a mode", |files: &mut Files| {
            let inode = files.by_number(self.0)?.inode;
            files.inode_mut(inode).mode = mode;
            Ok(())
        })
    }

    pub(crate) fn try_lock(&self, lock: Lock) -> io::Result<bool> {
        let kind = match lock {
            Lock::Shared => "takes a share of a lock",
            Lock::Exclusive => "takes a lock",
        };
        call(kind, |files: &mut Files| files.lock(self.0, lock))
    }

    pub(crate) fn unlock(&self) -> io::Result<()> {
        call("gives a lock back", |files: &mut Files| {
            files.unlock(self.0)
        })
    }

    pub(crate) fn read_at(&self, bytes: &mut [u8], at: u64) -> io::Result<usize> {
        call(
            format_args!("reads {} bytes at {at}", bytes.len()),
            |files: &mut Files| {
                let opened = files.by_number(self.0)?;
                match opened.is_readable {
                    true => files.read(opened.inode, bytes, at),
                    false => err(EBADF),
                }
            },
        )
    }

    pub(crate) fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        let mut at = at;
        for part in parts(bytes) {
            let mut left = part;
            while !left.is_empty() {
                let written = self.write_at(left, at)?;
                (left, at) = (&left[written..], at + written as u64);
            }
        }
        Ok(())
    }

    fn write_at(&self, bytes: &[u8], at: u64) -> io::Result<usize> {
        call(
            format_args!("writes {} bytes at {at}", bytes.len()),
            |files: &mut Files| {
                let inode = self.written(files)?;
                files.write(inode, bytes, at)
            },
        )
    }

    /// The file, if it may be written.
    fn written(&self, files: &Files) -> io::Result<u64> {
        let opened = files.by_number(self.0)?;
        match opened.is_writable {
            true => Ok(opened.inode),
            false => err(EBADF),
        }
    }
}

/// A long write is two, between which others go on.
fn parts(bytes: &[u8]) -> [&[u8]; 2] {
    let cut = match bytes.len() <= WHOLE {
        true => bytes.len(),
        false => with(|world| world.rng.usize(1..bytes.len())),
    };
    bytes.split_at(cut).into()
}

impl Read for File {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        call(
            format_args!("reads {} bytes", bytes.len()),
            |files: &mut Files| {
                let opened = files.by_number(self.0)?;
                if !opened.is_readable {
                    return err(EBADF);
                }
                let read = files.read(opened.inode, bytes, opened.at)?;
                files.of_mut(self.0)?.at += read as u64;
                Ok(read)
            },
        )
    }
}

impl Write for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        call(
            format_args!("writes {} bytes", bytes.len()),
            |files: &mut Files| {
                let inode = self.written(files)?;
                let at = files.by_number(self.0)?.at;
                let written = files.write(inode, bytes, at)?;
                files.of_mut(self.0)?.at += written as u64;
                Ok(written)
            },
        )
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        for part in parts(bytes) {
            let mut left = part;
            while !left.is_empty() {
                let written = self.write(left)?;
                left = &left[written..];
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

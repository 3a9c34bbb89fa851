//! Files that other parts of the machine make, beside the calls of the code under test. Nothing here passes a door.

use std::collections::BTreeMap;
use std::io;
use std::path::{Component, Path, PathBuf};

use super::code::*;
use super::store::{Content, Files, Kind, ROOT};

#[allow(dead_code, reason = "the transport uses what it needs")]
impl Files {
    /// Makes a folder, and those around it; returns its number.
    pub(crate) fn put_folder(&mut self, path: &Path) -> io::Result<u64> {
        let mut here = ROOT;
        for part in path.components() {
            let Component::Normal(name) = part else {
                continue;
            };
            here = match self.child(here, name) {
                Err(error) if error.raw_os_error() == Some(ENOENT) => {
                    self.make((here, name), Kind::Folder(BTreeMap::new()), 0o700)?
                }
                there => there?,
            };
        }
        self.entries(here)?;
        Ok(here)
    }

    /// Makes a file of so many bytes, with its pages, and the folders around it. A file that is there gets that length.
    pub(crate) fn put(&mut self, path: &Path, bytes: u64) -> io::Result<()> {
        self.put_in_part(path, bytes, bytes)
    }

    /// The same with so many of its pages only [bytes]: the rest are taken later, if there is room.
    pub(crate) fn put_in_part(&mut self, path: &Path, bytes: u64, held: u64) -> io::Result<()> {
        let is_new = !self.exists(path);
        self.put_folder(path.parent().unwrap_or(path))?;
        let place = self.place(path)?;
        let number = match is_new {
            true => self.make(place, Kind::File(Content::default()), 0o600)?,
            false => self.find(path)?,
        };
        let done = match is_new {
            true => self
                .take(number, held)
                .and_then(|()| self.lengthen(number, bytes)),
            false => self.resize(number, bytes),
        };
        if done.is_err() && is_new {
            self.unlink(place)?;
        }
        done
    }

    /// Makes a file with content, and the folders around it, or changes it.
    pub(crate) fn put_bytes(&mut self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        self.put(path, bytes.len() as u64)?;
        let number = self.find(path)?;
        self.write(number, bytes, 0).map(drop)
    }

    /// What is in a file.
    pub(crate) fn bytes(&self, path: &Path) -> Option<Vec<u8>> {
        let number = self.find(path).ok()?;
        let mut bytes = vec![0; self.metadata(number).length as usize];
        self.read(number, &mut bytes, 0).ok()?;
        Some(bytes)
    }

    /// Changes who may do what.
    pub(crate) fn set_mode(&mut self, path: &Path, mode: u32) -> io::Result<()> {
        let number = self.find(path)?;
        self.changes += 1;
        self.inode_mut(number).mode = mode;
        Ok(())
    }

    /// Removes a file, or a folder with everything in it; says whether it was there.
    pub(crate) fn remove(&mut self, path: &Path) -> bool {
        for name in self.names(path) {
            self.remove(&path.join(name));
        }
        let Ok(place) = self.place(path) else {
            return false;
        };
        self.unlink(place).is_ok() || self.remove_folder(place).is_ok()
    }

    /// Whether a path names something.
    pub(crate) fn exists(&self, path: &Path) -> bool {
        self.find(path).is_ok()
    }

    /// Names in a folder, sorted; none if it is no folder.
    pub(crate) fn names(&self, path: &Path) -> Vec<String> {
        let entries = self.find(path).and_then(|number| self.entries(number));
        let names = entries.into_iter().flatten();
        names
            .map(|(name, _)| name.to_string_lossy().into_owned())
            .collect()
    }

    /// All files and folders below one, sorted.
    pub(crate) fn below(&self, path: &Path) -> Vec<PathBuf> {
        let mut below = Vec::new();
        for name in self.names(path) {
            let path = path.join(name);
            below.push(path.clone());
            below.extend(self.below(&path));
        }
        below.sort();
        below
    }
}

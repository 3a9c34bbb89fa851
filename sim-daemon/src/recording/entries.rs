//! The records of a recording, one after the other, across its blocks.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use sim_model::files::{self, FileError};

use super::blocks::{Blocks, Next};
use super::failure::unreadable;
use super::records::{self, Record};
use crate::error::DaemonError;

/// What comes next in a recording.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Entry<'a> {
    /// A record.
    Record(Record<'a>),
    /// Nothing: the last block was whole.
    End,
    /// Part of a block.
    Cut,
    /// A block that is not as it was written.
    Damaged,
}

/// A file that is read.
#[derive(Debug)]
pub(super) struct Entries<R> {
    pub(super) path: PathBuf,
    /// Its size when it was opened.
    pub(super) bytes: u64,
    blocks: Blocks<R>,
    block: Vec<u64>,
    /// Words of the block that were read.
    read: usize,
}

impl Entries<BufReader<File>> {
    /// Opens a file and checks its head.
    pub(super) fn open(path: &Path) -> Result<Self, DaemonError> {
        let failed = |error: FileError| match error {
            FileError::NotAFile => unreadable(path, "is no file; give the file of a recording"),
            error => unreadable(path, format!("{error}; give a recording that you may read")),
        };
        let file = files::open(path).map_err(failed)?;
        let bytes = file.metadata().map_err(|error| failed(error.into()))?.len();
        let blocks =
            Blocks::open(BufReader::new(file)).map_err(|problem| unreadable(path, problem))?;
        Ok(Entries {
            path: path.to_owned(),
            bytes,
            blocks,
            block: Vec::new(),
            read: 0,
        })
    }
}

impl<R: Read> Entries<R> {
    /// The next one.
    ///
    /// # Errors
    /// The system's; a block whose records make no sense.
    pub(super) fn next(&mut self) -> Result<Entry<'_>, DaemonError> {
        while self.read == self.block.len() {
            self.read = 0;
            let next = self.blocks.next(&mut self.block);
            let next =
                next.map_err(|error| unreadable(&self.path, format!("cannot be read: {error}")))?;
            let end = match next {
                Next::Block => continue,
                Next::End => Entry::End,
                Next::Cut => Entry::Cut,
                Next::Damaged => Entry::Damaged,
            };
            self.block.clear();
            return Ok(end);
        }
        let mut rest = &self.block[self.read..];
        let Some(record) = records::read(&mut rest) else {
            return Err(self.damaged("a record makes no sense"));
        };
        self.read = self.block.len() - rest.len();
        Ok(Entry::Record(record))
    }

    /// Bytes of the file up to the end of the last good block.
    pub(super) fn good(&self) -> u64 {
        self.blocks.good
    }

    /// What to say of records that no recorder writes.
    pub(super) fn damaged(&self, what: &str) -> DaemonError {
        unreadable(&self.path, format!("is damaged: {what}; copy it again"))
    }
}

/// Reads all records of a recording, up to what was cut or is damaged; returns how many there are.
///
/// # Errors
/// Bytes that are no recording; a block whose records make no sense.
pub(crate) fn count_records(bytes: &[u8]) -> Result<u64, String> {
    let mut entries = Entries {
        path: PathBuf::new(),
        bytes: bytes.len() as u64,
        blocks: Blocks::open(bytes)?,
        block: Vec::new(),
        read: 0,
    };
    let mut count = 0;
    loop {
        match entries.next().map_err(|error| error.to_string())? {
            Entry::Record(_) => count += 1,
            Entry::End | Entry::Cut | Entry::Damaged => return Ok(count),
        }
    }
}

//! Files in which a client asks a question, and in whose place it finds the answer.
//!
//! ```text
//! question   length u64 · JSON of that length · f64 of its arrays, one after another
//! ```
//! Everything is little endian.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::Path;

use crate::export::snapshot;

/// A question that was read.
pub(crate) struct Exchange {
    file: File,
    bytes: Vec<u8>,
}

impl Exchange {
    /// Reads the file at a path; there must be memory for `copies` of it.
    ///
    /// # Errors
    /// One sentence about the file, without its path.
    pub(crate) fn read(path: &Path, copies: u64) -> Result<Exchange, String> {
        let opened = OpenOptions::new().read(true).write(true).open(path);
        let file = opened.map_err(|problem| format!("cannot be opened: {problem}"))?;
        let status = file.metadata().map_err(|problem| problem.to_string())?;
        if !status.is_file() {
            return Err("is no file; give the path of one".to_owned());
        }
        snapshot::check_room(status.len().saturating_mul(copies))?;
        let mut bytes = Vec::with_capacity(status.len() as usize);
        let read = (&file).take(status.len()).read_to_end(&mut bytes);
        read.map_err(|problem| format!("cannot be read: {problem}"))?;
        Ok(Exchange { file, bytes })
    }

    /// The JSON, and the bytes of the arrays; none for other bytes.
    pub(crate) fn parts(&self) -> Option<(&str, &[u8])> {
        let (head, rest) = self.bytes.split_first_chunk::<8>()?;
        let (json, rest) =
            rest.split_at_checked(usize::try_from(u64::from_le_bytes(*head)).ok()?)?;
        Some((std::str::from_utf8(json).ok()?, rest))
    }

    /// Writes the answer in the place of the question.
    ///
    /// # Errors
    /// One sentence about the file, without its path.
    pub(crate) fn answer(mut self, bytes: &[u8]) -> Result<(), String> {
        let written = self
            .file
            .rewind()
            .and_then(|()| self.file.set_len(0))
            .and_then(|()| self.file.write_all(bytes));
        written.map_err(|problem| format!("cannot be written: {problem}"))
    }
}

/// Arrays of these lengths in the bytes that follow the JSON; none if there are more or fewer numbers.
pub(crate) fn arrays(bytes: &[u8], lengths: &[usize]) -> Option<Vec<Vec<f64>>> {
    let (numbers, end) = bytes.as_chunks::<8>();
    let wanted = lengths
        .iter()
        .try_fold(0usize, |sum, &length| sum.checked_add(length))?;
    if !end.is_empty() || wanted != numbers.len() {
        return None;
    }
    let mut numbers = numbers.iter().map(|&bytes| f64::from_le_bytes(bytes));
    let arrays = lengths
        .iter()
        .map(|&length| numbers.by_ref().take(length).collect());
    Some(arrays.collect())
}

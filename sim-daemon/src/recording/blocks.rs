//! Blocks of a file: records, compressed, with a checksum. A file that was cut is good up to its last whole block.

use std::io::{self, Read, Write};

use lz4_flex::block::{compress_into, decompress_into, get_maximum_output_size};
use sim_protocol::digest::checksum;

/// How a recording begins; the line end shows a transfer that took it for text.
const MAGIC: [u8; 8] = *b"tlrec\r\n\x1a";
/// Version of the format.
const VERSION: u32 = 1;
/// Bytes before the first block.
pub(super) const HEAD: usize = 16;
/// Bytes before the records of a block.
const BLOCK_HEAD: usize = 16;
/// Most bytes of records that a block may have: LZ4 counts in 31 bits.
pub(super) const BLOCK_MAX: usize = 1 << 30;
/// LZ4 makes at most so many bytes of one.
const RATIO_MAX: usize = 256;

/// Most bytes of records in a file of so many bytes.
pub(super) fn most_records(file: u64) -> u64 {
    file.saturating_mul(RATIO_MAX as u64)
}

/// How a recording begins.
pub(super) fn head() -> [u8; HEAD] {
    let mut head = [0; HEAD];
    head[..8].copy_from_slice(&MAGIC);
    head[8..12].copy_from_slice(&VERSION.to_le_bytes());
    head
}

/// Compresses records and puts the block into `block`, which is kept between calls.
///
/// # Panics
/// When there are more than [`BLOCK_MAX`] bytes of them.
pub(super) fn pack(records: &[u64], block: &mut Vec<u8>) {
    let raw: &[u8] = bytemuck::cast_slice(records);
    assert!(raw.len() <= BLOCK_MAX, "{} bytes in a block", raw.len());
    block.resize(BLOCK_HEAD + get_maximum_output_size(raw.len()), 0);
    let stored = compress_into(raw, &mut block[BLOCK_HEAD..]).expect("there is room for it");
    block.truncate(BLOCK_HEAD + stored);
    let of_records = sum(&block[BLOCK_HEAD..]);
    for (at, number) in [(4, of_records), (8, raw.len() as u32), (12, stored as u32)] {
        block[at..at + 4].copy_from_slice(&number.to_le_bytes());
    }
    let of_head = sum(&block[4..BLOCK_HEAD]);
    block[..4].copy_from_slice(&of_head.to_le_bytes());
}

fn sum(bytes: &[u8]) -> u32 {
    checksum(bytes) as u32
}

/// Writes a file's head.
pub(super) fn begin(file: &mut impl Write) -> io::Result<()> {
    file.write_all(&head())
}

/// What a file holds next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// A block, whose records were read.
    Block,
    /// Nothing: the last block was whole.
    End,
    /// Part of a block.
    Cut,
    /// A block that is not as it was written.
    Damaged,
}

/// The blocks of a file, one after the other.
#[derive(Debug)]
pub(super) struct Blocks<R> {
    file: R,
    /// Bytes of the file up to the end of the last good block.
    pub(super) good: u64,
    stored: Vec<u8>,
}

impl<R: Read> Blocks<R> {
    /// Checks the head of a file.
    ///
    /// # Errors
    /// One sentence: it is no recording, of another format, or cannot be read.
    pub(super) fn open(mut file: R) -> Result<Blocks<R>, String> {
        let mut head = [0; HEAD];
        let got = fill(&mut file, &mut head).map_err(|error| format!("cannot be read: {error}"))?;
        if got < HEAD || head[..8] != MAGIC {
            return Err("is no recording; give a file that `tightloop record` wrote".to_owned());
        }
        let version = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
        if version != VERSION {
            return Err(format!(
                "is of format {version}, this release reads format {VERSION}; replay it with the release that recorded it"
            ));
        }
        Ok(Blocks {
            file,
            good: HEAD as u64,
            stored: Vec::new(),
        })
    }

    /// Reads the next block into `records`.
    ///
    /// # Errors
    /// The system's, when the file cannot be read.
    pub(super) fn next(&mut self, records: &mut Vec<u64>) -> io::Result<Next> {
        let mut head = [0; BLOCK_HEAD];
        match fill(&mut self.file, &mut head)? {
            0 => return Ok(Next::End),
            BLOCK_HEAD => {}
            _ => return Ok(Next::Cut),
        }
        let number =
            |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let (raw, stored) = (number(8) as usize, number(12) as usize);
        // nothing is taken that the file could not fill
        if number(0) != sum(&head[4..])
            || raw % 8 != 0
            || raw > BLOCK_MAX
            || raw > stored.saturating_mul(RATIO_MAX)
        {
            return Ok(Next::Damaged);
        }
        self.stored.clear();
        let got = (&mut self.file)
            .take(stored as u64)
            .read_to_end(&mut self.stored)?;
        if got < stored {
            return Ok(Next::Cut);
        }
        if number(4) != sum(&self.stored) {
            return Ok(Next::Damaged);
        }
        records.clear();
        records.resize(raw / 8, 0);
        match decompress_into(&self.stored, bytemuck::cast_slice_mut(records)) {
            Ok(bytes) if bytes == raw => {
                self.good += (BLOCK_HEAD + stored) as u64;
                Ok(Next::Block)
            }
            _ => Ok(Next::Damaged),
        }
    }
}

/// Reads until `bytes` are full or the file ends; returns how many there were.
fn fill(file: &mut impl Read, bytes: &mut [u8]) -> io::Result<usize> {
    let mut got = 0;
    while got < bytes.len() {
        match file.read(&mut bytes[got..]) {
            Ok(0) => break,
            Ok(more) => got += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(got)
}

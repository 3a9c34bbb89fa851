//! Recordings: what a daemon did, in a file, from which it is done again and compared bit for bit.
//!
//! ```text
//! file     magic 8 · version u32 · 0 u32 · blocks
//! block    checksum of the rest of this line u32 · checksum of the records u32 · bytes as records u32 · bytes stored u32
//!          records in LZ4
//! record   kind u32 · 0 u32 · words u64 · words
//! ```
//! Numbers are little endian. Checksums are the lower halves of XXH3. A block ends after 256 kB of records
//! or 0.1 s, so that a recorder that is killed loses no more; each holds whole records, hence whole frames. The first record
//! is the head (JSON: the daemon's description), the second the state of all worlds; then come the commands in order,
//! each with the digests of its frame, and the state after each restore. Where entries were lost there is a gap, followed by
//! the state behind it. The last record is why the recording ended.

mod blocks;
mod compare;
mod entries;
mod failure;
mod playback;
mod record;
mod records;
mod replay;
mod run;
#[cfg(test)]
mod tests;
mod writer;

pub(crate) use entries::count_records;
pub use playback::{Playback, Shows};
#[cfg(test)]
pub(crate) use record::follow;
pub(crate) use record::run as record;
pub(crate) use replay::{first_frames, run as replay};
pub(crate) use writer::file_of;

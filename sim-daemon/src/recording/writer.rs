//! The thread of a recorder that compresses and writes, so that the one that takes entries is never kept from it.

use std::fs::File;
use std::io::{self, Write};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::blocks;
use super::records::Record;

/// A block ends when its records are this long [words] …
const BLOCK: usize = (256 << 10) / 8;
/// … or this old.
const AGE_MAX: Duration = Duration::from_millis(100);
/// Blocks that wait to be written, as many as make so much [bytes] …
const QUEUE: usize = 256 << 20;
/// … but not more, nor fewer, than these.
const QUEUE_LENGTH: std::ops::RangeInclusive<usize> = 4..=256;

/// A file with one block of these records.
pub(crate) fn file_of(records: &[u64]) -> Vec<u8> {
    let (mut bytes, mut block) = (blocks::head().to_vec(), Vec::new());
    blocks::pack(records, &mut block);
    bytes.extend(block);
    bytes
}

/// The end that takes records.
pub(super) struct Writer {
    block: Vec<u64>,
    since: Instant,
    queue: Option<SyncSender<Vec<u64>>>,
    /// Buffers that were written, to be filled again.
    empty: Receiver<Vec<u64>>,
    /// Blocks handed over whose buffers have not come back.
    under_way: usize,
    thread: Option<JoinHandle<io::Result<u64>>>,
}

/// The file can no longer be written; [`Writer::close`] reports why.
#[derive(Debug)]
pub(super) struct Stopped;

impl Writer {
    /// Starts writing into an empty file; `entry_bytes` are those of a large entry.
    ///
    /// # Errors
    /// The system's, when it gives no thread.
    pub(super) fn start(file: File, entry_bytes: usize) -> io::Result<Writer> {
        let length = QUEUE / entry_bytes.max(8 * BLOCK);
        let length = length.clamp(*QUEUE_LENGTH.start(), *QUEUE_LENGTH.end());
        let ((queue, filled), (give, empty)) = (sync_channel(length), channel());
        let thread = std::thread::Builder::new()
            .name("tightloop-writer".to_owned())
            .spawn(move || write(file, &filled, &give))?;
        Ok(Writer {
            block: Vec::with_capacity(2 * BLOCK),
            since: Instant::now(),
            queue: Some(queue),
            empty,
            under_way: 0,
            thread: Some(thread),
        })
    }

    /// Appends a record. While the disk is behind this waits: what comes meanwhile is lost in shared memory, as a gap.
    pub(super) fn put(&mut self, record: &Record<'_>) -> Result<(), Stopped> {
        if self.block.is_empty() {
            self.since = Instant::now();
        }
        // a large record gets a block of its own, so that blocks stay small enough
        if 8 * (self.block.len() + record.words()) > blocks::BLOCK_MAX {
            self.flush()?;
        }
        record.write(&mut self.block);
        if self.block.len() >= BLOCK {
            self.flush()?;
        }
        Ok(())
    }

    /// Hands the block over if its first record is old.
    pub(super) fn flush_old(&mut self) -> Result<(), Stopped> {
        if self.since.elapsed() < AGE_MAX {
            return Ok(());
        }
        self.flush()
    }

    /// Hands the block over to be written.
    pub(super) fn flush(&mut self) -> Result<(), Stopped> {
        if self.block.is_empty() {
            return Ok(());
        }
        let mut next = match self.empty.try_recv() {
            Ok(written) => {
                self.under_way -= 1;
                written
            }
            Err(_) => Vec::new(),
        };
        next.clear();
        let block = std::mem::replace(&mut self.block, next);
        self.since = Instant::now();
        let queue = self.queue.as_ref().expect("it is open until it is closed");
        queue.send(block).map_err(|_| Stopped)?;
        self.under_way += 1;
        Ok(())
    }

    /// Waits until everything handed over is in the file.
    pub(super) fn catch_up(&mut self) -> Result<(), Stopped> {
        self.flush()?;
        while self.under_way > 0 {
            self.empty.recv().map_err(|_| Stopped)?;
            self.under_way -= 1;
        }
        Ok(())
    }

    /// Waits until everything is written; returns the bytes of the file.
    ///
    /// # Errors
    /// Why writing stopped. The file then ends with its last whole block.
    pub(super) fn close(mut self) -> io::Result<u64> {
        drop(self.queue.take());
        let thread = self.thread.take().expect("it is closed once");
        thread
            .join()
            .unwrap_or_else(|_| Err(io::Error::other("the writing thread panicked")))
    }
}

fn write(mut file: File, filled: &Receiver<Vec<u64>>, give: &Sender<Vec<u64>>) -> io::Result<u64> {
    let (mut bytes, mut block) = (blocks::HEAD as u64, Vec::new());
    blocks::begin(&mut file)?;
    for records in filled {
        blocks::pack(&records, &mut block);
        if let Err(error) = file.write_all(&block) {
            // what is there of the block would only be passed over; a device has no length to set
            let _ = file.set_len(bytes);
            return Err(error);
        }
        bytes += block.len() as u64;
        // nobody takes it when we are about to end
        let _ = give.send(records);
    }
    match file.sync_data() {
        // a pipe or a device need not know how
        Err(error) if error.kind() != io::ErrorKind::InvalidInput => Err(error),
        _ => Ok(bytes),
    }
}

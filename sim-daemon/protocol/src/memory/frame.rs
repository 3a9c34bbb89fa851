//! A frame: one sample from the daemon, owned, with its checked field table.

use std::any::Any;
use std::fmt;
use std::mem::ManuallyDrop;

use crate::doors::iceoryx2::sample::Sample;
use crate::doors::sync::atomic::{AtomicUsize, Ordering};
use crate::doors::sync::{Arc, Mutex};
use crate::memory::forked::Maker;
use crate::memory::port::Port;
use crate::memory::service::AnyThread;
use crate::{Dtype, FrameHeader, Line, ProtocolError, Row, Table};

pub(crate) type FrameSample = Port<Sample<AnyThread, [Line], FrameHeader>>;

/// The port that a sample came by: once it is gone, the daemon writes to the slots of its samples again.
pub(crate) type Reader = Arc<dyn Any + Send + Sync>;

/// The state of all worlds (or, for an observer, of the first ones) at one instant.
///
/// It stays valid and unchanged until dropped, even after the client is dropped or the daemon ends or is killed. It may be
/// dropped on any thread. At most `frames_held` of them may be alive.
pub struct Frame {
    header: FrameHeader,
    table: Arc<Table>,
    // address of the payload: taken once, since asking the sample locks the subscriber
    base: usize,
    sample: Mutex<Option<FrameSample>>,
    alive: Arc<Alive>,
    reader: ManuallyDrop<Reader>,
}

/// Frames of one subscription that are alive.
#[derive(Debug)]
pub(crate) struct Alive {
    count: AtomicUsize,
    maker: Maker,
}

impl Alive {
    pub(crate) fn new() -> Arc<Alive> {
        Arc::new(Alive {
            count: AtomicUsize::new(0),
            maker: Maker::this(),
        })
    }

    /// Refuses one more than `limit`.
    pub(crate) fn check(&self, limit: usize) -> Result<(), ProtocolError> {
        let held = self.count.load(Ordering::Acquire);
        if held >= limit {
            return Err(ProtocolError::FramesHeld { held });
        }
        Ok(())
    }
}

/// One array of a frame.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Name, such as `joint_q`.
    pub name: &'a str,
    /// Type of the entries.
    pub dtype: Dtype,
    /// Shape, worlds first; row-major and contiguous.
    pub shape: &'a [usize],
    /// First entry, 64-byte aligned; valid for `bytes` and as long as the frame lives, read-only.
    pub ptr: *const u8,
    /// Length in bytes.
    pub bytes: usize,
    words: &'a [u64],
}

impl Frame {
    /// Wraps a sample whose table was checked against its payload; with its head, the address of its payload, and the port that
    /// it came by.
    pub(crate) fn new(
        (header, base): (FrameHeader, usize),
        sample: FrameSample,
        table: Arc<Table>,
        alive: &Arc<Alive>,
        reader: Reader,
    ) -> Frame {
        alive.count.fetch_add(1, Ordering::Acquire);
        Frame {
            header,
            table,
            base,
            sample: Mutex::new(Some(sample)),
            alive: Arc::clone(alive),
            reader: ManuallyDrop::new(reader),
        }
    }

    /// The head of the sample: session, acknowledged command, number of the frame.
    pub fn header(&self) -> &FrameHeader {
        &self.header
    }

    /// The field table.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// The array named so.
    ///
    /// # Errors
    /// [`ProtocolError::NoField`].
    pub fn field(&self, name: &str) -> Result<View<'_>, ProtocolError> {
        let row = self.table.row(name).ok_or_else(|| ProtocolError::NoField {
            field: name.to_owned(),
            known: self
                .table
                .rows()
                .iter()
                .map(|row| row.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        })?;
        Ok(self.view(row))
    }

    /// Every array in the order of the table.
    pub fn fields(&self) -> impl Iterator<Item = View<'_>> {
        self.table.rows().iter().map(|row| self.view(row))
    }

    fn view<'a>(&'a self, row: &'a Row) -> View<'a> {
        let ptr = (self.base + row.offset) as *const u8;
        // SAFETY: `Table::parse` checked that the row, rounded up to words, lies inside the payload and is aligned; the
        // sample keeps the payload mapped while `self` lives; the daemon writes to a slot only after it was given back.
        let words = unsafe { std::slice::from_raw_parts(ptr.cast::<u64>(), row.bytes.div_ceil(8)) };
        View {
            name: &row.name,
            dtype: row.dtype,
            shape: &row.shape,
            ptr,
            bytes: row.bytes,
            words,
        }
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

impl Drop for Frame {
    fn drop(&mut self) {
        let sample = self.sample.get_mut().ok().and_then(Option::take);
        // in a forked child the slot is the parent's to give back
        if !self.alive.maker.is_this() {
            return std::mem::forget(sample);
        }
        // the slot goes back before the count goes down, so that the count never promises a slot that is not there
        drop(sample);
        // SAFETY: nobody uses it afterwards.
        unsafe { ManuallyDrop::drop(&mut self.reader) };
        self.alive.count.fetch_sub(1, Ordering::Release);
    }
}

impl<'a> View<'a> {
    /// The entries as bytes.
    pub fn as_bytes(&self) -> &'a [u8] {
        &bytemuck::cast_slice(self.words)[..self.bytes]
    }

    /// The entries, when they are of the type asked for (`f32`, `f64`, `i32`, `u32`, `u64`, `u8`).
    pub fn as_slice<T: Entry>(&self) -> Option<&'a [T]> {
        (self.dtype == T::DTYPE).then(|| bytemuck::cast_slice(self.as_bytes()))
    }
}

/// A Rust type that a [`Dtype`] stands for.
pub trait Entry: bytemuck::Pod {
    /// Its dtype.
    const DTYPE: Dtype;
}

macro_rules! entries {
    ($($rust:ty => $dtype:ident),*) => { $(impl Entry for $rust { const DTYPE: Dtype = Dtype::$dtype; })* };
}
entries!(f32 => F32, f64 => F64, i32 => I32, u32 => U32, u64 => U64, u8 => U8);

#[cfg(all(test, loom))]
mod models {
    use super::*;
    use loom::cell::UnsafeCell;
    use loom::thread;
    use std::marker::PhantomData;

    fn frame(slot: &Arc<UnsafeCell<u32>>, alive: &Arc<Alive>) -> Frame {
        let sample = Port(Sample {
            slot: Arc::clone(slot),
            kind: PhantomData,
        });
        let head = (FrameHeader::default(), 0);
        Frame::new(
            head,
            sample,
            Arc::new(Table::default()),
            alive,
            Arc::new(()),
        )
    }

    #[test]
    fn a_slot_that_the_count_promises_was_given_back() {
        loom::model(|| {
            let (slot, alive) = (Arc::new(UnsafeCell::new(0)), Alive::new());
            let held = frame(&slot, &alive);
            let dropping = thread::spawn(move || drop(held));
            // loom refuses a look at the slot that has no order with its giving back
            match alive.check(1) {
                // SAFETY: as above.
                Ok(()) => assert_eq!(slot.with(|given_back| unsafe { *given_back }), 1),
                Err(ProtocolError::FramesHeld { held }) => assert_eq!(held, 1),
                Err(error) => panic!("{error:?}"),
            }
            dropping.join().unwrap();
            alive.check(1).unwrap();
        });
    }

    #[test]
    fn frames_that_two_threads_drop_are_both_counted() {
        loom::model(|| {
            let slots = [0; 2].map(|_| Arc::new(UnsafeCell::new(0)));
            let alive = Alive::new();
            let threads = slots.each_ref().map(|slot| {
                let held = frame(slot, &alive);
                thread::spawn(move || drop(held))
            });
            for thread in threads {
                thread.join().unwrap();
            }
            alive.check(1).unwrap();
        });
    }
}

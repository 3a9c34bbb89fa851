//! Memory of one sample: a header, and the payload that follows.

use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Alignment of headers and payloads [bytes].
pub(crate) const ALIGNMENT: usize = 64;

/// A slot of a port that sends. Who reads it may do so after everybody else is gone.
#[derive(Debug)]
pub(crate) struct Slot {
    start: NonNull<u8>,
    layout: Layout,
    /// Where the payload begins [bytes].
    head: usize,
    /// Entries of the payload.
    length: AtomicUsize,
    /// Channel and number of a request or its answer.
    request: [AtomicU64; 2],
    /// Nodes that read it now.
    readers: Mutex<Vec<u128>>,
}

// SAFETY: threads of the machine run one at a time, and the memory lives as long as the slot.
unsafe impl Send for Slot {}
// SAFETY: as above.
unsafe impl Sync for Slot {}

impl Slot {
    pub(crate) fn new(head: usize, bytes: usize) -> Slot {
        let head = head.next_multiple_of(ALIGNMENT).max(ALIGNMENT);
        let layout = Layout::from_size_align(head + bytes, ALIGNMENT).expect("slots are small");
        // SAFETY: the size is not zero.
        let start = NonNull::new(unsafe { alloc_zeroed(layout) });
        Slot {
            start: start.unwrap_or_else(|| handle_alloc_error(layout)),
            layout,
            head,
            length: AtomicUsize::new(0),
            request: Default::default(),
            readers: Mutex::default(),
        }
    }

    /// Fills it with what somebody may have left there.
    pub(crate) fn fill(&self, seed: u64) {
        let mut rng = fastrand::Rng::with_seed(seed);
        for word in 0..self.layout.size() / 8 {
            // SAFETY: it lies in the slot, which is aligned, and nobody else runs.
            unsafe { self.start.cast::<u64>().add(word).write(rng.u64(..)) };
        }
    }

    pub(crate) fn header<H>(&self) -> NonNull<H> {
        assert!(size_of::<H>() <= self.head && align_of::<H>() <= ALIGNMENT);
        self.start.cast()
    }

    pub(crate) fn payload<T>(&self, length: usize) -> NonNull<[T]> {
        assert!(self.head + length * size_of::<T>() <= self.layout.size());
        assert!(align_of::<T>() <= ALIGNMENT);
        // SAFETY: the payload begins inside the slot, or at its end.
        let first = unsafe { self.start.add(self.head) };
        NonNull::slice_from_raw_parts(first.cast(), length)
    }

    pub(crate) fn length(&self) -> usize {
        self.length.load(Ordering::Relaxed)
    }

    pub(crate) fn set_length(&self, length: usize) {
        self.length.store(length, Ordering::Relaxed);
    }

    /// Channel and number.
    pub(crate) fn request(&self) -> (usize, u64) {
        let [channel, number] = &self.request;
        (
            channel.load(Ordering::Relaxed) as usize,
            number.load(Ordering::Relaxed),
        )
    }

    pub(crate) fn set_request(&self, channel: usize, number: u64) {
        self.request[0].store(channel as u64, Ordering::Relaxed);
        self.request[1].store(number, Ordering::Relaxed);
    }

    /// Calls with the nodes that read it.
    pub(crate) fn readers<R>(&self, call: impl FnOnce(&mut Vec<u128>) -> R) -> R {
        call(&mut self.readers.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        // SAFETY: it was allocated so.
        unsafe { dealloc(self.start.as_ptr(), self.layout) };
    }
}

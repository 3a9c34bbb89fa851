//! Shared memory for frames, as a daemon's readers map it: what a device may write into.

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::ptr::null_mut;

/// Pages of shared memory.
pub struct Pages {
    at: *mut u64,
    words: usize,
    bytes: usize,
}

impl Pages {
    /// Room for so many words, zeroed.
    pub fn new(words: usize) -> anyhow::Result<Pages> {
        let bytes = (8 * words).next_multiple_of(4096);
        let file = memfd_create("frames", MemfdFlags::CLOEXEC)?;
        ftruncate(&file, bytes as u64)?;
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a new mapping, at no given address.
        let at = unsafe { mmap(null_mut(), bytes, protection, MapFlags::SHARED, &file, 0) }?;
        let at = at.cast();
        Ok(Pages { at, words, bytes })
    }

    /// The words.
    pub fn words(&mut self) -> &mut [u64] {
        // SAFETY: mapped for at least so many, and nobody else has the mapping.
        unsafe { std::slice::from_raw_parts_mut(self.at, self.words) }
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        // SAFETY: the mapping is this one's own.
        let _ = unsafe { munmap(self.at.cast(), self.bytes) };
    }
}

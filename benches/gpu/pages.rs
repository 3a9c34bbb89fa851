//! Shared memory for frames, as a daemon's readers map it: what a device may write into.

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use sim_engine::backend::HostPages;
use std::ptr::{NonNull, null_mut};
use std::sync::Arc;

/// Pages of shared memory.
pub struct Pages {
    mapping: Arc<Mapping>,
    words: usize,
}

/// What is mapped, for as long as somebody owns it.
struct Mapping {
    at: NonNull<u8>,
    bytes: usize,
}

// SAFETY: it is no thread's own.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

// SAFETY: mapped in `Pages::new` until drop.
unsafe impl HostPages for Mapping {
    fn start(&self) -> NonNull<u8> {
        self.at
    }

    fn bytes(&self) -> usize {
        self.bytes
    }
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
        let at = NonNull::new(at.cast()).expect("nothing is mapped at zero");
        let mapping = Arc::new(Mapping { at, bytes });
        Ok(Pages { mapping, words })
    }

    /// The words.
    pub fn words(&mut self) -> &mut [u64] {
        // SAFETY: mapped for at least so many, and other owners do not touch them.
        unsafe { std::slice::from_raw_parts_mut(self.mapping.at.as_ptr().cast(), self.words) }
    }

    /// Who keeps them mapped.
    pub fn owner(&self) -> Arc<dyn HostPages> {
        self.mapping.clone()
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping is this one's own.
        let _ = unsafe { munmap(self.at.as_ptr().cast(), self.bytes) };
    }
}

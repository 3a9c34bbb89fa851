//! Memory for machine code: written first, then executed and never written again.

use memmap2::{Mmap, MmapMut};
use std::io;

/// Bytes of a line of the cache: constants begin at one.
const LINE: usize = 64;

/// Pages that hold a program, and behind it its constants.
pub(crate) struct Pages {
    memory: Mmap,
    /// Where the constants begin.
    constants: usize,
}

impl Pages {
    /// # Errors
    /// The system gives no memory, or forbids its execution.
    pub fn new(program: &[u8], constants: &[f32]) -> io::Result<Pages> {
        let first = program.len().next_multiple_of(LINE);
        let mut memory = MmapMut::map_anon(first + size_of_val(constants))?;
        memory[..program.len()].copy_from_slice(program);
        for (place, x) in memory[first..]
            .chunks_exact_mut(size_of::<f32>())
            .zip(constants)
        {
            place.copy_from_slice(&x.to_ne_bytes());
        }
        Ok(Pages {
            memory: memory.make_exec()?,
            constants: first,
        })
    }

    /// Where the program begins.
    pub fn address(&self) -> *const u8 {
        self.memory.as_ptr()
    }

    /// Where its constants begin.
    pub fn constants(&self) -> *const f32 {
        self.memory[self.constants..].as_ptr().cast()
    }
}

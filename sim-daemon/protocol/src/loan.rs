//! Loaned shared memory as plain words.

use std::mem::MaybeUninit;

/// The words of a loan. Their content is whatever was in the slot before.
pub(crate) fn initialised(words: &mut [MaybeUninit<u64>]) -> &mut [u64] {
    // SAFETY: shared memory is zero or was written, never uninitialised, and any bits are a u64.
    unsafe { &mut *(std::ptr::from_mut(words) as *mut [u64]) }
}

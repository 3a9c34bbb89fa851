//! Loaned shared memory as plain words.

use std::mem::MaybeUninit;

use crate::Line;

/// The words of a loan. Their content is whatever was in the slot before.
pub(crate) fn words(lines: &mut [MaybeUninit<Line>]) -> &mut [u64] {
    // SAFETY: shared memory is zero or was written, never uninitialised, and any bits are a line.
    let lines = unsafe { &mut *(std::ptr::from_mut(lines) as *mut [Line]) };
    bytemuck::cast_slice_mut(lines)
}

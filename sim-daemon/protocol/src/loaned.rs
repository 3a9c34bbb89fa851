//! Loaned samples: their payload as plain words, and how they are sent.

use std::fmt::Debug;
use std::mem::MaybeUninit;

use iceoryx2::port::SendError;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::{Service, ZeroCopySend};
use iceoryx2::sample_mut_uninit::SampleMutUninit;

use crate::Line;

/// The words of a loan. Their content is whatever was in the slot before.
pub(crate) fn words(lines: &mut [MaybeUninit<Line>]) -> &mut [u64] {
    // SAFETY: shared memory is zero or was written, never uninitialised, and any bits are a line.
    let lines = unsafe { &mut *(std::ptr::from_mut(lines) as *mut [Line]) };
    bytemuck::cast_slice_mut(lines)
}

/// Sends a loan of `publisher` as it is, and returns its words, which stay as they are until the next loan.
pub(crate) fn send_kept<S: Service, H: Debug + ZeroCopySend>(
    _publisher: &mut Publisher<S, [Line], H>,
    mut loan: SampleMutUninit<S, [MaybeUninit<Line>], H>,
) -> Result<&[u64], SendError> {
    let words: *const [u64] = words(loan.payload_mut());
    send(loan)?;
    // SAFETY: the slot lies in the publisher's segment, which receivers map read-only, and only a loan can hand it out again:
    // there is none while the publisher is borrowed.
    Ok(unsafe { &*words })
}

/// Sends a loan as it is; returns to how many.
pub(crate) fn send<S: Service, H: Debug + ZeroCopySend>(
    loan: SampleMutUninit<S, [MaybeUninit<Line>], H>,
) -> Result<usize, SendError> {
    // SAFETY: as above, whatever was written or not is initialised.
    unsafe { loan.assume_init() }.send()
}

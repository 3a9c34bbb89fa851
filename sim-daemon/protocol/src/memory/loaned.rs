//! Samples: their payload as plain words, checked where it was received, and how loans are sent.

use std::fmt::Debug;
use std::mem::MaybeUninit;

use crate::Line;
use crate::doors::iceoryx2::port::publisher::Publisher;
use crate::doors::iceoryx2::port::{LoanError, SendError};
use crate::doors::iceoryx2::prelude::{Service, ZeroCopySend};
use crate::doors::iceoryx2::sample::Sample;
use crate::doors::iceoryx2::sample_mut_uninit::SampleMutUninit;
use crate::memory::guard::guarded;
use crate::memory::mapping;

/// A slot that is written to.
type Loan<S, H> = SampleMutUninit<S, [MaybeUninit<Line>], H>;

/// The head of a received sample; `None` where its offset, which lies in shared memory too, leads out of it.
#[inline] // here as below: each frame calls it, and the units of code would decide
pub(crate) fn head<S: Service, H: Debug + Copy + ZeroCopySend>(
    sample: &Sample<S, [Line], H>,
) -> Option<H> {
    let head: *const H = sample.user_header();
    // SAFETY: nothing is read before it is known to be mapped.
    (head.is_aligned() && mapping::holds_bytes(head as usize, size_of::<H>()))
        .then(|| unsafe { head.read() })
}

/// The head and the words of a received sample; `None` where offset or length lead out of shared memory.
#[inline]
pub(crate) fn received<S: Service, H: Debug + Copy + ZeroCopySend>(
    sample: &Sample<S, [Line], H>,
) -> Option<(H, &[u64])> {
    // the length lies beside the head
    let head = head(sample)?;
    let payload = sample.payload();
    mapping::holds(payload).then(|| (head, bytemuck::cast_slice(payload)))
}

/// A slot to write to, of so many lines; `None` where shared memory makes no sense.
#[inline]
pub(crate) fn loan<S: Service, H: Debug + Default + ZeroCopySend>(
    publisher: &Publisher<S, [Line], H>,
    lines: usize,
) -> Option<Result<Loan<S, H>, LoanError>> {
    let mut loan = match guarded(|| publisher.loan_slice_uninit(lines))? {
        Ok(loan) => loan,
        Err(error) => return Some(Err(error)),
    };
    if mapping::holds(loan.payload_mut()) {
        return Some(Ok(loan));
    }
    // dropping it would write there
    std::mem::forget(loan);
    None
}

/// The words of a loan. Their content is whatever was in the slot before.
pub(crate) fn words(lines: &mut [MaybeUninit<Line>]) -> &mut [u64] {
    // SAFETY: shared memory is zero or was written, never uninitialised, and any bits are a line.
    let lines = unsafe { &mut *(std::ptr::from_mut(lines) as *mut [Line]) };
    bytemuck::cast_slice_mut(lines)
}

/// Sends a loan of `publisher` as it is, and returns its words, which stay as they are until the next loan.
pub(crate) fn send_kept<S: Service, H: Debug + ZeroCopySend>(
    _publisher: &mut Publisher<S, [Line], H>,
    mut loan: Loan<S, H>,
) -> Result<&[u64], SendError> {
    let words: *const [u64] = words(loan.payload_mut());
    send(loan)?;
    // SAFETY: the slot lies in the publisher's segment, which receivers map read-only, and only a loan can hand it out again:
    // there is none while the publisher is borrowed.
    Ok(unsafe { &*words })
}

/// Sends a loan as it is; returns to how many.
pub(crate) fn send<S: Service, H: Debug + ZeroCopySend>(
    loan: Loan<S, H>,
) -> Result<usize, SendError> {
    // SAFETY: as above, whatever was written or not is initialised.
    unsafe { loan.assume_init() }.send()
}

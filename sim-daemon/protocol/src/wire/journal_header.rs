//! The head of an entry of a journal.

use iceoryx2::prelude::ZeroCopySend;

use crate::ALIGNMENT;

/// In place of an [`crate::Op`]: nothing comes any more, for the reason that is the command's bytes.
pub(crate) const ENDED: u32 = u32::MAX;

/// Head of an entry of a journal.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("tightloop.JournalHeader.v1")]
pub struct JournalHeader {
    /// Run of the daemon.
    pub session: u64,
    /// 0, 1, 2 … within a journal: a number that does not come was lost.
    pub entry: u64,
    /// Bytes of the command; in a piece of a state, bytes of the whole of it.
    pub bytes: u64,
    /// In a piece of a state, the first of its bytes that are here.
    pub first: u64,
    /// Bytes of the arrays observed, each padded to [`ALIGNMENT`].
    pub observed: u64,
    /// The [`crate::Op`] that was carried out; 0: this is a piece of the state of all worlds at this place; [`ENDED`].
    pub op: u32,
    /// Rows in the field table of the command.
    pub rows: u32,
    /// Digests of the frame; 0 where the inputs were set and no client was left to get a frame.
    pub digests: u32,
    /// Zero.
    pub reserved: u32,
}
const _: () = assert!(size_of::<JournalHeader>() == 56 && align_of::<JournalHeader>() == 8);

impl JournalHeader {
    /// Whether this is a piece of the state of all worlds.
    pub fn is_state(&self) -> bool {
        self.op == 0
    }

    /// Whether this says why nothing comes any more.
    pub fn is_end(&self) -> bool {
        self.op == ENDED
    }

    /// Bytes of command or piece, of digests and of arrays as they lie in a payload of `payload` bytes, each from the next
    /// line on; `None` when they do not fit there.
    pub(crate) fn parts(&self, payload: usize) -> Option<[usize; 3]> {
        let padded = |bytes: usize| bytes.checked_next_multiple_of(ALIGNMENT);
        let (bytes, first) = (
            usize::try_from(self.bytes).ok()?,
            usize::try_from(self.first).ok()?,
        );
        let body = if self.is_state() {
            bytes.checked_sub(first)?.min(payload)
        } else {
            bytes
        };
        let digests = (self.digests as usize).checked_mul(size_of::<u32>())?;
        let observed = usize::try_from(self.observed).ok()?;
        let needed = padded(body)?
            .checked_add(padded(digests)?)?
            .checked_add(observed)?;
        let is_words = !self.is_state() && !self.is_end();
        let fits = needed <= payload && (!is_words || body % 8 == 0) && observed % 8 == 0;
        fits.then_some([body, digests, observed])
    }
}

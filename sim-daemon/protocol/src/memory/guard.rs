//! Calls into the transport, which trusts shared memory: an index out of it that is wrong makes it panic.
//!
//! Such a panic costs what the call was about, a client or a frame, and not the process. Its message goes to stderr.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What the transport returns; `None` when it panicked.
#[inline]
pub(crate) fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    // ports that panicked are dropped, or looked at again from the start
    catch_unwind(AssertUnwindSafe(call)).ok()
}

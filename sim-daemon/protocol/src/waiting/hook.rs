//! What a caller does while a call waits.

use std::ops::ControlFlow;

/// Called at least every 50 ms while a call waits; `Break` ends the call with [`ProtocolError::Interrupted`].
pub type Hook<'a> = &'a mut dyn FnMut() -> ControlFlow<()>;

/// A [`Hook`] that never interrupts.
pub fn keep_waiting() -> impl FnMut() -> ControlFlow<()> {
    || ControlFlow::Continue(())
}

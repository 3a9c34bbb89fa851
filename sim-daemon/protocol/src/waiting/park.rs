//! Sleep until something is notified.

use std::time::Duration;

use crate::ProtocolError;
use crate::doors::iceoryx2::port::listener::{Listener, ListenerWaitError};
use crate::doors::iceoryx2::prelude::Service;
use crate::doors::iceoryx2_bb_posix::file_descriptor::FileDescriptorBased;
use crate::doors::system::files::wait_readable;

/// Sleeps until notified or for `timeout`, and drains what was notified. A signal ends it early.
///
/// The listener's own wait rounds its timeout up to ticks of the scheduler, 4 ms on many kernels.
pub(crate) fn park<S: Service>(
    listener: &Listener<S>,
    timeout: Duration,
) -> Result<(), ProtocolError>
where
    Listener<S>: FileDescriptorBased,
{
    let failed = |error: &dyn std::fmt::Debug| ProtocolError::transport("wait for an event", error);
    // SAFETY: it is closed by nobody but the listener.
    let descriptor = unsafe { listener.file_descriptor().native_handle() };
    // SAFETY: the listener owns the descriptor, and is borrowed until the end.
    match unsafe { wait_readable(descriptor, timeout) } {
        Some(Ok(false)) => return Ok(()),
        Some(Ok(true)) => {}
        Some(Err(error)) => return Err(failed(&error)),
        None => {
            return match listener.timed_wait(|_| {}, timeout) {
                Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
                Err(error) => Err(failed(&error)),
            };
        }
    }
    match listener.try_wait(|_| {}) {
        Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
        Err(error) => Err(failed(&error)),
    }
}

//! Sleep until something is notified.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::prelude::Service;
use iceoryx2_bb_posix::file_descriptor::FileDescriptorBased;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::time::Timespec;

use crate::ProtocolError;

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
    // SAFETY: the listener owns the descriptor, and is borrowed until the end.
    let socket = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
    let timeout = Timespec {
        tv_sec: timeout.as_secs() as i64,
        tv_nsec: timeout.subsec_nanos().into(),
    };
    match poll(&mut [PollFd::new(&socket, PollFlags::IN)], Some(&timeout)) {
        Ok(0) | Err(Errno::INTR) => return Ok(()),
        Ok(_) => {}
        Err(error) => return Err(failed(&error)),
    }
    match listener.try_wait(|_| {}) {
        Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
        Err(error) => Err(failed(&error)),
    }
}

//! Ports that another port could not be connected to. The transport goes on without them, so that a process that waits for a
//! message of theirs would wait in vain.

use std::cell::RefCell;

use crate::ProtocolError;
use crate::doors::iceoryx2::port::{
    DegradationAction, DegradationCause, DegradationFn, DegradationInfo,
};

/// Most that one thread keeps, the newest: threads of a client that only send look at none.
const KEPT: usize = 64;

crate::doors::thread_local! {
    static UNREACHED: RefCell<Vec<Unreached>> = const { RefCell::new(Vec::new()) };
}

/// A port of another process that this thread could not reach.
#[derive(Debug)]
pub(crate) struct Unreached {
    pub(crate) port: u128,
    pub(crate) error: ProtocolError,
}

/// Notes the senders that a port cannot receive from.
pub(super) fn senders() -> impl DegradationFn + 'static {
    noting(|connection| connection.sender_port_id)
}

/// Notes the receivers that a port cannot send to.
pub(super) fn receivers() -> impl DegradationFn + 'static {
    noting(|connection| connection.receiver_port_id)
}

fn noting(other: fn(&DegradationInfo) -> u128) -> impl DegradationFn + 'static {
    move |cause, connection| {
        if let DegradationCause::FailedToEstablishConnection = cause {
            // the cause is that of the file which this thread opened last
            let problem = format_args!("no connection to its memory");
            let error = ProtocolError::transport("reach the other side", problem);
            let port = other(connection);
            UNREACHED.with(|noted| {
                let mut noted = noted.borrow_mut();
                noted.truncate(KEPT - 1);
                noted.insert(0, Unreached { port, error });
            });
        }
        DegradationAction::Warn
    }
}

/// Those noted on this thread since the last call, the newest first.
pub(crate) fn take() -> Vec<Unreached> {
    UNREACHED.with(RefCell::take)
}

/// Makes a port, which is of no use if it does not reach those that are there.
pub(super) fn reaching<T>(
    make: impl FnOnce() -> Result<T, ProtocolError>,
) -> Result<T, ProtocolError> {
    let before = take();
    let port = make();
    let noted = UNREACHED.with(|noted| noted.replace(before));
    match noted.into_iter().next() {
        Some(Unreached { error, .. }) => port.and(Err(error)),
        None => port,
    }
}

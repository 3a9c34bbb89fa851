//! Ports.

pub mod client;
pub mod listener;
mod loan;
pub mod notifier;
pub mod publisher;
pub mod server;
pub mod subscriber;
pub mod update_connections;

pub use crate::iceoryx2::degradation::{
    DegradationAction, DegradationCause, DegradationFn, DegradationInfo,
};
pub use ::iceoryx2::port::LoanError;
pub(crate) use loan::{Borrow, Loan};

use update_connections::ConnectionFailure;

/// Why a sample was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SendError {
    /// The port is gone.
    ConnectionBrokenSinceSenderNoLongerExists,
    /// No slot.
    LoanError(LoanError),
    /// A receiver cannot be reached.
    ConnectionError(ConnectionFailure),
}

/// Why nothing was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReceiveError {
    /// Too many samples are held.
    ExceedsMaxBorrows,
    /// A sender cannot be reached.
    ConnectionFailure(ConnectionFailure),
}

//! Only Linux shares device memory between processes: here each request is refused.

use std::convert::Infallible;
use std::time::Duration;

use super::Delivery;
use crate::ProtocolError;
use crate::presence::paths::DaemonPaths;
use crate::waiting::hook::Hook;

const REASON: &str = "this needs Linux";

/// There is no connection.
pub(crate) type Visitor = Infallible;

/// The daemon's end, which nobody reaches.
#[derive(Debug)]
pub(crate) struct Door;

impl Door {
    /// Opens nothing.
    pub(crate) fn open(_paths: &DaemonPaths, _session: u64) -> Result<Door, ProtocolError> {
        Ok(Door)
    }

    /// Nobody has connected.
    pub(crate) fn visitor(&self, _epoch: u64) -> Result<Visitor, String> {
        Err(REASON.to_owned())
    }
}

/// Answers a visitor, of whom there is none.
pub(crate) fn deliver(visitor: &Visitor, _answer: Result<Delivery, String>) {
    match *visitor {}
}

/// Refuses to connect.
pub(crate) fn visit(
    _paths: &DaemonPaths,
    _session: u64,
    _epoch: u64,
) -> Result<Visitor, ProtocolError> {
    let reason = REASON.to_owned();
    Err(ProtocolError::NotShared { reason })
}

/// Waits for no answer.
pub(crate) fn receive(
    visitor: &Visitor,
    _limit: Duration,
    _hook: Hook<'_>,
) -> Result<Option<Delivery>, ProtocolError> {
    match *visitor {}
}

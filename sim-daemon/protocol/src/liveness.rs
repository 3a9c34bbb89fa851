//! Is the daemon that we attached to still there?

use std::time::Duration;

use crate::ProtocolError;
use crate::paths::{Beacon, DaemonPaths, Presence};

/// The daemon that a client attached to.
#[derive(Debug, Clone)]
pub(crate) struct Peer {
    pub(crate) paths: DaemonPaths,
    pub(crate) beacon: Beacon,
}

impl Peer {
    /// Errors when the daemon ended, was killed, or is another one than it was. A few microseconds.
    pub(crate) fn check(&self) -> Result<(), ProtocolError> {
        match self.paths.presence() {
            Presence::Running(beacon) if beacon.session == self.beacon.session => Ok(()),
            Presence::Running(_) => Err(ProtocolError::DaemonRestarted {
                name: self.paths.name().to_owned(),
            }),
            // ours has announced itself: one that is starting, or cleaning up, is another
            Presence::Absent | Presence::Starting => Err(self.lost()),
        }
    }

    pub(crate) fn lost(&self) -> ProtocolError {
        ProtocolError::DaemonLost {
            name: self.paths.name().to_owned(),
            pid: self.beacon.pid,
        }
    }

    pub(crate) fn lease_lost(&self) -> ProtocolError {
        ProtocolError::LeaseLost {
            name: self.paths.name().to_owned(),
        }
    }

    pub(crate) fn timeout(&self, waited: Duration) -> ProtocolError {
        ProtocolError::Timeout {
            name: self.paths.name().to_owned(),
            pid: self.beacon.pid,
            seconds: waited.as_secs_f64(),
        }
    }
}

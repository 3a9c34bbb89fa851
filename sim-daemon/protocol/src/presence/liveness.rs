//! Is the daemon that we attached to still there?

use std::path::PathBuf;
use std::time::Duration;

use crate::ProtocolError;
use crate::doors::exists;
use crate::doors::fs::File;
use crate::doors::sync::Arc;
use crate::presence::described::{self, Damage};
use crate::presence::paths::{Beacon, DaemonPaths, Presence};

/// The daemon that a client attached to.
#[derive(Debug, Clone)]
pub(crate) struct Peer {
    pub(crate) paths: DaemonPaths,
    pub(crate) beacon: Beacon,
    /// Its lock file. A logout may remove the file's name while the daemon lives on, and holds the lock.
    lock: Arc<File>,
    /// The file that says that its shared memory is damaged.
    damage: PathBuf,
}

/// Where the daemon says that it cannot reach a port of ours.
#[derive(Debug)]
pub(crate) struct Reach(PathBuf);

impl Peer {
    /// Opens the lock file of a daemon that was seen to run.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`] when it ended meanwhile; as [`DaemonPaths::presence`].
    pub(crate) fn find(paths: DaemonPaths, beacon: Beacon) -> Result<Peer, ProtocolError> {
        let Some(lock) = paths.open_lock()? else {
            return Err(lost(&paths, beacon));
        };
        let lock = Arc::new(lock);
        let damage = described::mark(&paths, beacon.session, Damage::Daemon);
        Ok(Peer {
            damage,
            paths,
            beacon,
            lock,
        })
    }

    /// Errors when the daemon ended, was killed, or is another one than it was. A microsecond; opens nothing while it lives.
    pub(crate) fn check(&self) -> Result<(), ProtocolError> {
        let restarted = || ProtocolError::DaemonRestarted {
            name: self.paths.name().to_owned(),
        };
        match self.presence()? {
            Presence::Running(beacon) if beacon.session == self.beacon.session => Ok(()),
            Presence::Running(_) => Err(restarted()),
            // ours has announced itself: one that is starting, or cleaning up, is another
            Presence::Absent | Presence::Silent | Presence::Starting => {
                match self.paths.presence() {
                    Ok(Presence::Running(_)) => Err(restarted()),
                    _ => Err(lost(&self.paths, self.beacon)),
                }
            }
        }
    }

    /// What the lock file says that was there at first.
    pub(crate) fn presence(&self) -> Result<Presence, ProtocolError> {
        self.paths.presence_in(&self.lock)
    }

    /// Whether the daemon has found its own shared memory damaged. A microsecond.
    pub(crate) fn is_damaged(&self) -> bool {
        exists(&self.damage)
    }

    /// What [`Peer::check_reach`] looks at for a port.
    pub(crate) fn reach(&self, port: u128) -> Reach {
        Reach(described::unreached(&self.paths, self.beacon.session, port))
    }

    /// Errors when the daemon has found that it cannot reach one of our ports.
    pub(crate) fn check_reach(&self, ports: &[Reach]) -> Result<(), ProtocolError> {
        let why = |Reach(path): &Reach| described::why_unreached(path);
        match ports.iter().find_map(why) {
            None => Ok(()),
            Some(problem) => Err(ProtocolError::Unreached {
                name: self.paths.name().to_owned(),
                pid: self.beacon.pid,
                problem,
            }),
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

fn lost(paths: &DaemonPaths, beacon: Beacon) -> ProtocolError {
    ProtocolError::DaemonLost {
        name: paths.name().to_owned(),
        pid: beacon.pid,
    }
}

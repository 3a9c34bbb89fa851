//! Looking for a daemon by its name.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::hook::Hook;
use crate::paths::{Beacon, DaemonPaths, Presence, running};
use crate::{PROTOCOL_VERSION, ProtocolError};

/// How to attach.
#[derive(Debug, Clone, Default)]
pub struct AttachOptions {
    /// Root folder; [`crate::paths::default_root`] when `None`.
    pub root: Option<PathBuf>,
    /// How long to wait for a daemon that does not run yet.
    pub wait: Duration,
}

/// Looks for the daemon, or group, `name`, as [`crate::Client::attach`] does, and returns its beacon.
///
/// # Errors
/// [`ProtocolError::NoDaemon`], [`ProtocolError::ProtocolVersion`], [`ProtocolError::BadName`],
/// [`ProtocolError::Interrupted`].
pub fn find(name: &str, options: &AttachOptions, hook: Hook<'_>) -> Result<Beacon, ProtocolError> {
    let paths = DaemonPaths::new(options.root.as_deref(), name)?;
    let deadline = Instant::now() + options.wait;
    let beacon = loop {
        match paths.presence() {
            Presence::Running(beacon) => break beacon,
            Presence::Absent if Instant::now() >= deadline => {
                let names = running(Some(paths.root()))?;
                let running = if names.is_empty() {
                    "none".to_owned()
                } else {
                    names.join(", ")
                };
                return Err(ProtocolError::NoDaemon {
                    name: name.to_owned(),
                    root: paths.root().into(),
                    running,
                });
            }
            _ => {}
        }
        if hook().is_break() {
            return Err(ProtocolError::Interrupted);
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    if beacon.protocol != PROTOCOL_VERSION {
        let (daemon, client) = (beacon.protocol, PROTOCOL_VERSION);
        return Err(ProtocolError::ProtocolVersion {
            name: name.to_owned(),
            daemon,
            client,
        });
    }
    Ok(beacon)
}

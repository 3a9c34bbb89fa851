//! Looking for a daemon by its name.

use std::time::{Duration, Instant};

use crate::client::{AttachOptions, Hook};
use crate::place::{Beacon, Place, Presence, running};
use crate::{PROTOCOL_VERSION, ProtocolError};

/// Looks for the daemon, or group, `name`, as [`Client::attach`] does, and tells what it says of itself.
///
/// # Errors
/// [`ProtocolError::NoDaemon`], [`ProtocolError::ProtocolVersion`], [`ProtocolError::BadName`],
/// [`ProtocolError::Interrupted`].
pub fn find(name: &str, options: &AttachOptions, hook: Hook<'_>) -> Result<Beacon, ProtocolError> {
    let place = Place::new(options.root.as_deref(), name)?;
    let deadline = Instant::now() + options.wait;
    let beacon = loop {
        match place.presence() {
            Presence::Running(beacon) => break beacon,
            Presence::Absent if Instant::now() >= deadline => {
                let names = running(Some(place.root()))?;
                let running = if names.is_empty() {
                    "none".to_owned()
                } else {
                    names.join(", ")
                };
                return Err(ProtocolError::NoDaemon {
                    name: name.to_owned(),
                    root: place.root().into(),
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

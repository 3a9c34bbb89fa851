//! Looking for a daemon by its name.

use std::path::PathBuf;
use std::time::Duration;

use crate::doors::time::Instant;
use crate::presence::paths::{Beacon, DaemonPaths, Presence, running};
use crate::waiting::hook::Hook;
use crate::{PROTOCOL_VERSION, ProtocolError};

/// How long a lock is waited for whose holder does not say who it is.
const SILENCE_MAX: Duration = Duration::from_secs(2);
/// How long a daemon is waited for that still starts, where nobody says how long.
const START_MAX: Duration = Duration::from_secs(10);

/// How to attach.
#[derive(Debug, Clone, Default)]
pub struct AttachOptions {
    /// Root folder; [`crate::presence::paths::default_root`] when `None`.
    pub root: Option<PathBuf>,
    /// How long to wait for a daemon that does not run yet; zero gives one that starts already 10 s.
    pub wait: Duration,
}

/// Looks for the daemon, or group, `name`, as [`crate::Client::attach`] does, and returns its beacon.
///
/// # Errors
/// [`ProtocolError::NoDaemon`], [`ProtocolError::ProtocolVersion`], [`ProtocolError::BadName`],
/// [`ProtocolError::Interrupted`]; [`ProtocolError::Starting`] when the daemon is not ready in time, and
/// [`ProtocolError::Silent`] when somebody holds the name for too long and does not run.
pub fn find(name: &str, options: &AttachOptions, hook: Hook<'_>) -> Result<Beacon, ProtocolError> {
    let paths = DaemonPaths::new(options.root.as_deref(), name)?;
    let (deadline, mut since, mut seen) = (Instant::now() + options.wait, Instant::now(), None);
    let beacon = loop {
        let presence = paths.presence()?;
        if seen != Some(presence) {
            (since, seen) = (Instant::now(), Some(presence));
        }
        let start_end = match options.wait.is_zero() {
            true => since + START_MAX,
            false => deadline,
        };
        let silence_max = SILENCE_MAX.max(options.wait);
        match presence {
            Presence::Running(beacon) => break beacon,
            Presence::Starting if Instant::now() >= start_end => {
                return Err(ProtocolError::Starting {
                    name: name.to_owned(),
                    seconds: since.elapsed().as_secs_f64(),
                });
            }
            Presence::Silent if since.elapsed() > silence_max => {
                return Err(ProtocolError::Silent {
                    name: name.to_owned(),
                    path: paths.lock_path(),
                    seconds: since.elapsed().as_secs(),
                });
            }
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
        crate::doors::thread::sleep(Duration::from_millis(2));
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

#[cfg(all(test, not(simulated)))]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::presence::daemon_lock::DaemonLock;

    /// Longer than anybody waits here.
    const LONG: Duration = Duration::from_secs(6);

    #[test]
    fn who_holds_a_name_and_does_not_serve_is_waited_for_and_not_for_ever() {
        let root = std::env::temp_dir().join(format!("tightloop-found-{}", std::process::id()));
        let paths = DaemonPaths::new(Some(&root), "held").unwrap();
        let look = |wait| {
            let (root, start) = (Some(root.clone()), Instant::now());
            let mut hook = || match start.elapsed() < LONG {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            let refused = find("held", &AttachOptions { root, wait }, &mut hook).unwrap_err();
            (refused, start.elapsed())
        };
        let held = DaemonLock::take(&paths).unwrap();
        let wait = Duration::from_millis(100);
        let (refused, took) = look(wait);
        assert!(
            matches!(refused, ProtocolError::Starting { .. }),
            "{refused}"
        );
        assert!(took >= wait, "{took:?}");
        held.withdraw();
        let (refused, took) = look(wait);
        assert!(matches!(refused, ProtocolError::Silent { .. }), "{refused}");
        assert!(took >= SILENCE_MAX, "{took:?}");
        drop(held);
        let (refused, took) = look(wait);
        assert!(
            matches!(refused, ProtocolError::NoDaemon { .. }),
            "{refused}"
        );
        assert!(took >= wait, "{took:?}");
        std::fs::remove_dir(&root).unwrap();
    }
}

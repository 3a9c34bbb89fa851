//! Stopping a daemon that may be too busy to answer: by a file that its watchdog sees.

use std::time::Duration;

use crate::ProtocolError;
use crate::doors::time::Instant;
use crate::presence::daemon_lock::remove_own_root;
use crate::presence::discovery::{AttachOptions, find};
use crate::presence::paths::{DaemonPaths, Presence};
use crate::waiting::hook::Hook;

/// A daemon that hears the request is gone within 2 s; this is for one whose process is stopped.
const END_MAX: Duration = Duration::from_secs(10);

/// A request to stop. Dropping it takes it back where no daemon is left that could.
pub(crate) struct Asked<'a>(&'a DaemonPaths);

impl Drop for Asked<'_> {
    fn drop(&mut self) {
        if matches!(self.0.presence(), Ok(Presence::Absent)) {
            let _ = crate::doors::fs::remove_file(self.0.stop_path());
            remove_own_root(self.0.root());
        }
    }
}

/// Asks the daemon at this place to stop, whatever it does.
pub(crate) fn asked(paths: &DaemonPaths) -> Result<Asked<'_>, ProtocolError> {
    match paths.ask_to_stop() {
        // the last daemon takes the folder with it
        Err(error) if !matches!(paths.presence(), Ok(Presence::Absent)) => Err(error),
        _ => Ok(Asked(paths)),
    }
}

/// Ends the daemon `name`, with all of its groups, also while it starts or is busy. Returns when it is gone.
///
/// # Errors
/// Those of [`find`] when there is none; [`ProtocolError::Silent`] when it does not end; [`ProtocolError::Interrupted`].
pub fn stop(name: &str, options: &AttachOptions, hook: Hook<'_>) -> Result<(), ProtocolError> {
    let paths = DaemonPaths::new(options.root.as_deref(), name)?.daemon()?;
    // one that starts has no version yet
    let running = match paths.presence()? {
        Presence::Starting => None,
        _ => {
            find(name, options, &mut *hook)?;
            // of a group's daemon, whose run has another number
            Some(find(paths.name(), options, &mut *hook)?)
        }
    };
    let _asked = asked(&paths)?;
    let start = Instant::now();
    // where it was killed, the next one may have the name at once, and hears no request that was there before
    let lasts = |presence| match (presence, running) {
        (Presence::Absent, _) | (Presence::Starting, Some(_)) => false,
        (Presence::Running(beacon), Some(asked)) => beacon.session == asked.session,
        _ => true,
    };
    while lasts(paths.presence()?) {
        if start.elapsed() > END_MAX {
            return Err(ProtocolError::Silent {
                name: name.to_owned(),
                path: paths.lock_path(),
                seconds: start.elapsed().as_secs(),
            });
        }
        if hook().is_break() {
            return Err(ProtocolError::Interrupted);
        }
        crate::doors::thread::sleep(Duration::from_millis(2));
    }
    Ok(())
}

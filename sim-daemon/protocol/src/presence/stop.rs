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

#[cfg(all(test, not(simulated)))]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::doors::fs;
    use crate::presence::daemon_lock::DaemonLock;
    use crate::waiting::hook::keep_waiting;

    fn root(test: &str) -> PathBuf {
        std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()))
    }

    #[test]
    fn who_stops_a_daemon_does_not_wait_for_the_next_one_of_its_name() {
        let root = root("stop");
        let paths = DaemonPaths::new(Some(&root), "stop").unwrap();
        let mut held = DaemonLock::take(&paths).unwrap();
        held.announce(7, 1).unwrap();
        let options = AttachOptions {
            root: Some(root.clone()),
            ..AttachOptions::default()
        };
        std::thread::scope(|scope| {
            let stops = scope.spawn(|| stop("stop", &options, &mut keep_waiting()));
            while !paths.is_asked_to_stop() && !stops.is_finished() {
                std::thread::yield_now();
            }
            held.announce(8, 1).unwrap();
            stops.join().unwrap().unwrap();
        });
        drop(held);
        fs::remove_dir(&root).unwrap();
    }

    #[test]
    fn a_request_that_no_daemon_is_left_to_hear_is_taken_back() {
        let root = root("unheard");
        let paths = DaemonPaths::new(Some(&root), "unheard").unwrap();
        let held = DaemonLock::take(&paths).unwrap();
        drop(asked(&paths).unwrap());
        assert!(paths.is_asked_to_stop(), "a daemon hears it");
        drop(held);
        let unheard = asked(&paths).unwrap();
        assert!(paths.is_asked_to_stop());
        drop(unheard);
        assert!(!paths.is_asked_to_stop());
        fs::remove_dir(&root).unwrap();
    }

    #[test]
    fn who_stops_a_group_waits_for_its_daemon() {
        let root = root("group");
        let paths = DaemonPaths::new(Some(&root), "many").unwrap();
        let mut held = DaemonLock::take(&paths).unwrap();
        let mut group = DaemonLock::take(&paths.group(1).unwrap()).unwrap();
        group.announce(9, 1).unwrap();
        held.announce(7, 2).unwrap();
        let options = AttachOptions {
            root: Some(root.clone()),
            ..AttachOptions::default()
        };
        std::thread::scope(|scope| {
            let stops = scope.spawn(|| stop("many.1", &options, &mut keep_waiting()));
            while !paths.is_asked_to_stop() && !stops.is_finished() {
                std::thread::yield_now();
            }
            // it looks every 2 ms
            std::thread::sleep(Duration::from_millis(50));
            assert!(!stops.is_finished(), "the daemon is still there");
            drop(group);
            drop(held);
            stops.join().unwrap().unwrap();
        });
        fs::remove_dir(&root).unwrap();
    }
}

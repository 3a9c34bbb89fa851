//! What a daemon watches from its start to its end, beside its loop: requests to stop, and the death of its parent.
//!
//! A request to stop sets the flag that loops look at. A daemon that is not gone soon after, since one long piece of work
//! keeps it, is ended at once: its files go first.

use std::convert::Infallible;
use std::time::Duration;

use crate::doors::sync::atomic::{AtomicBool, Ordering};
use crate::doors::sync::mpsc::{Receiver, RecvTimeoutError};
use crate::doors::sync::{Arc, Mutex, MutexGuard, PoisonError};
use crate::doors::system::process;
use crate::doors::time::Instant;
use crate::presence::daemon_lock::{DaemonLock, Remains};

/// Each look takes microseconds.
const PERIOD: Duration = Duration::from_millis(25);
/// An orderly end takes at most this long after the first request, else it is ended here.
const GRACE: Duration = Duration::from_millis(1400);
/// The same after the death of our parent, which nobody waits for, and after a second signal that comes at once.
const GRACE_SHORT: Duration = Duration::from_millis(700);
/// A signal this long after the first one ends at once: a terminal that closes sends several together.
const AGAIN: Duration = Duration::from_millis(150);

/// The places of a daemon and its groups, which go with it.
#[derive(Debug, Clone, Default)]
pub struct Places(Arc<Mutex<Vec<Remains>>>);

/// What is watched.
#[derive(Debug)]
pub struct Watch {
    /// Set when somebody asks the daemon to stop, here or by a signal.
    pub stop: Arc<AtomicBool>,
    /// A signal came; taken back here, so that the next one shows.
    pub signalled: Arc<AtomicBool>,
    /// The process that must not die before, if any.
    pub parent: Option<u32>,
    /// A file in the first of them asks to stop.
    pub places: Places,
}

impl Places {
    /// From now on, this place is ours, and its files go with us.
    pub fn keep(&self, place: &DaemonLock) {
        self.list().push(place.remains());
    }

    /// Removes their files, for a process that ends; another daemon may take the name then.
    pub fn remove(&self) {
        let list = self.list();
        list.iter().rev().for_each(Remains::remove);
        // nothing is kept any more
        std::mem::forget(list);
    }

    fn list(&self) -> MutexGuard<'_, Vec<Remains>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Watch {
    /// Looks until the other end of `ended` is gone. `end` ends the process, for the reason given.
    pub fn run(&self, ended: &Receiver<()>, end: impl Fn(&str) -> Infallible) {
        // when somebody first asked, and when the end is due
        let mut asked: Option<(Instant, Instant)> = None;
        while ended.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
            let now = Instant::now();
            let is_orphan = self.parent.is_some_and(process::is_orphan);
            let is_signalled = self.signalled.swap(false, Ordering::Relaxed);
            if is_orphan || is_signalled || self.is_asked_by_file() {
                self.stop.store(true, Ordering::Relaxed);
            }
            if !self.stop.load(Ordering::Relaxed) {
                continue;
            }
            let is_first = asked.is_none();
            let (first, due) = asked.get_or_insert((now, now + GRACE));
            if is_orphan || is_signalled && !is_first {
                *due = (*due).min(now + GRACE_SHORT);
            }
            if is_signalled && now.duration_since(*first) >= AGAIN {
                end("a second signal came");
            }
            if now >= *due {
                end("it did not reach a place to stop in time");
            }
        }
    }

    fn is_asked_by_file(&self) -> bool {
        let places = self.places.list();
        places
            .first()
            .is_some_and(|place| place.paths().is_asked_to_stop())
    }
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_signal_asks_the_loops_of_a_daemon_to_stop() {
        let (end, ended) = channel();
        let watch = Watch {
            stop: Arc::default(),
            signalled: Arc::new(AtomicBool::new(true)),
            parent: None,
            places: Places::default(),
        };
        let stop = Arc::clone(&watch.stop);
        let waits = std::thread::spawn(move || {
            let start = Instant::now();
            while !stop.load(Ordering::Relaxed) && start.elapsed() < GRACE / 2 {
                std::thread::yield_now();
            }
            drop(end);
        });
        watch.run(&ended, |reason| panic!("{reason}"));
        waits.join().unwrap();
        assert!(watch.stop.load(Ordering::Relaxed));
    }

    #[test]
    fn no_place_is_kept_after_the_files_of_all_were_removed() {
        let places = Places::default();
        places.remove();
        assert!(
            places.0.try_lock().is_err(),
            "another thread could keep one"
        );
    }
}

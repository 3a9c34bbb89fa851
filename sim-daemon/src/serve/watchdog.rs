//! A thread that starts before anything else: it hears signals, `tightloop stop` and the death of our parent in every state.
//!
//! A request to stop sets the flag that loops look at. A daemon that is not gone soon after, since one long piece of work
//! keeps it, is ended here: its files go first.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sim_protocol::daemon_lock::{DaemonLock, Remains};
use sim_system::{process, signals};

use crate::cli::Serve;
use crate::error::DaemonError;
use crate::printer::{self, Printer};

/// Each look takes microseconds.
const PERIOD: Duration = Duration::from_millis(25);
/// An orderly end takes at most this long after the first request, else it is ended here.
const GRACE: Duration = Duration::from_millis(1400);
/// The same after the death of our parent, which nobody waits for, and after a second signal that comes at once.
const GRACE_SHORT: Duration = Duration::from_millis(700);
/// A signal this long after the first one ends at once: a terminal that closes sends several together.
const AGAIN: Duration = Duration::from_millis(150);
/// Longest wait for the last message.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// The running thread; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Watchdog {
    stop: Arc<AtomicBool>,
    places: Arc<Mutex<Vec<Remains>>>,
    /// Nothing is sent: the thread sees that it is gone.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// What the thread watches.
struct Watch {
    stop: Arc<AtomicBool>,
    /// A signal came; taken back here, so that the next one shows.
    signalled: Arc<AtomicBool>,
    parent: Option<u32>,
    places: Arc<Mutex<Vec<Remains>>>,
    stderr: Printer,
}

impl Watchdog {
    /// Starts watching: signals, and whether our parent is still the one that launched us.
    pub(crate) fn start(serve: &Serve, stderr: &Printer) -> Result<Watchdog, DaemonError> {
        let stop = Arc::new(AtomicBool::new(false));
        let signalled = Arc::new(AtomicBool::new(false));
        for flag in [&stop, &signalled] {
            signals::on_stop(flag).map_err(|error| DaemonError::System {
                action: "handle signals",
                problem: error.to_string(),
            })?;
        }
        let places = Arc::new(Mutex::new(Vec::new()));
        let watch = Watch {
            stop: Arc::clone(&stop),
            signalled,
            parent: serve.parent,
            places: Arc::clone(&places),
            stderr: stderr.clone(),
        };
        let (end, ended) = channel();
        let priority = serve.priority;
        let work = move || {
            // threads that step at that priority would leave it no core; a client that asks for one gets an error if it is not granted
            let _ = priority.map(signals::set_priority);
            watch.run(&ended);
        };
        let thread = std::thread::Builder::new()
            .name("tightloop-watchdog".to_owned())
            .spawn(work)
            .map_err(|error| DaemonError::System {
                action: "start a thread",
                problem: error.to_string(),
            })?;
        Ok(Watchdog {
            stop,
            places,
            end: Some(end),
            thread: Some(thread),
        })
    }

    /// The flag that is set when somebody asks us to stop.
    pub(crate) fn stop(&self) -> &Arc<AtomicBool> {
        &self.stop
    }

    /// From now on, this place is ours, and its files go with us. A request to stop the first one stops us.
    pub(crate) fn keep(&self, place: &DaemonLock) {
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        places.push(place.remains());
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            // a panic there has been printed on stderr already
            let _ = thread.join();
        }
    }
}

impl Watch {
    fn run(&self, ended: &Receiver<()>) {
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
                self.end("a second signal came");
            }
            if now >= *due {
                self.end("it did not reach a place to stop in time");
            }
        }
    }

    fn is_asked_by_file(&self) -> bool {
        let places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        places
            .first()
            .is_some_and(|place| place.paths().is_asked_to_stop())
    }

    /// Ends the process, whatever its other threads do.
    fn end(&self, reason: &str) -> ! {
        self.stderr
            .print(format!("tightloop: ended at once: {reason}\n"));
        printer::flush_within(LAST_WORDS, [&self.stderr]);
        // last: another daemon may take the name then
        let places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        places.iter().rev().for_each(Remains::remove);
        sim_engine::options::leave_at_once(1)
    }
}

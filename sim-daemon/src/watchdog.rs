//! A thread beside the loop: it sees the death of our parent and of clients, also while a step takes long.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sim_protocol::host::ClientCleanup;
use sim_system::process;

use crate::error::DaemonError;

/// Asking for our parent's process takes no time: an orphan ends within 100 ms.
const PARENT_PERIOD: Duration = Duration::from_millis(25);
/// Looking for dead clients takes 0.3 ms.
const CLEAN_PERIOD: Duration = Duration::from_millis(100);

/// The running thread; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Watchdog {
    end: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Starts watching. `stop` is set when `parent` is no longer our parent.
    pub(crate) fn start(
        stop: Arc<AtomicBool>,
        parent: Option<u32>,
        mut cleanup: ClientCleanup,
    ) -> Result<Watchdog, DaemonError> {
        let end = Arc::new((Mutex::new(false), Condvar::new()));
        let theirs = Arc::clone(&end);
        let watch = move || {
            let (ended, signal) = &*theirs;
            let mut cleaned = Instant::now();
            let mut guard = ended.lock().unwrap_or_else(PoisonError::into_inner);
            while !*guard {
                if parent.is_some_and(process::is_orphan) {
                    stop.store(true, Ordering::Relaxed);
                }
                if cleaned.elapsed() >= CLEAN_PERIOD {
                    cleanup.clean();
                    cleaned = Instant::now();
                }
                let period = if parent.is_some() {
                    PARENT_PERIOD
                } else {
                    CLEAN_PERIOD
                };
                guard = signal
                    .wait_timeout(guard, period)
                    .unwrap_or_else(PoisonError::into_inner)
                    .0;
            }
        };
        let thread = std::thread::Builder::new()
            .name("tightloop-watchdog".to_owned())
            .spawn(watch)
            .map_err(|error| DaemonError::System {
                action: "start a thread",
                problem: error.to_string(),
            })?;
        Ok(Watchdog {
            end,
            thread: Some(thread),
        })
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        *self.end.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.end.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // a panic there has been printed on stderr already
            let _ = thread.join();
        }
    }
}

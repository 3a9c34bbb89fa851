//! A thread beside the loop of a group: it cleans up after dead clients, also while a step takes long.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sim_protocol::host::ClientCleanup;

use crate::error::DaemonError;

/// Looking for dead clients takes 0.3 ms.
const CLEAN_PERIOD: Duration = Duration::from_millis(100);

/// The running thread; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Janitor {
    end: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Janitor {
    /// Starts cleaning.
    pub(crate) fn start(mut cleanup: ClientCleanup) -> Result<Janitor, DaemonError> {
        let end = Arc::new((Mutex::new(false), Condvar::new()));
        let theirs = Arc::clone(&end);
        let watch = move || {
            let (ended, signal) = &*theirs;
            let mut cleaned = Instant::now();
            let mut guard = ended.lock().unwrap_or_else(PoisonError::into_inner);
            while !*guard {
                if cleaned.elapsed() >= CLEAN_PERIOD {
                    cleanup.clean();
                    cleaned = Instant::now();
                }
                guard = signal
                    .wait_timeout(guard, CLEAN_PERIOD)
                    .unwrap_or_else(PoisonError::into_inner)
                    .0;
            }
        };
        let thread = std::thread::Builder::new()
            .name("tightloop-janitor".to_owned())
            .spawn(watch)
            .map_err(|error| DaemonError::System {
                action: "start a thread",
                problem: error.to_string(),
            })?;
        Ok(Janitor {
            end,
            thread: Some(thread),
        })
    }
}

impl Drop for Janitor {
    fn drop(&mut self) {
        *self.end.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.end.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // a panic there has been printed on stderr already
            let _ = thread.join();
        }
    }
}

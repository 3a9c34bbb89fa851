//! A thread beside the loop of a group: it cleans up after dead clients, also while a step takes long.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use sim_protocol::host::ClientCleanup;

use crate::error::DaemonError;

/// Looking for dead clients takes 0.3 ms.
const CLEAN_PERIOD: Duration = Duration::from_millis(100);

/// The running thread; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Janitor {
    /// Nothing is sent: the thread sees that it is gone.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Janitor {
    /// Starts cleaning.
    pub(crate) fn start(mut cleanup: ClientCleanup) -> Result<Janitor, DaemonError> {
        let (end, ended) = channel();
        let watch = move || {
            while ended.recv_timeout(CLEAN_PERIOD) == Err(RecvTimeoutError::Timeout) {
                cleanup.clean();
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
            end: Some(end),
            thread: Some(thread),
        })
    }
}

impl Drop for Janitor {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            // a panic there has been printed on stderr already
            let _ = thread.join();
        }
    }
}

//! The sign of life of a controller.

use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::control::Request;
use crate::link::{Link, lock};

/// How often the lease is confirmed.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// The thread that confirms the lease; a stopped process has no heartbeat.
#[derive(Debug)]
pub(crate) struct Heart {
    stop: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Heart {
    pub(crate) fn start(link: &Arc<Link>, epoch: u64) -> Heart {
        let stop = Arc::new((Mutex::new(false), Condvar::new()));
        let (link, theirs) = (Arc::clone(link), Arc::clone(&stop));
        let beat = move || {
            let (stopped, signal) = &*theirs;
            let mut guard = lock(stopped);
            while !*guard {
                guard = signal
                    .wait_timeout(guard, HEARTBEAT)
                    .map_or_else(|poison| poison.into_inner().0, |(guard, _)| guard);
                if !*guard {
                    link.tell(&Request::Heartbeat { epoch });
                }
            }
        };
        // without a thread the lease can be taken over while nobody steps, which is a lesser evil than no lease
        let thread = std::thread::Builder::new()
            .name("tightloop-heart".to_owned())
            .spawn(beat)
            .ok();
        Heart { stop, thread }
    }
}

impl Drop for Heart {
    fn drop(&mut self) {
        *lock(&self.stop.0) = true;
        self.stop.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

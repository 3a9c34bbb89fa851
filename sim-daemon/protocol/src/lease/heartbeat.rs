//! Heartbeats of a controller: they confirm its lease.

use std::time::Duration;

use crate::doors::sync::{Arc, Condvar, Mutex};
use crate::doors::thread::JoinHandle;
use crate::presence::connection::Connection;
use crate::waiting::turn::lock;

/// How often the lease is confirmed.
const PERIOD: Duration = Duration::from_millis(250);

/// The thread that confirms the lease; a stopped process has no heartbeat.
#[derive(Debug)]
pub(crate) struct HeartbeatThread {
    stop: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl HeartbeatThread {
    pub(crate) fn start(connection: &Arc<Connection>, epoch: u64) -> HeartbeatThread {
        let stop = Arc::new((Mutex::new(false), Condvar::new()));
        let (connection, thread_stop) = (Arc::clone(connection), Arc::clone(&stop));
        let beat = move || {
            let (stopped, signal) = &*thread_stop;
            let mut guard = lock(stopped);
            while !*guard {
                guard = signal
                    .wait_timeout(guard, PERIOD)
                    .map_or_else(|poison| poison.into_inner().0, |(guard, _)| guard);
                if !*guard {
                    connection.beat(epoch);
                }
            }
        };
        // without a thread the lease can be taken over while nobody steps, which is a lesser evil than no lease
        let thread = crate::doors::thread::Builder::new()
            .name("tightloop-heart".to_owned())
            .spawn(beat)
            .ok();
        HeartbeatThread { stop, thread }
    }
}

impl Drop for HeartbeatThread {
    fn drop(&mut self) {
        *lock(&self.stop.0) = true;
        self.stop.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

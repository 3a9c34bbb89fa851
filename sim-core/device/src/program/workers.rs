//! Threads that compile, with a limit on the time of each program.
//!
//! A driver cannot be stopped. A thread whose driver exceeds the limit is abandoned: it runs on, stays counted, and keeps the device
//! open until the driver returns.

use crate::device::Inner;
use crate::error::DeviceError;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Threads of this process that compile, for any device.
static COMPILING: AtomicUsize = AtomicUsize::new(0);

/// Threads of this process that compile. For tests, which wait for abandoned threads before the process unloads its libraries.
#[doc(hidden)]
pub fn compiling() -> usize {
    COMPILING.load(Ordering::Relaxed)
}

/// Stack of a thread that compiles [bytes]. LLVM recurses over chains of statements: 20,000 overflow 2 MB. Pages are committed as
/// they are used.
const STACK: usize = 256 << 20;

/// What a thread reports.
enum Report<T> {
    Started(usize),
    Done(usize, Result<T, String>),
}

/// A thread that compiles; counted until it ends, even by a panic.
struct Counted(Option<Arc<Inner>>);

impl Counted {
    fn new(device: &Arc<Inner>) -> Counted {
        device.compiling.fetch_add(1, Ordering::Relaxed);
        COMPILING.fetch_add(1, Ordering::Relaxed);
        Counted(Some(device.clone()))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        if let Some(device) = self.0.take() {
            device.compiling.fetch_sub(1, Ordering::Relaxed);
            // may close the device, inside the driver
            drop(device);
        }
        COMPILING.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Runs `work` once per label in `threads` threads; the results keep the order of the labels.
///
/// Errors: the first label whose work fails, panics or takes longer than `limit`.
pub(crate) fn within<T: Send + 'static>(
    device: &Arc<Inner>,
    labels: Vec<String>,
    threads: usize,
    limit: Duration,
    work: impl Fn(usize) -> Result<T, String> + Send + Sync + 'static,
) -> Result<Vec<T>, DeviceError> {
    let count = labels.len();
    let (work, next) = (Arc::new(work), Arc::new(AtomicUsize::new(0)));
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    let mut spawned = Vec::new();
    for _ in 0..threads.min(count) {
        let (work, next, stop, sender) = (work.clone(), next.clone(), stop.clone(), sender.clone());
        let counted = Counted::new(device);
        let thread = std::thread::Builder::new().name("compile".to_owned());
        let begun = thread.stack_size(STACK).spawn(move || {
            loop {
                let place = next.fetch_add(1, Ordering::Relaxed);
                if place >= count || stop.load(Ordering::Relaxed) {
                    break;
                }
                let _ = sender.send(Report::Started(place));
                let _ = sender.send(Report::Done(place, work(place)));
            }
            drop((work, sender));
            drop(counted);
        });
        spawned.push(begun.expect("the system has threads"));
    }
    drop((sender, work));

    let mut started: Vec<Option<Instant>> = vec![None; count];
    let mut done: Vec<Option<T>> = (0..count).map(|_| None).collect();
    let mut failure = None;
    while failure.is_none() && done.iter().any(Option::is_none) {
        let running = || (0..count).filter(|&i| started[i].is_some() && done[i].is_none());
        let due = running().min_by_key(|&i| started[i]);
        let remaining = due
            .and_then(|i| started[i])
            .map_or(limit, |since| limit.saturating_sub(since.elapsed()));
        match receiver.recv_timeout(remaining) {
            Ok(Report::Started(place)) => started[place] = Some(Instant::now()),
            Ok(Report::Done(place, Ok(made))) => done[place] = Some(made),
            Ok(Report::Done(place, Err(reason))) => {
                let label = labels[place].clone();
                failure = Some(DeviceError::Compile { label, reason });
            }
            Err(RecvTimeoutError::Timeout) => {
                if let Some(place) = due {
                    let label = labels[place].clone();
                    failure = Some(DeviceError::CompileTimeout { label, limit });
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                let label = labels[due.unwrap_or(0)].clone();
                let reason = "the compiler panicked".to_owned();
                failure = Some(DeviceError::Compile { label, reason });
            }
        }
    }
    stop.store(true, Ordering::Relaxed);
    match failure {
        Some(failure) => Err(failure),
        None => {
            // otherwise the last thread could close the device while the process exits
            for thread in spawned {
                let _ = thread.join();
            }
            Ok(done.into_iter().flatten().collect())
        }
    }
}

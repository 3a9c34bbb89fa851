//! Long work in this process that Ctrl-C ends.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

/// Ctrl-C is heard within this time.
const PERIOD: Duration = Duration::from_millis(50);
/// As much as the main thread has on Linux: readers of files recurse [bytes].
const STACK: usize = 8 << 20;

/// Works on a thread of its own, without the interpreter lock. Meanwhile this thread runs signal handlers, since Python runs
/// them on its main thread alone; when one raises, the work is asked to stop.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    let caller = thread::current();
    py.detach(|| {
        thread::scope(|scope| {
            let worker = thread::Builder::new().spawn_scoped(scope, || {
                let done = work(&|| stop.load(Ordering::Relaxed));
                caller.unpark();
                done
            })?;
            let mut raised = None;
            while !worker.is_finished() {
                thread::park_timeout(PERIOD);
                if raised.is_none() {
                    raised = Python::attach(|py| py.check_signals()).err();
                    stop.store(raised.is_some(), Ordering::Relaxed);
                }
            }
            match (raised, worker.join()) {
                (Some(raised), _) => Err(raised),
                (None, Ok(done)) => Ok(done),
                (None, Err(panic)) => resume_unwind(panic),
            }
        })
    })
}

/// The same for work that cannot be asked to stop, such as compiling a scene: when a handler raises, it goes on
/// without being waited for.
pub(crate) fn abandonable<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    py.detach(|| {
        let (sender, receiver) = channel();
        let worker = thread::Builder::new().stack_size(STACK).spawn(move || {
            // nobody may wait any more
            let _ = sender.send(work());
        })?;
        loop {
            match receiver.recv_timeout(PERIOD) {
                Ok(done) => return Ok(done),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                // it panicked: else it has sent something
                Err(RecvTimeoutError::Disconnected) => {
                    let panic = worker
                        .join()
                        .expect_err("work that ends has sent its result");
                    resume_unwind(panic)
                }
            }
        }
    })
}

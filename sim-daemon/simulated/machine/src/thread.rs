//! Threads and their sleep.

use std::io;
use std::time::Duration;

pub use shuttle::thread::JoinHandle;

use crate::process::Handle;
use crate::world::{self, is_on, me, with};

/// Which thread.
pub type ThreadId = usize;

/// The calling thread.
pub fn this() -> ThreadId {
    me()
}

/// Starts a thread of a process.
pub(crate) fn begin<T: Send + 'static>(
    process: Handle,
    call: impl FnOnce() -> T + Send + 'static,
) -> JoinHandle<T> {
    let handle = shuttle::thread::spawn(move || {
        let lives = process.is_alive();
        with(|world| world.task(me()).process = if lives { process.pid } else { u32::MAX });
        if !lives {
            block(u64::MAX);
        }
        call()
    });
    world::step("starts a thread");
    handle
}

/// As `std::thread::Builder`.
#[derive(Debug, Default)]
pub struct Builder;

impl Builder {
    /// A thread with the usual settings.
    pub fn new() -> Builder {
        Builder
    }

    /// Names are not kept.
    #[must_use]
    pub fn name(self, _name: String) -> Builder {
        self
    }

    /// Starts the thread.
    ///
    /// # Errors
    /// Those of a system without room for it.
    pub fn spawn<T: Send + 'static>(
        self,
        call: impl FnOnce() -> T + Send + 'static,
    ) -> io::Result<JoinHandle<T>> {
        world::system_call("starts a thread")?;
        Ok(begin(Handle::this(), call))
    }
}

/// Sleeps.
pub fn sleep(time: Duration) {
    if is_on() {
        sleep_until(with(|world| world.now) + time.as_nanos() as u64);
    }
}

pub(crate) fn sleep_until(at: u64) {
    let at = with(|world| world.wakes(at));
    block(at);
}

/// Lets others go on.
pub fn yield_now() {
    world::step("yields");
}

/// The same in a loop that looks for something over and over.
pub fn spin_loop() {
    world::step("spins");
}

/// Cores that may be used.
pub fn available_parallelism() -> io::Result<std::num::NonZeroUsize> {
    let cores = with(|world| world.cores);
    std::num::NonZeroUsize::new(cores).ok_or(io::ErrorKind::Unsupported.into())
}

/// Sleeps until that time, or until [`wake`]; says whether it was woken.
pub(crate) fn block(until: u64) -> bool {
    if !is_on() {
        return true;
    }
    let me = me();
    with(|world| {
        world.steps += 1;
        world.line(|| format!("sleeps until {:.3} ms", until as f64 / 1e6));
        let task = world.task(me);
        (task.wake, task.woken) = (until, false);
    });
    shuttle::thread::yield_now();
    with(|world| {
        let task = world.task(me);
        task.wake = 0;
        std::mem::take(&mut task.woken)
    })
}

/// Wakes a thread that sleeps.
pub(crate) fn wake(task: ThreadId) {
    with(|world| {
        let at = world.now;
        let at = world.wakes(at);
        let task = world.task(task);
        if task.process != u32::MAX && task.wake > at {
            (task.wake, task.woken) = (at, true);
        }
    });
}

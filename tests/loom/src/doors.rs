//! What loom lacks of the standard library, made of what it has.

pub mod iceoryx2 {
    pub use crate::surroundings::sample;
}

pub mod sync {
    use std::sync::{LockResult, OnceLock, TryLockResult};

    pub use loom::sync::{Condvar, MutexGuard, atomic};
    pub use std::sync::{Arc, PoisonError};

    /// A lock that a constant may hold: loom's own comes to be at its first use.
    #[derive(Debug)]
    pub struct Mutex<T> {
        value: std::sync::Mutex<Option<T>>,
        lock: OnceLock<loom::sync::Mutex<T>>,
    }

    impl<T> Mutex<T> {
        pub const fn new(value: T) -> Mutex<T> {
            Mutex {
                value: std::sync::Mutex::new(Some(value)),
                lock: OnceLock::new(),
            }
        }

        fn get(&self) -> &loom::sync::Mutex<T> {
            let value = || self.value.lock().unwrap().take().expect("at the first use");
            self.lock.get_or_init(|| loom::sync::Mutex::new(value()))
        }

        pub fn lock(&self) -> LockResult<MutexGuard<'_, T>> {
            self.get().lock()
        }

        pub fn get_mut(&mut self) -> LockResult<&mut T> {
            self.get();
            self.lock.get_mut().expect("it is there").get_mut()
        }

        pub fn try_lock(&self) -> TryLockResult<MutexGuard<'_, T>> {
            self.get().try_lock()
        }
    }
}

/// Channels by their documentation, over one lock; at most [`mpsc::BOUND`] items wait in a bounded one.
pub mod mpsc {
    use std::collections::VecDeque;
    use std::fmt;
    use std::time::Duration;

    use loom::sync::{Arc, Condvar, Mutex};

    pub use std::sync::mpsc::{RecvError, RecvTimeoutError, SendError, TryRecvError, TrySendError};

    /// Small, so that queues are full in a model.
    pub const BOUND: usize = 2;

    struct State<T> {
        items: VecDeque<T>,
        senders: usize,
        is_received: bool,
    }

    struct Channel<T> {
        state: Mutex<State<T>>,
        changed: Condvar,
    }

    pub struct Sender<T>(Arc<Channel<T>>);

    /// A sender that is bounded.
    pub struct SyncSender<T>(Sender<T>);

    pub struct Receiver<T>(Arc<Channel<T>>);

    impl<T> fmt::Debug for SyncSender<T> {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.debug_struct("SyncSender").finish_non_exhaustive()
        }
    }

    pub fn channel<T>() -> (Sender<T>, Receiver<T>) {
        let channel = Arc::new(Channel {
            state: Mutex::new(State {
                items: VecDeque::new(),
                senders: 1,
                is_received: true,
            }),
            changed: Condvar::new(),
        });
        (Sender(Arc::clone(&channel)), Receiver(channel))
    }

    pub fn sync_channel<T>(_: usize) -> (SyncSender<T>, Receiver<T>) {
        let (sender, receiver) = channel();
        (SyncSender(sender), receiver)
    }

    impl<T> Sender<T> {
        pub fn send(&self, item: T) -> Result<(), SendError<T>> {
            let mut state = self.0.state.lock().unwrap();
            if !state.is_received {
                return Err(SendError(item));
            }
            state.items.push_back(item);
            self.0.changed.notify_all();
            Ok(())
        }
    }

    impl<T> SyncSender<T> {
        pub fn try_send(&self, item: T) -> Result<(), TrySendError<T>> {
            let channel = &self.0.0;
            let mut state = channel.state.lock().unwrap();
            if !state.is_received {
                return Err(TrySendError::Disconnected(item));
            }
            if state.items.len() >= BOUND {
                return Err(TrySendError::Full(item));
            }
            state.items.push_back(item);
            channel.changed.notify_all();
            Ok(())
        }
    }

    impl<T> Clone for SyncSender<T> {
        fn clone(&self) -> SyncSender<T> {
            let channel = &self.0.0;
            channel.state.lock().unwrap().senders += 1;
            SyncSender(Sender(Arc::clone(channel)))
        }
    }

    impl<T> Drop for Sender<T> {
        fn drop(&mut self) {
            self.0.state.lock().unwrap().senders -= 1;
            self.0.changed.notify_all();
        }
    }

    impl<T> Receiver<T> {
        pub fn try_recv(&self) -> Result<T, TryRecvError> {
            let mut state = self.0.state.lock().unwrap();
            let is_over = state.senders == 0;
            state.items.pop_front().ok_or(match is_over {
                true => TryRecvError::Disconnected,
                false => TryRecvError::Empty,
            })
        }

        pub fn recv(&self) -> Result<T, RecvError> {
            let mut state = self.0.state.lock().unwrap();
            loop {
                if let Some(item) = state.items.pop_front() {
                    return Ok(item);
                }
                if state.senders == 0 {
                    return Err(RecvError);
                }
                state = self.0.changed.wait(state).unwrap();
            }
        }

        /// Waits without end where the limit is not over yet: who sends is not stuck in a model.
        pub fn recv_timeout(&self, limit: Duration) -> Result<T, RecvTimeoutError> {
            if limit.is_zero() {
                return self.try_recv().map_err(|error| match error {
                    TryRecvError::Empty => RecvTimeoutError::Timeout,
                    TryRecvError::Disconnected => RecvTimeoutError::Disconnected,
                });
            }
            self.recv().map_err(|_| RecvTimeoutError::Disconnected)
        }
    }

    impl<T> Drop for Receiver<T> {
        fn drop(&mut self) {
            let mut state = self.0.state.lock().unwrap();
            state.is_received = false;
            // what nobody receives lets go of its own ends of channels
            let items = std::mem::take(&mut state.items);
            drop(state);
            drop(items);
        }
    }
}

pub mod thread {
    use std::time::Duration;

    pub use loom::thread::{Builder, ThreadId, spawn};

    pub fn this() -> ThreadId {
        loom::thread::current().id()
    }

    /// Lets others run, and time pass.
    pub fn sleep(time: Duration) {
        super::time::pass(time);
        loom::thread::yield_now();
    }
}

/// A clock that only sleep advances.
pub mod time {
    use std::cell::Cell;
    use std::ops::Add;

    pub use std::time::Duration;

    // all threads of a model run on one of the system's
    std::thread_local! {
        static NOW: Cell<Duration> = const { Cell::new(Duration::ZERO) };
    }

    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    pub struct Instant(Duration);

    impl Instant {
        pub fn now() -> Instant {
            Instant(NOW.get())
        }

        pub fn saturating_duration_since(self, earlier: Instant) -> Duration {
            self.0.saturating_sub(earlier.0)
        }
    }

    impl Add<Duration> for Instant {
        type Output = Instant;

        fn add(self, time: Duration) -> Instant {
            Instant(self.0 + time)
        }
    }

    pub(super) fn pass(time: Duration) {
        NOW.set(NOW.get() + time);
    }

    /// Begins an order of a model, which is the same each time it runs.
    pub fn begin() {
        NOW.set(Duration::ZERO);
    }
}

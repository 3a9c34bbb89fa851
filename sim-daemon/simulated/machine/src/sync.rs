//! Locks, conditions and channels, whose waits end by the clock of the machine.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};
use std::sync::Mutex as Plain;
pub use std::sync::{Arc, LockResult, Once, OnceLock, PoisonError, Weak};
use std::time::Duration;

pub use shuttle::sync::atomic;

use crate::thread::{self, ThreadId};
use crate::time::now;
use crate::world::step;

/// As `std::sync::Mutex`.
#[derive(Debug, Default)]
pub struct Mutex<T>(shuttle::sync::Mutex<T>);

/// As `std::sync::MutexGuard`.
#[derive(Debug)]
pub struct MutexGuard<'a, T> {
    mutex: &'a Mutex<T>,
    guard: shuttle::sync::MutexGuard<'a, T>,
}

impl<T> Mutex<T> {
    /// A value that one thread uses at a time.
    pub const fn new(value: T) -> Mutex<T> {
        Mutex(shuttle::sync::Mutex::new(value))
    }

    /// Waits for the value.
    ///
    /// # Errors
    /// Never: a panic ends the run.
    pub fn lock(&self) -> LockResult<MutexGuard<'_, T>> {
        let guard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(MutexGuard { mutex: self, guard })
    }

    /// The value of the only owner.
    ///
    /// # Errors
    /// As [`Mutex::lock`].
    pub fn get_mut(&mut self) -> LockResult<&mut T> {
        self.0.get_mut()
    }
}

impl<T> Deref for MutexGuard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.guard
    }
}

impl<T> DerefMut for MutexGuard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.guard
    }
}

/// As `std::sync::Condvar`.
#[derive(Debug, Default)]
pub struct Condvar {
    waiting: Plain<VecDeque<ThreadId>>,
}

/// As `std::sync::WaitTimeoutResult`.
#[derive(Debug, Clone, Copy)]
pub struct WaitTimeoutResult(bool);

impl WaitTimeoutResult {
    /// Whether nobody notified.
    pub fn timed_out(&self) -> bool {
        self.0
    }
}

impl Condvar {
    /// One that nobody waits for.
    pub const fn new() -> Condvar {
        let waiting = Plain::new(VecDeque::new());
        Condvar { waiting }
    }

    /// Waits until notified, or for a time.
    ///
    /// # Errors
    /// As [`Mutex::lock`].
    pub fn wait_timeout<'a, T>(
        &self,
        guard: MutexGuard<'a, T>,
        time: Duration,
    ) -> LockResult<(MutexGuard<'a, T>, WaitTimeoutResult)> {
        let mutex = guard.mutex;
        let until = now() + time.as_nanos() as u64;
        queue(&self.waiting).push_back(thread::this());
        drop(guard);
        // who was notified before it sleeps does not sleep
        let waits = queue(&self.waiting).contains(&thread::this());
        let woken = !waits || thread::block(until);
        queue(&self.waiting).retain(|task| *task != thread::this());
        mutex
            .lock()
            .map(|guard| (guard, WaitTimeoutResult(!woken)))
            .map_err(|_| unreachable!())
    }

    /// Wakes one of those who wait.
    pub fn notify_one(&self) {
        let first = queue(&self.waiting).pop_front();
        first.into_iter().for_each(thread::wake);
        step("notifies");
    }

    /// Wakes all.
    pub fn notify_all(&self) {
        let all = std::mem::take(&mut *queue(&self.waiting));
        all.into_iter().for_each(thread::wake);
        step("notifies");
    }
}

/// Held for no longer than one statement, in which no thread goes on.
fn queue<T>(mutex: &Plain<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// As `std::sync::mpsc`.
pub mod mpsc {
    use super::*;
    pub use std::sync::mpsc::{RecvTimeoutError, SendError};

    #[derive(Debug)]
    struct Shared<T> {
        items: VecDeque<T>,
        senders: usize,
        receiver: bool,
        waiting: Option<ThreadId>,
    }

    type Place<T> = Arc<Plain<Shared<T>>>;

    /// The end that sends.
    #[derive(Debug)]
    pub struct Sender<T>(Place<T>);

    /// The end that receives.
    #[derive(Debug)]
    pub struct Receiver<T>(Place<T>);

    /// A channel.
    pub fn channel<T>() -> (Sender<T>, Receiver<T>) {
        let place = Arc::new(Plain::new(Shared {
            items: VecDeque::new(),
            senders: 1,
            receiver: true,
            waiting: None,
        }));
        (Sender(Arc::clone(&place)), Receiver(place))
    }

    impl<T> Sender<T> {
        /// Sends.
        ///
        /// # Errors
        /// The value, where nobody receives any more.
        pub fn send(&self, value: T) -> Result<(), SendError<T>> {
            step("sends");
            let mut shared = queue(&self.0);
            if !shared.receiver {
                return Err(SendError(value));
            }
            shared.items.push_back(value);
            shared.waiting.take().into_iter().for_each(thread::wake);
            Ok(())
        }
    }

    impl<T> Clone for Sender<T> {
        fn clone(&self) -> Sender<T> {
            queue(&self.0).senders += 1;
            Sender(Arc::clone(&self.0))
        }
    }

    impl<T> Drop for Sender<T> {
        fn drop(&mut self) {
            let mut shared = queue(&self.0);
            shared.senders -= 1;
            if shared.senders == 0 && !std::thread::panicking() {
                shared.waiting.take().into_iter().for_each(thread::wake);
            }
        }
    }

    impl<T> Drop for Receiver<T> {
        fn drop(&mut self) {
            queue(&self.0).receiver = false;
        }
    }

    impl<T> Receiver<T> {
        /// Waits for a value, for a time.
        ///
        /// # Errors
        /// None came, or none can come any more.
        pub fn recv_timeout(&self, time: Duration) -> Result<T, RecvTimeoutError> {
            let until = now() + time.as_nanos() as u64;
            loop {
                step("receives");
                {
                    let mut shared = queue(&self.0);
                    if let Some(value) = shared.items.pop_front() {
                        return Ok(value);
                    }
                    if shared.senders == 0 {
                        return Err(RecvTimeoutError::Disconnected);
                    }
                    if now() >= until {
                        return Err(RecvTimeoutError::Timeout);
                    }
                    shared.waiting = Some(thread::this());
                }
                thread::block(until);
            }
        }
    }
}

//! Clients and frames that C keeps by pointer.
//!
//! Their memory is used again and never freed. So a pointer to a client that was detached leads to an empty [`Slot`], which
//! is an error, or to a newer client, but never to freed memory. It also spares a step its allocation.

#[cfg(not(loom))]
use std::sync::{Mutex, MutexGuard};
use std::sync::{OnceLock, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use sim_protocol::Maker;

#[cfg(loom)]
use crate::doors::sync::{Mutex, MutexGuard};
use crate::status::{Failure, Status};

/// Much longer than any thread has a [`Lock`].
const MOMENT: Duration = Duration::from_millis(100);

/// A lock for moments. In a forked child, one that a thread of the parent had then is never free.
#[derive(Debug)]
struct Lock<T> {
    value: Mutex<T>,
    maker: OnceLock<Maker>,
}

impl<T> Lock<T> {
    const fn new(value: T) -> Lock<T> {
        Lock {
            value: Mutex::new(value),
            maker: OnceLock::new(),
        }
    }

    /// The value; none in a forked child where a thread of the parent had it.
    fn get(&self) -> Option<MutexGuard<'_, T>> {
        let maker = self.maker.get_or_init(Maker::this);
        // a call that panicked leaves a whole value
        if maker.is_this() {
            return Some(self.value.lock().unwrap_or_else(PoisonError::into_inner));
        }
        let start = Instant::now();
        loop {
            match self.value.try_lock() {
                Ok(value) => return Some(value),
                Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) if start.elapsed() > MOMENT => return None,
                Err(TryLockError::WouldBlock) => std::thread::yield_now(),
            }
        }
    }
}

/// A value that C may have given back.
#[derive(Debug)]
pub(crate) struct Slot<T>(Lock<Option<T>>);

impl<T> Slot<T> {
    pub(crate) fn empty() -> Slot<T> {
        Slot(Lock::new(None))
    }

    /// Fills the slot of a handle that [`Pool::lend`] has just given.
    pub(crate) fn fill(&self, value: T) {
        let mut slot = self.0.get().expect("nobody else has a handle of the pool");
        *slot = Some(value);
    }

    pub(crate) fn take(&self) -> Option<T> {
        self.0.get()?.take()
    }

    /// Looks at the value; an error where it was given back.
    pub(crate) fn with<R>(
        &self,
        stale: &str,
        look: impl FnOnce(&T) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        match self.0.get().as_deref() {
            Some(Some(value)) => look(value),
            Some(None) => Err(Failure::new(Status::StaleHandle, stale)),
            None => {
                let sentence = "this process was forked while a thread of its parent used this handle; \
                                attach in the child";
                Err(Failure::new(Status::Forked, sentence))
            }
        }
    }
}

/// Handles that nobody uses at present.
#[derive(Debug)]
pub(crate) struct Pool<H: 'static>(Lock<Vec<&'static H>>);

impl<H> Pool<H> {
    pub(crate) const fn new() -> Pool<H> {
        Pool(Lock::new(Vec::new()))
    }

    /// A handle whose slot is empty.
    pub(crate) fn lend(&self, make: impl FnOnce() -> H) -> &'static H {
        let unused = self.0.get().and_then(|mut unused| unused.pop());
        unused.unwrap_or_else(|| Box::leak(Box::new(make())))
    }

    /// Takes a handle whose slot the caller has emptied.
    pub(crate) fn give_back(&self, handle: &'static H) {
        if let Some(mut unused) = self.0.get() {
            unused.push(handle);
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn handles_are_used_again_and_a_stale_one_is_an_error() {
        static POOL: Pool<Slot<u32>> = Pool::new();
        let first = POOL.lend(Slot::empty);
        first.fill(7);
        assert_eq!(first.with("stale", |value| Ok(*value)).unwrap(), 7);
        assert_eq!(first.take(), Some(7));
        POOL.give_back(first);
        let refused = first.with("stale", |_| Ok(())).unwrap_err();
        assert_eq!(
            (refused.status, &*refused.sentence),
            (Status::StaleHandle, "stale")
        );
        assert_eq!(first.take(), None);
        assert!(std::ptr::eq(POOL.lend(Slot::empty), first));
    }
}

#[cfg(all(test, loom))]
mod models {
    use super::*;
    use loom::thread;

    /// A pool of its own in each order, and a handle of it.
    fn pool() -> (&'static Pool<Slot<u32>>, &'static Slot<u32>) {
        let pool: &Pool<Slot<u32>> = Box::leak(Box::new(Pool::new()));
        let handle = pool.lend(Slot::empty);
        handle.fill(7);
        (pool, handle)
    }

    fn detach(pool: &Pool<Slot<u32>>, handle: &'static Slot<u32>) -> bool {
        let value = handle.take();
        if value.is_some() {
            pool.give_back(handle);
        }
        value.is_some()
    }

    #[test]
    fn a_handle_that_two_threads_detach_is_given_back_once() {
        loom::model(|| {
            let (pool, handle) = pool();
            let other = thread::spawn(move || detach(pool, handle));
            let first = detach(pool, handle);
            assert!(first != other.join().unwrap());
            let (one, two) = (pool.lend(Slot::empty), pool.lend(Slot::empty));
            assert!(std::ptr::eq(one, handle) && !std::ptr::eq(one, two));
        });
    }

    #[test]
    fn who_uses_a_handle_that_another_thread_detaches_gets_its_value_an_error_or_a_newer_value() {
        loom::model(|| {
            let (pool, handle) = pool();
            let other = thread::spawn(move || {
                assert!(detach(pool, handle));
                pool.lend(Slot::empty).fill(8);
            });
            let looked = handle.with("stale", |value| Ok(*value));
            assert!(match looked {
                Ok(value) => value == 7 || value == 8,
                Err(failure) => failure.status == Status::StaleHandle,
            });
            other.join().unwrap();
            assert_eq!(handle.with("stale", |value| Ok(*value)).unwrap(), 8);
        });
    }

    #[test]
    fn two_threads_are_lent_two_handles() {
        loom::model(|| {
            let (pool, handle) = pool();
            assert!(detach(pool, handle));
            let lend = move || {
                let lent = pool.lend(Slot::empty);
                lent.fill(1);
                std::ptr::from_ref(lent) as usize
            };
            let other = thread::spawn(lend);
            assert_ne!(lend(), other.join().unwrap());
        });
    }
}

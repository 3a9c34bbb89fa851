//! Clients and frames that C keeps by pointer.
//!
//! Their memory is used again and never freed. So a pointer to a client that was detached leads to an empty [`Slot`], which
//! is an error, or to a newer client, but never to freed memory. It also spares a step its allocation.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::status::{Failure, Status};

/// A value that C may have given back.
#[derive(Debug)]
pub(crate) struct Slot<T>(Mutex<Option<T>>);

impl<T> Slot<T> {
    pub(crate) fn empty() -> Slot<T> {
        Slot(Mutex::new(None))
    }

    fn lock(&self) -> MutexGuard<'_, Option<T>> {
        // a call that panicked leaves a value or none
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn fill(&self, value: T) {
        *self.lock() = Some(value);
    }

    pub(crate) fn take(&self) -> Option<T> {
        self.lock().take()
    }

    /// Looks at the value; an error where it was given back.
    pub(crate) fn with<R>(
        &self,
        stale: &str,
        look: impl FnOnce(&T) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        match &*self.lock() {
            Some(value) => look(value),
            None => Err(Failure::new(Status::StaleHandle, stale)),
        }
    }
}

/// Handles that nobody uses at present.
#[derive(Debug)]
pub(crate) struct Pool<H: 'static>(Mutex<Vec<&'static H>>);

impl<H> Pool<H> {
    pub(crate) const fn new() -> Pool<H> {
        Pool(Mutex::new(Vec::new()))
    }

    fn lock(&self) -> MutexGuard<'_, Vec<&'static H>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A handle whose slot is empty.
    pub(crate) fn lend(&self, make: impl FnOnce() -> H) -> &'static H {
        let unused = self.lock().pop();
        unused.unwrap_or_else(|| Box::leak(Box::new(make())))
    }

    /// Takes a handle whose slot the caller has emptied.
    pub(crate) fn give_back(&self, handle: &'static H) {
        self.lock().push(handle);
    }
}

#[cfg(test)]
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

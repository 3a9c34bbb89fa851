//! A lock around what a port shares with its samples. The transport's own costs 20 ns more, several times a step.

use std::fmt::Debug;
use std::ops::Deref;
use std::ptr::NonNull;
use std::sync::Arc;

use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::arc_sync_policy::{ArcSyncPolicy, ArcSyncPolicyCreationError, LockGuard};
use parking_lot::{ReentrantMutex, ReentrantMutexGuard};

/// A value for any thread, one at a time; the thread that has it may take it again.
#[derive(Debug)]
pub struct Reentrant<T>(Arc<ReentrantMutex<T>>);

impl<T> Clone for Reentrant<T> {
    fn clone(&self) -> Reentrant<T> {
        Reentrant(Arc::clone(&self.0))
    }
}

/// The value while it is locked.
pub struct Guard<'a, T>(ReentrantMutexGuard<'a, T>);

impl<T> Deref for Guard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<'a, T: Send + Debug + Abandonable> LockGuard<'a, T> for Guard<'a, T> {}

impl<T: Send + Debug + Abandonable> ArcSyncPolicy<T> for Reentrant<T> {
    type LockGuard<'a>
        = Guard<'a, T>
    where
        T: 'a;

    fn new(value: T) -> Result<Reentrant<T>, ArcSyncPolicyCreationError> {
        Ok(Reentrant(Arc::new(ReentrantMutex::new(value))))
    }

    fn lock(&self) -> Guard<'_, T> {
        Guard(self.0.lock())
    }
}

impl<T: Send + Debug + Abandonable> Abandonable for Reentrant<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Reentrant<T>>) {
        // SAFETY: the caller has it for itself, and does not use it afterwards.
        let shared = unsafe { this.as_mut() };
        match Arc::get_mut(&mut shared.0) {
            // SAFETY: as above.
            Some(lock) => unsafe { T::abandon_in_place(NonNull::from_mut(lock.get_mut())) },
            // SAFETY: as above.
            None => unsafe { std::ptr::drop_in_place(&raw mut shared.0) },
        }
    }
}

//! Ports of the transport that stay where they are when another program has cut their memory: to take one down reads that
//! memory, and panics over what it finds there would end the process.

use std::mem::ManuallyDrop;
use std::ops::{Deref, DerefMut};

use crate::doors::iceoryx2::config::Config;
use crate::memory::guard::guarded;
use crate::memory::mapping;
use crate::memory::storage;

/// A port, a service or a sample of a run.
#[derive(Debug)]
pub(crate) struct Port<T> {
    owner: u64,
    inner: ManuallyDrop<T>,
}

impl<T> Port<T> {
    pub(crate) fn new(config: &Config, inner: T) -> Port<T> {
        Port::with_owner(storage::run_of(config), inner)
    }

    /// One of the run that a number stands for.
    pub(crate) fn with_owner(owner: u64, inner: T) -> Port<T> {
        let inner = ManuallyDrop::new(inner);
        Port { owner, inner }
    }

    /// The number of the run.
    pub(crate) fn owner(&self) -> u64 {
        self.owner
    }
}

impl<T> Deref for Port<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.inner
    }
}

impl<T> DerefMut for Port<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.inner
    }
}

impl<T> Drop for Port<T> {
    fn drop(&mut self) {
        if !mapping::is_damaged(self.owner) {
            // SAFETY: this is the only place that drops it, and nobody uses it afterwards.
            guarded(|| unsafe { ManuallyDrop::drop(&mut self.inner) });
        }
    }
}

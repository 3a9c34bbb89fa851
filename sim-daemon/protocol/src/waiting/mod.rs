//! How each side waits for the other: clock, cores, sleep, the caller's hook, and turns between threads.

use std::time::Duration;

pub(crate) mod affinity;
pub(crate) mod clock;
pub(crate) mod hook;
pub(crate) mod park;
pub(crate) mod turn;
pub(crate) mod waiter;

/// Longest time anybody sleeps without looking around.
pub(crate) const SLICE: Duration = Duration::from_millis(50);

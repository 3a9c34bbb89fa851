//! Clocks.

use std::ops::{Add, AddAssign, Sub};
use std::time::Duration;

use crate::world::{is_on, with};

/// Time that a look at a clock takes [ns].
const LOOK: u64 = 25;

/// The monotonic clock [ns].
pub fn now() -> u64 {
    if !is_on() {
        return u64::MAX / 2;
    }
    with(|world| {
        world.now += LOOK;
        world.now
    })
}

/// As `std::time::Instant`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Instant(u64);

impl Instant {
    /// The time now.
    pub fn now() -> Instant {
        Instant(now())
    }

    /// Time since then.
    pub fn elapsed(&self) -> Duration {
        Instant::now().duration_since(*self)
    }

    /// Time since another one, zero if that was later.
    pub fn duration_since(&self, earlier: Instant) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }

    /// The same.
    pub fn saturating_duration_since(&self, earlier: Instant) -> Duration {
        self.duration_since(earlier)
    }
}

impl Add<Duration> for Instant {
    type Output = Instant;

    fn add(self, time: Duration) -> Instant {
        Instant(self.0.saturating_add(time.as_nanos() as u64))
    }
}

impl AddAssign<Duration> for Instant {
    fn add_assign(&mut self, time: Duration) {
        *self = *self + time;
    }
}

impl Sub<Duration> for Instant {
    type Output = Instant;

    fn sub(self, time: Duration) -> Instant {
        Instant(self.0.saturating_sub(time.as_nanos() as u64))
    }
}

/// A time of the calendar, which may jump [ns].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SystemTime(pub(crate) i64);

/// A time that was said to be past lies ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Later;

impl SystemTime {
    /// The time now.
    pub fn now() -> SystemTime {
        let now = now() as i64;
        SystemTime(now.saturating_add(with(|world| world.calendar)))
    }

    /// Time since then; an error where the clock was set back.
    ///
    /// # Errors
    /// Nothing but that it was later.
    pub fn elapsed(&self) -> Result<Duration, Later> {
        let passed = SystemTime::now().0 - self.0;
        u64::try_from(passed)
            .map(Duration::from_nanos)
            .map_err(|_| Later)
    }
}

/// Sets the clock of the calendar forward or back [ns].
pub fn jump(nanos: i64) {
    with(|world| world.calendar = world.calendar.saturating_add(nanos));
}

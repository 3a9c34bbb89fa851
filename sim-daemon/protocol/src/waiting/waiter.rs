//! How to wait: spin while the answer is likely to come soon and a core is free for it, else sleep.

use std::time::Duration;

use crate::ProtocolError;
use crate::doors::iceoryx2::port::listener::Listener;
use crate::doors::iceoryx2::prelude::Service;
use crate::doors::iceoryx2_bb_posix::file_descriptor::FileDescriptorBased;
use crate::doors::time::Instant;
use crate::waiting::SLICE;
use crate::waiting::clock::{self, Alarm};
use crate::waiting::park::park;

const SPIN_MIN: Duration = Duration::from_micros(5);
const SPIN_SURE: Duration = Duration::from_micros(40);
const SPIN_MAX: Duration = Duration::from_micros(200);
/// Waking takes tens of microseconds: sleep this much less than the expected wait, and spin for the rest.
const WAKE_MARGIN: Duration = Duration::from_micros(100);
/// Beyond this, a wake-up is lost in the wait itself.
const FORESEEN_MAX: Duration = Duration::from_millis(20);

/// What is due so soon is not worth a look at anything else.
const NEAR: Duration = Duration::from_millis(5);

/// Looks between two looks at the clock, which cost a fifth of one.
const LOOKS: u32 = 8;

/// Most waits that sleep at once after spinning was in vain.
const REST_MAX: u32 = 64;

/// What is waited for.
pub(crate) trait Awaited<T> {
    /// Looks for it; called over and over.
    fn poll(&mut self) -> Result<Option<T>, ProtocolError>;

    /// The longest sleep before [`Awaited::poll`] will find something; none where that is not known.
    fn patience(&self) -> Option<Duration> {
        None
    }

    /// Looks at everything else; called after each sleep, hence at least every 50 ms, never while spinning.
    fn poll_rest(&mut self) -> Result<Option<T>, ProtocolError>;
}

/// What was learnt about one kind of wait.
#[derive(Debug)]
pub(crate) struct Waiter {
    /// Moving average of recent waits.
    typical: Duration,
    free_core: bool,
    /// Waits to sleep through before spinning is tried again, and how many there were the last time.
    resting: u32,
    rest: u32,
    /// Whether both sides run on one core.
    shared: bool,
    alarm: Alarm,
}

impl Waiter {
    /// `free_core`: whether a spinning thread takes a core from nobody, other programs aside.
    pub(crate) fn new(free_core: bool) -> Waiter {
        Waiter {
            typical: SPIN_MAX / 2,
            free_core,
            resting: 0,
            rest: 0,
            shared: false,
            alarm: Alarm::new(),
        }
    }

    /// Waits until something is found.
    pub(crate) fn wait<S: Service, T>(
        &mut self,
        listener: &Listener<S>,
        awaited: &mut impl Awaited<T>,
    ) -> Result<T, ProtocolError>
    where
        Listener<S>: FileDescriptorBased,
    {
        if let Some(value) = awaited.poll()? {
            self.learn(Duration::ZERO);
            return Ok(value);
        }
        let mut start = Instant::now();
        if self.may_spin() {
            if self.typical > SPIN_MAX {
                let sleep = self.typical - WAKE_MARGIN;
                match awaited.patience() {
                    None => park(listener, sleep)?,
                    Some(patience) if patience > WAKE_MARGIN => {
                        park(listener, sleep.min(patience - WAKE_MARGIN))?;
                    }
                    Some(_) => {}
                }
            }
            if let Some(value) = self.spin(awaited)? {
                self.learn(start.elapsed());
                return Ok(value);
            }
            // perhaps the other side waited for our core: then the wait begins only now, and what was spun must not make
            // the next spin longer
            start = Instant::now();
        }
        loop {
            match awaited.patience() {
                None => park(listener, SLICE)?,
                Some(patience) if patience > WAKE_MARGIN => {
                    park(listener, (patience - WAKE_MARGIN).min(SLICE))?;
                }
                // too short to sleep
                Some(_) => {
                    if let Some(value) = awaited.poll()? {
                        return Ok(value);
                    }
                    crate::doors::thread::spin_loop();
                    continue;
                }
            }
            // a notification may be an old one: only looking tells
            if let Some(value) = awaited.poll()? {
                self.learn(start.elapsed());
                return Ok(value);
            }
            if let Some(value) = awaited.poll_rest()? {
                return Ok(value);
            }
        }
    }

    /// Waits until something is found that is due at a time of the monotonic clock [ns], or as soon as it can where that is 0.
    pub(crate) fn wait_due<S: Service, T>(
        &mut self,
        due: u64,
        listener: &Listener<S>,
        awaited: &mut impl Awaited<T>,
    ) -> Result<T, ProtocolError>
    where
        Listener<S>: FileDescriptorBased,
    {
        if due == 0 {
            return self.wait(listener, awaited);
        }
        loop {
            let rest = Duration::from_nanos(due.saturating_sub(clock::now()));
            if rest < NEAR {
                break;
            }
            park(listener, (rest - NEAR / 2).min(SLICE))?;
            if let Some(value) = awaited.poll()? {
                return Ok(value);
            }
            if let Some(value) = awaited.poll_rest()? {
                return Ok(value);
            }
        }
        self.alarm.sleep_until_shortly_before(due);
        // it comes at a known time: to spin for it is not in vain, whatever was learnt about other waits
        if self.free_core && !self.shared {
            let end = Instant::now() + Duration::from_nanos(due.saturating_sub(clock::now()));
            if let Some(value) = spin_until(end + SPIN_SURE, awaited)? {
                return Ok(value);
            }
        }
        self.wait(listener, awaited)
    }

    /// Spins for as long as is worth it.
    fn spin<T>(&mut self, awaited: &mut impl Awaited<T>) -> Result<Option<T>, ProtocolError> {
        // while spinning pays, an interrupt of the other side is waited out as well
        let (times, least) = if self.rest == 0 {
            (4, SPIN_SURE)
        } else {
            (2, SPIN_MIN)
        };
        let worthwhile = (times * self.typical).clamp(least, SPIN_MAX);
        if let Some(value) = spin_until(Instant::now() + worthwhile, awaited)? {
            self.rest /= 2;
            return Ok(Some(value));
        }
        self.rest = (2 * self.rest).clamp(1, REST_MAX);
        self.resting = self.rest;
        Ok(None)
    }

    /// Says whether both sides were seen on one core: then spinning only keeps the other side from it.
    pub(crate) fn share(&mut self, shared: bool) {
        if self.shared && !shared {
            (self.rest, self.resting) = (0, 0);
        }
        self.shared = shared;
    }

    fn may_spin(&mut self) -> bool {
        if self.resting > 0 {
            self.resting -= 1;
            return false;
        }
        self.free_core && !self.shared && self.typical < FORESEEN_MAX
    }

    /// An outlier moves the average by at most 30 %.
    fn learn(&mut self, wait: Duration) {
        let ceiling = (4 * self.typical).clamp(SPIN_MIN, 2 * FORESEEN_MAX);
        self.typical = (9 * self.typical + wait.min(ceiling)) / 10;
    }
}

/// Looks for something over and over until a time.
fn spin_until<T>(end: Instant, awaited: &mut impl Awaited<T>) -> Result<Option<T>, ProtocolError> {
    loop {
        for _ in 0..LOOKS {
            if let Some(value) = awaited.poll()? {
                return Ok(Some(value));
            }
            crate::doors::thread::spin_loop();
        }
        if Instant::now() > end {
            return Ok(None);
        }
    }
}

/// Cores that this process may use.
pub(crate) fn cores() -> usize {
    crate::doors::thread::available_parallelism().map_or(1, usize::from)
}

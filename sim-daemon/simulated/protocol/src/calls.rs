//! Calls of a client, and what must hold of each: it returns in time, and an error has a cause.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use sim_machine::note;
use sim_machine::time::now;
use sim_protocol_simulated::{Client, ProtocolError, RefusalKind};

use crate::facts::{ClientId, Facts};

/// A call that nobody holds up returns within this time [ns].
pub const CALL_MAX: u64 = 4_000_000_000;
/// The same for one whose hook ends the wait [ns].
const HOOK_MAX: u64 = 1_000_000_000;
/// The same for one that waits for a daemon that starts [ns].
pub const START_MAX: u64 = 14_000_000_000;
/// The same for the end of a daemon, whatever it does [ns].
pub const END_MAX: u64 = 2_300_000_000;
/// The same where the daemon is at long work, or another thread uses the client [ns].
const LONG: u64 = 14_000_000_000;
/// The same where calls of the system fail: a frame whose memory cannot be made is waited for as long as one of a daemon
/// that stands [ns].
const ANSWER_MAX: u64 = 140_000_000_000;
/// A lease that was asked for in vain goes back by then [ns].
const GRANTED_MAX: u64 = 3_000_000_000;
/// Most calls of another thread that come before one that waits.
const TURNS_MAX: u64 = 40;

/// What a call gives.
pub type Got<T> = Result<T, ProtocolError>;

/// Makes the calls of a client.
#[derive(Debug, Clone)]
pub struct Caller {
    pub facts: Facts,
    pub id: ClientId,
    session: Option<u64>,
    /// Whether another thread uses the client, too.
    pub is_shared: bool,
    /// Calls that are on, and all that are over, of those that take turns.
    turns: Arc<[AtomicU64; 2]>,
}

impl Caller {
    /// For a client of this run of the daemon, or for one that attaches.
    pub fn new(facts: &Facts, session: Option<u64>) -> Caller {
        Caller {
            facts: facts.clone(),
            id: facts.client(),
            session,
            is_shared: false,
            turns: Arc::default(),
        }
    }

    /// A call that may take the lease.
    pub fn control<T>(&self, what: &str, client: &Client, call: impl FnOnce() -> Got<T>) -> Got<T> {
        self.take_turn(what, CALL_MAX, client, call)
    }

    /// The same whose hook ends the wait.
    pub fn interrupted<T>(
        &self,
        what: &str,
        client: &Client,
        call: impl FnOnce() -> Got<T>,
    ) -> Got<T> {
        self.take_turn(what, HOOK_MAX, client, call)
    }

    fn take_turn<T>(
        &self,
        what: &str,
        longest: u64,
        client: &Client,
        call: impl FnOnce() -> Got<T>,
    ) -> Got<T> {
        let [on, over] = &*self.turns;
        on.fetch_add(1, Ordering::Relaxed);
        self.facts.holds(self.id, u64::MAX);
        let before = over.load(Ordering::Relaxed);
        let result = self.timed(what, longest, call);
        let others = over.fetch_add(1, Ordering::Relaxed) - before;
        assert!(
            others < TURNS_MAX || self.facts.is_uneven(),
            "{what} waited for {others} calls of another thread"
        );
        let holds = client.holds_lease();
        let keeps = !self.is_shared && what != "release" && result.is_ok();
        assert!(holds || !keeps, "{what} gave the lease back");
        // the daemon may grant yet what nobody waits for any more
        let is_abandoned = matches!(
            result,
            Err(ProtocolError::Interrupted | ProtocolError::Timeout { .. })
        );
        if on.fetch_sub(1, Ordering::Relaxed) == 1 && !holds {
            let grace = if is_abandoned { GRANTED_MAX } else { 0 };
            self.facts.holds(self.id, now() + grace);
        }
        result
    }

    /// Makes a call, and checks that it returns in time and with an error that has a cause.
    pub fn timed<T>(&self, what: &str, longest: u64, call: impl FnOnce() -> Got<T>) -> Got<T> {
        let began = now();
        let result = call();
        let waited = now() - began;
        let took = waited.saturating_sub(self.facts.stopped_since(began));
        let error = result.as_ref().err();
        note(|| match error {
            None => format!("{what}: done"),
            Some(error) => format!("{what}: {error}"),
        });
        let may_fail = self.facts.may_fail(began);
        let is_long = self.is_shared || !self.facts.slow().is_zero();
        let longest = match longest {
            // the other thread has so many turns before
            _ if may_fail && self.is_shared => TURNS_MAX * ANSWER_MAX,
            _ if may_fail => ANSWER_MAX,
            CALL_MAX if is_long => LONG,
            HOOK_MAX if self.is_shared => LONG,
            longest => longest,
        };
        assert!(
            took < longest,
            "{what} took {:.1} s: {error:?}",
            took as f64 / 1e9
        );
        if let Some(error) = error {
            assert!(
                may_fail || self.is_expected(what, error, began),
                "{what}: {error}; {error:?}"
            );
        }
        result
    }

    /// Checks that the process may hold the lease that does, as is said.
    pub fn is_held_by(&self, pid: u32, since: u64) {
        if !self.facts.may_fail(since) {
            // it may be this client
            self.facts.held_by(pid, (pid, 0), since);
        }
    }

    /// Whether an error tells of what other processes do, and not of a fault.
    fn is_expected(&self, what: &str, error: &ProtocolError, began: u64) -> bool {
        use ProtocolError::{
            CommandRefused, DaemonLost, DaemonRestarted, FramesHeld, Interrupted, LeaseHeld,
            LeaseLost, NoDaemon, NothingSent, Silent, Starting, StepInFlight,
        };
        match error {
            NoDaemon { .. } => self.facts.nobody_serves(began),
            DaemonLost { .. } | DaemonRestarted { .. } => {
                self.session
                    .into_iter()
                    .for_each(|session| self.facts.is_over(session));
            }
            // a daemon that is killed right after its answer answered well
            LeaseHeld { pid, .. }
                if self.session.is_some_and(|run| self.facts.serves_still(run)) =>
            {
                self.facts.held_by(*pid, self.id, began);
            }
            LeaseHeld { .. } => {}
            LeaseLost { .. } => self.facts.lost_lease(self.id),
            CommandRefused { kind, .. } => {
                return *kind == RefusalKind::Backend && matches!(what, "snapshot" | "journal");
            }
            NothingSent | StepInFlight => return self.is_shared || what == "recv",
            Starting { .. } | Silent { .. } | FramesHeld { .. } | Interrupted => {}
            _ => return false,
        }
        true
    }
}

/// Whether a call was done; `None` where its daemon is gone.
pub fn is_there<T>(result: &Got<T>) -> Option<bool> {
    match result {
        Err(ProtocolError::DaemonLost { .. } | ProtocolError::DaemonRestarted { .. }) => None,
        Err(_) => Some(false),
        Ok(_) => Some(true),
    }
}

//! A client, in a process of its own, that does what its plan says and checks what it gets.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use sim_machine::thread::sleep;
use sim_machine::time::now;
use sim_machine::{note, random};
use sim_protocol_simulated::{
    AttachOptions, Client, Frame, Hook, Journal, ProtocolError, RefusalKind, keep_waiting,
};

use crate::daemon::{BODY, NAME, ROOT};
use crate::facts::Facts;
use crate::plan::Act;

/// A call that nobody holds up returns within this time [ns]: a lease is asked for again for 10 s.
const CALL_MAX: u64 = 14_000_000_000;

/// The same where calls of the system fail [ns].
const ANSWER_MAX: u64 = 40_000_000_000;

/// What a client has.
pub struct Actor {
    facts: Facts,
    /// Whether calls of the system fail in this run.
    failing: bool,
    client: Option<Client>,
    frames: Vec<(Frame, u64)>,
}

/// What a call gives, and what it is called.
type Got<T> = Result<T, ProtocolError>;

impl Actor {
    pub fn new(facts: &Facts, failing: bool) -> Actor {
        Actor {
            facts: facts.clone(),
            failing,
            client: None,
            frames: Vec::new(),
        }
    }

    /// Does all of it.
    pub fn play(&mut self, acts: &[Act]) {
        for act in acts {
            note(|| format!("{act:?}"));
            self.act(*act);
            // frames stay as they were, whatever came after them, also without their client
            for (frame, count) in &self.frames {
                assert_eq!(whole(frame), *count, "a frame has changed that is held");
            }
        }
        self.frames.clear();
        self.client = None;
    }

    fn act(&mut self, act: Act) {
        match act {
            Act::Attach(wait) => self.attach(Duration::from_millis(wait)),
            Act::Rest(time) => sleep(Duration::from_millis(time)),
            Act::Detach => self.client = None,
            _ => {
                let Some(client) = self.client.take() else {
                    return;
                };
                if self.use_client(&client, act).is_some() {
                    self.client = Some(client);
                }
            }
        }
    }

    fn attach(&mut self, wait: Duration) {
        self.client = None;
        let root = Some(PathBuf::from(ROOT));
        let options = AttachOptions { root, wait };
        let attach = || Client::attach(NAME, &options, &mut keep_waiting());
        self.client = self.timed("attach", wait.as_nanos() as u64, attach).ok();
    }

    /// `None` where the daemon is gone.
    fn use_client(&mut self, client: &Client, act: Act) -> Option<()> {
        let hook: Hook<'_> = &mut keep_waiting();
        match act {
            Act::Steps(count) => {
                for _ in 0..count {
                    let frame = self.timed("step", 0, || client.step(&[], hook));
                    self.look(frame)?;
                }
            }
            Act::SendRecv(time) => {
                if is_there(&self.timed("send", 0, || client.send(&[], hook)))? {
                    sleep(Duration::from_millis(time));
                    let frame = self.timed("recv", 0, || client.recv(hook));
                    self.look(frame)?;
                }
            }
            Act::Hold(time) => {
                let frame = self.timed("step", 0, || client.step(&[], hook));
                if let Some((frame, count)) = self.look(frame)? {
                    self.frames.push((frame, count));
                }
                sleep(Duration::from_millis(time));
                if random().is_multiple_of(2) {
                    self.frames.clear();
                }
            }
            Act::Reset => {
                self.look_at(self.timed("reset", 0, || client.reset(None, None, hook)))?
            }
            Act::Forward => self.look_at(self.timed("forward", 0, || client.forward(hook)))?,
            Act::Interrupt => {
                let stop: Hook<'_> = &mut || ControlFlow::Break(());
                self.look_at(self.timed("step", 0, || client.step(&[], stop)))?;
            }
            Act::Release => drop(self.timed("release", 0, || client.release(hook))),
            Act::Observe(count) => {
                for _ in 0..count {
                    let seen = self.timed("latest", 0, || client.latest(hook));
                    is_there(&seen)?;
                    self.keep(seen);
                    sleep(Duration::from_millis(random() % 40));
                }
            }
            Act::Newer(time) => {
                let timeout = Duration::from_millis(time);
                let newer = || client.wait_newer(Some(timeout), hook);
                let seen = self.timed("wait_newer", timeout.as_nanos() as u64, newer);
                is_there(&seen)?;
                self.keep(seen);
            }
            Act::Ask => {
                is_there(&self.timed("controller", 0, || client.controller(hook)))?;
                is_there(&self.timed("timing", 0, || client.timing(false, hook)))?;
            }
            Act::Record(count) => self.record(client, count)?,
            Act::Shutdown => drop(self.timed("shutdown", 0, || client.shutdown(hook))),
            Act::Attach(_) | Act::Rest(_) | Act::Detach => unreachable!("they need no client"),
        }
        Some(())
    }

    /// Keeps what was seen, or not.
    fn keep(&mut self, seen: Got<Option<Frame>>) {
        let Ok(Some(frame)) = seen else {
            return;
        };
        let count = whole(&frame);
        if random().is_multiple_of(3) {
            self.frames.push((frame, count));
        }
    }

    fn look_at(&self, frame: Got<Frame>) -> Option<()> {
        self.look(frame).map(drop)
    }

    /// Checks a frame that came for a command; `None` where the daemon is gone.
    fn look(&self, frame: Got<Frame>) -> Option<Option<(Frame, u64)>> {
        is_there(&frame)?;
        let Ok(frame) = frame else {
            return Some(None);
        };
        let (count, head) = (whole(&frame), *frame.header());
        self.facts
            .got((head.session, head.epoch, head.ack_seq), count);
        Some(Some((frame, count)))
    }

    fn record(&self, client: &Client, count: u8) -> Option<()> {
        let hook: Hook<'_> = &mut keep_waiting();
        let fields = ["count".to_owned()];
        let opened = self.timed("journal", 0, || client.journal(&fields, hook));
        is_there(&opened)?;
        let Ok(mut journal) = opened else {
            return Some(());
        };
        let mut counted = None;
        for _ in 0..count {
            let next = self.timed("next", 30_000_000, || {
                entry(&mut journal, &mut counted, hook)
            });
            if is_there(&next)? == (matches!(next, Ok(false))) {
                break;
            }
        }
        Some(())
    }

    /// Makes a call, and checks that it returns in time and with an error that can be.
    fn timed<T>(&self, what: &str, allowed: u64, call: impl FnOnce() -> Got<T>) -> Got<T> {
        let began = now();
        let result = call();
        let waited = now() - began;
        let took = waited.saturating_sub(self.facts.stopped_since(began));
        let error = result.as_ref().err();
        note(|| match error {
            None => format!("{what}: done"),
            Some(error) => format!("{what}: {error}"),
        });
        let may_fail = self.failing || self.facts.was_squeezed(began);
        // a frame whose memory cannot be made is waited for as long as one whose daemon stands
        let longest = if may_fail { ANSWER_MAX } else { CALL_MAX };
        assert!(
            took < longest + allowed,
            "{what} took {:.1} s: {error:?}",
            took as f64 / 1e9
        );
        if let Some(error) = error {
            assert!(may_fail || is_expected(error), "{what}: {error}; {error:?}");
        }
        result
    }
}

/// Takes an entry of a journal; false if none came. Steps count on from where the state was, gaps aside.
fn entry(journal: &mut Journal, counted: &mut Option<u64>, hook: Hook<'_>) -> Got<bool> {
    let Some(entry) = journal.next(Duration::from_millis(30), hook)? else {
        return Ok(false);
    };
    let header = *entry.header();
    if header.is_end() {
        return Ok(false);
    }
    if header.is_state() {
        let piece = entry.piece();
        assert!(piece.iter().all(|byte| *byte == piece[0]), "a torn state");
        return Ok(true);
    }
    let count = entry.observed().first().copied();
    let is_step = header.op == 1;
    if let (Some(before), Some(count), 0) = (*counted, count, entry.lost) {
        assert_eq!(
            count,
            before + u64::from(is_step),
            "the journal skips a command"
        );
    }
    // inputs alone, of a client that went, have no frame
    if header.digests == 0 && is_step {
        *counted = None;
    } else if count.is_some() {
        *counted = count;
    }
    Ok(true)
}

/// The number in a frame.
///
/// # Panics
/// It is torn.
fn whole(frame: &Frame) -> u64 {
    let words = |name| {
        let field = frame.field(name).expect("the daemon's fields");
        field.as_slice::<u64>().expect("of its type").to_vec()
    };
    let (count, body) = (words("count"), words("body"));
    assert!(!body.is_empty() && body.len() <= BODY);
    let is_torn = count.iter().chain(&body).any(|word| *word != count[0]);
    assert!(!is_torn, "a torn frame: {count:?} {body:?}");
    count[0]
}

/// Whether a call was done; `None` where its daemon is gone.
fn is_there<T>(result: &Got<T>) -> Option<bool> {
    match result {
        Err(ProtocolError::DaemonLost { .. } | ProtocolError::DaemonRestarted { .. }) => None,
        Err(_) => Some(false),
        Ok(_) => Some(true),
    }
}

/// Whether an error tells of what other processes do, and not of a fault.
fn is_expected(error: &ProtocolError) -> bool {
    use ProtocolError::{
        CommandRefused, DaemonLost, DaemonRestarted, FramesHeld, Interrupted, LeaseHeld, LeaseLost,
        NoDaemon, NothingSent, Silent, Starting, StepInFlight,
    };
    match error {
        NoDaemon { .. }
        | Starting { .. }
        | Silent { .. }
        | DaemonLost { .. }
        | DaemonRestarted { .. } => true,
        LeaseHeld { .. }
        | LeaseLost { .. }
        | FramesHeld { .. }
        | NothingSent
        | StepInFlight
        | Interrupted => true,
        // of a write, and when four others record
        CommandRefused { kind, .. } => *kind == RefusalKind::Backend,
        _ => false,
    }
}

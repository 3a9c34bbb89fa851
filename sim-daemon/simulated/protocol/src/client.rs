//! A client, in a process of its own, that does what its plan says and checks what it gets.

use std::ops::ControlFlow;
use std::time::Duration;

use sim_machine::process::Handle;
use sim_machine::sync::Arc;
use sim_machine::thread::{Builder, JoinHandle, sleep};
use sim_machine::time::now;
use sim_machine::{note, random};
use sim_protocol_simulated::{AttachOptions, Client, Frame, Hook, Journal, keep_waiting, stop};

use crate::calls::{CALL_MAX, Caller, END_MAX, Got, START_MAX, is_there};
use crate::daemon::{BODY, NAME, root};
use crate::facts::Facts;
use crate::plan::Act;

/// What a process has.
pub struct Actor {
    facts: Facts,
    seat: Option<Seat>,
    /// The other client of this process.
    other: Option<Seat>,
    frames: Vec<(Frame, u64)>,
}

/// A client, and the thread that uses it besides.
struct Seat {
    client: Arc<Client>,
    caller: Caller,
    beside: Option<JoinHandle<()>>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        if let Some(beside) = self.beside.take() {
            let _ = beside.join();
        }
    }
}

impl Actor {
    pub fn new(facts: &Facts) -> Actor {
        Actor {
            facts: facts.clone(),
            seat: None,
            other: None,
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
        self.detach();
        std::mem::swap(&mut self.seat, &mut self.other);
        self.detach();
    }

    fn act(&mut self, act: Act) {
        match act {
            Act::Attach(wait) => self.attach(Duration::from_millis(wait)),
            Act::DieAtDoor(doors) => Handle::this().kill_at_door(doors),
            Act::DieAtChange(changes) => Handle::this().kill_at_change(changes),
            Act::Rest(time) => sleep(Duration::from_millis(time)),
            Act::Detach => self.detach(),
            Act::Swap => std::mem::swap(&mut self.seat, &mut self.other),
            Act::Beside(count, steps_alone) => self.begin_beside(count, steps_alone),
            _ => {
                let Some(seat) = &self.seat else {
                    return;
                };
                let (client, caller) = (Arc::clone(&seat.client), seat.caller.clone());
                if self.use_client(&client, &caller, act).is_none() {
                    drop(client);
                    self.detach();
                }
            }
        }
    }

    /// Lets go of the client.
    fn detach(&mut self) {
        let Some(seat) = self.seat.take() else {
            return;
        };
        let id = seat.caller.id;
        drop(seat);
        self.facts.holds(id, now());
    }

    /// Lets another thread use the client, which it holds until it is done.
    fn begin_beside(&mut self, count: u8, steps_alone: bool) {
        let Some(seat) = &mut self.seat else {
            return;
        };
        if let Some(before) = seat.beside.take() {
            let _ = before.join();
        }
        seat.caller.is_shared = true;
        let (client, caller) = (Arc::clone(&seat.client), seat.caller.clone());
        let beside = move || {
            for _ in 0..count {
                if use_beside(&client, &caller, steps_alone).is_none() {
                    break;
                }
            }
        };
        seat.beside = Builder::new().spawn(beside).ok();
    }

    /// Ends the daemon, as a process does that is no client.
    pub fn end(&self) {
        let options = AttachOptions {
            root: Some(root()),
            wait: Duration::ZERO,
        };
        let caller = Caller::new(&self.facts, None);
        let end = || stop(NAME, &options, &mut keep_waiting());
        let _ = self.facts.ask_all(|| caller.timed("stop", END_MAX, end));
    }

    fn attach(&mut self, wait: Duration) {
        self.detach();
        let options = AttachOptions {
            root: Some(root()),
            wait,
        };
        let attach = || Client::attach(NAME, &options, &mut keep_waiting());
        let longest = START_MAX + wait.as_nanos() as u64;
        let attached = Caller::new(&self.facts, None).timed("attach", longest, attach);
        self.seat = attached.ok().map(|client| Seat {
            caller: Caller::new(&self.facts, Some(client.description().session)),
            client: Arc::new(client),
            beside: None,
        });
    }

    /// `None` where the daemon is gone.
    fn use_client(&mut self, client: &Client, caller: &Caller, act: Act) -> Option<()> {
        let hook: Hook<'_> = &mut keep_waiting();
        match act {
            Act::Steps(count) => {
                for _ in 0..count {
                    let frame = caller.control("step", client, || client.step(&[], hook));
                    self.look(frame)?;
                }
            }
            Act::SendRecv(time) => {
                if is_there(&caller.control("send", client, || client.send(&[], hook)))? {
                    sleep(Duration::from_millis(time));
                    let frame = caller.control("recv", client, || client.recv(hook));
                    self.look(frame)?;
                }
            }
            Act::Hold(time) => {
                let frame = caller.control("step", client, || client.step(&[], hook));
                if let Some((frame, count)) = self.look(frame)? {
                    self.frames.push((frame, count));
                }
                sleep(Duration::from_millis(time));
                if random().is_multiple_of(2) {
                    self.frames.clear();
                }
            }
            Act::Reset => {
                self.look_at(caller.control("reset", client, || client.reset(None, None, hook)))?
            }
            Act::Forward => {
                self.look_at(caller.control("forward", client, || client.forward(hook)))?
            }
            Act::Interrupt => {
                let stop: Hook<'_> = &mut || ControlFlow::Break(());
                self.look_at(caller.interrupted("step", client, || client.step(&[], stop)))?;
            }
            Act::Take(gives_back) => {
                is_there(&caller.control("acquire", client, || client.acquire(hook)))?;
                if gives_back {
                    drop(caller.control("release", client, || client.release(hook)));
                }
            }
            Act::Insist(time) => {
                let end = now() + 1_000_000 * time;
                while !is_there(&caller.control("acquire", client, || client.acquire(hook)))?
                    && now() < end
                {
                    sleep(Duration::from_millis(20));
                }
            }
            Act::Release => drop(caller.control("release", client, || client.release(hook))),
            Act::Observe(count) => {
                for _ in 0..count {
                    let seen = caller.timed("latest", CALL_MAX, || client.latest(hook));
                    is_there(&seen)?;
                    self.keep(seen);
                    sleep(Duration::from_millis(random() % 40));
                }
            }
            Act::Newer(time) => {
                let timeout = Duration::from_millis(time);
                let newer = || client.wait_newer(Some(timeout), hook);
                let seen = caller.timed("wait_newer", CALL_MAX + timeout.as_nanos() as u64, newer);
                is_there(&seen)?;
                self.keep(seen);
            }
            Act::Ask => {
                let began = now();
                let holder = caller.timed("controller", CALL_MAX, || client.controller(hook));
                is_there(&holder)?;
                if let Ok(Some(pid)) = holder {
                    caller.is_held_by(pid, began);
                }
                is_there(&caller.timed("timing", CALL_MAX, || client.timing(false, hook)))?;
            }
            Act::Count => {
                is_there(&caller.timed("observers", CALL_MAX, || client.observers(hook)))?;
            }
            Act::Refused => {
                let refused = || client.snapshot("/nowhere", hook);
                is_there(&caller.control("snapshot", client, refused))?;
            }
            Act::ReleaseInside => {
                let release: Hook<'_> = &mut || {
                    let _ = client.release(&mut keep_waiting());
                    ControlFlow::Break(())
                };
                is_there(&caller.interrupted("step", client, || client.step(&[], release)))?;
            }
            Act::Record(count) => record(client, caller, count)?,
            Act::RecordAll => {
                let fields = ["count".to_owned()];
                let all = [(); 4].map(|()| client.journal(&fields, hook));
                let refused = all.iter().find_map(|journal| journal.as_ref().err());
                assert!(refused.is_none(), "nobody records: {refused:?}");
            }
            Act::Shutdown => drop(caller.timed("shutdown", CALL_MAX, || {
                self.facts.ask(client.description().session);
                client.shutdown(hook)
            })),
            Act::Attach(_)
            | Act::Rest(_)
            | Act::Detach
            | Act::DieAtDoor(_)
            | Act::DieAtChange(_)
            | Act::Swap
            | Act::Beside(..) => {
                unreachable!("they use no client here")
            }
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
}

/// Uses a client that another thread uses, too; `None` where the daemon is gone.
fn use_beside(client: &Client, caller: &Caller, steps_alone: bool) -> Option<()> {
    let hook: Hook<'_> = &mut keep_waiting();
    match random() % 16 {
        _ if steps_alone => step_beside(client, caller)?,
        0 => drop(caller.control("release", client, || client.release(hook))),
        1 => {
            is_there(&caller.timed("latest", CALL_MAX, || client.latest(hook)))?;
        }
        2 => {
            let newer = || client.wait_newer(Some(Duration::from_millis(20)), hook);
            is_there(&caller.timed("wait_newer", CALL_MAX, newer))?;
        }
        3 => {
            is_there(&caller.timed("controller", CALL_MAX, || client.controller(hook)))?;
        }
        4 => sleep(Duration::from_millis(random() % 30)),
        _ => step_beside(client, caller)?,
    }
    Some(())
}

fn step_beside(client: &Client, caller: &Caller) -> Option<()> {
    let step = || client.step(&[], &mut keep_waiting());
    let frame = caller.control("step", client, step);
    is_there(&frame)?;
    if let Ok(frame) = frame {
        let head = *frame.header();
        let id = (head.session, head.epoch, head.ack_seq);
        caller.facts.got(id, whole(&frame));
    }
    Some(())
}

fn record(client: &Client, caller: &Caller, count: u8) -> Option<()> {
    let hook: Hook<'_> = &mut keep_waiting();
    let fields = ["count".to_owned()];
    let opened = caller.timed("journal", CALL_MAX, || client.journal(&fields, hook));
    is_there(&opened)?;
    let Ok(mut journal) = opened else {
        return Some(());
    };
    let mut counted = None;
    for _ in 0..count {
        let next = caller.timed("next", CALL_MAX, || entry(&mut journal, &mut counted, hook));
        if is_there(&next)? == (matches!(next, Ok(false))) {
            break;
        }
    }
    Some(())
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

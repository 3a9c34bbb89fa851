//! What a host looks after: leases, control requests, observers, and the answers to commands.

use std::time::Duration;

use super::Inbox;
use super::handover::Handover;
use super::journal::{Journals, Occasion, RECORDERS_MAX};
use super::lease::Lease;
use super::observers::Observers;
use super::pace::Pacer;
use super::worlds::{Next, S, Worlds};
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::doors::iceoryx2::prelude::Node;
use crate::doors::sync::Arc;
use crate::doors::sync::atomic::{AtomicBool, Ordering};
use crate::doors::time::Instant;
use crate::lease::device_memory::{Door, Visitor};
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::memory::mapping;
use crate::memory::port::Port;
use crate::presence::described::{self, Damage};
use crate::presence::paths::DaemonPaths;
use crate::transport::budget;
use crate::transport::unreached::{self, Unreached};
use crate::transport::{self, ControlService, Responder};
use crate::waiting::affinity::CoreAffinity;
use crate::waiting::clock;
use crate::waiting::waiter::Awaited;
use crate::wire::control::{Request, Response};
use crate::{ALIGNMENT, Description, Dtype, FrameHeader, Op, ProtocolError, RefusalKind, Table};

/// A look around that comes later than this was held up by ourselves, and heartbeats with it.
const HELD_UP: Duration = Duration::from_millis(200);
/// Everything of a host but the waiting.
pub(super) struct State {
    pub(super) node: Port<Node<S>>,
    pub(super) paths: DaemonPaths,
    /// Missing pages that clients were notified of.
    pub(super) faults: usize,
    pub(super) description: Description,
    pub(super) frame: Table,
    pub(super) lease: Option<Lease>,
    /// What keeps the next lease from being opened.
    pub(super) handover: Handover,
    pub(super) journals: Journals,
    pub(super) epochs: u64,
    pub(super) control: ControlService<S>,
    pub(super) responder: Responder<S>,
    pub(super) observers: Observers,
    pub(super) door: Door,
    /// Who waits for device memory, and of which lease.
    pub(super) visitor: Option<(u64, Visitor)>,
    pub(super) polled: Instant,
    pub(super) frames: u64,
    pub(super) inbox: Inbox,
    /// The other inbox while the daemon makes steps of its own for a command: that of the client's.
    pub(super) aside: Option<Inbox>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) affinity: CoreAffinity,
    pub(super) pacer: Pacer,
}

impl State {
    /// Opens a journal for a client of the control service, if there is room for it.
    fn journal(&mut self, recorder: UniqueClientId, observed: u64) -> Response {
        let refused = |reason| Response::Refused { reason };
        if let Some(reason) = self.journals.ended() {
            return refused(format!("nothing can be recorded any more: {reason}"));
        }
        // those that ended since somebody looked
        self.journals
            .refresh(self.description.session, &self.control);
        if self.journals.are_full() {
            return refused(format!(
                "{RECORDERS_MAX} recorders are at work, which is the limit; end one of them"
            ));
        }
        let (shared, process_bytes) = Journals::bytes(&self.description, &self.frame, observed);
        match budget::check(
            budget::free(),
            shared,
            process_bytes,
            "the journal of a recorder",
        ) {
            Err(
                ProtocolError::SharedMemory { free, needed, .. }
                | ProtocolError::Memory { free, needed, .. },
            ) => return Response::NoMemory { free, needed },
            Err(error) => return refused(error.to_string()),
            Ok(()) => {}
        }
        let (node, description) = (&self.node, &self.description);
        let frame = &self.frame;
        match self
            .journals
            .open(node, description, frame, recorder, observed)
        {
            Ok((journal, port)) => Response::Journal {
                journal,
                port: [(port >> 64) as u64, port as u64],
            },
            Err(error) => refused(error.to_string()),
        }
    }

    /// Lets in the holder of a lease who wants device memory.
    fn visit(&mut self, epoch: u64) -> Response {
        match self.door.visitor(epoch) {
            Ok(stream) => {
                self.visitor = Some((epoch, stream));
                Response::BySocket
            }
            Err(reason) => Response::Refused { reason },
        }
    }

    /// Answers the control requests that are there.
    fn control(&mut self) -> Option<Next> {
        let (mut end, mut later) = (false, self.handover.waiting());
        // as with commands: a client that was killed while it connected is no reason to end
        while let Ok(Some(active)) = self.responder.receive() {
            let response = match serde_json::from_slice(active.payload()) {
                Ok(Request::Describe) => Response::Described,
                Ok(Request::Controller) => {
                    let (lease, control) = (self.lease.as_mut(), &self.control);
                    let pid = lease.and_then(|lease| lease.present_holder(control));
                    let lease = self.lease.as_ref().filter(|_| pid.is_some());
                    let epoch = lease.map(|lease| lease.epoch);
                    Response::Controller { pid, epoch }
                }
                // a release that waits unread came before: the requests of several clients come in no order
                Ok(Request::Acquire { pid }) => {
                    later.push((active, pid));
                    continue;
                }
                Ok(Request::Heartbeat { epoch }) => {
                    if let Some(Lease {
                        holder: Some(holder),
                        ..
                    }) = self.lease.as_mut().filter(|lease| lease.epoch == epoch)
                    {
                        holder.beat = Instant::now();
                    }
                    continue; // nobody waits for an answer
                }
                // the ports of the holder go right after this: `is_over` sees that
                Ok(Request::Release { epoch }) => {
                    let lease = self.lease.as_mut().filter(|lease| lease.epoch == epoch);
                    let valid = lease.is_some();
                    lease.into_iter().for_each(Lease::joined);
                    Response::Lease { valid }
                }
                Ok(Request::DeviceMemory { epoch }) => self.visit(epoch),
                Ok(Request::Journal { observed }) => self.journal(active.origin(), observed),
                Ok(Request::Timing { clear }) => {
                    let timing = self.pacer.timing();
                    if clear {
                        self.pacer.clear();
                    }
                    Response::Timing(timing)
                }
                Ok(Request::Shutdown) => {
                    end = true;
                    Response::Ending
                }
                Err(error) => Response::Refused {
                    reason: format!("unreadable control request: {error}"),
                },
            };
            respond(&active, &response);
        }
        for (active, pid) in later {
            match self.acquire(pid, active.origin()) {
                Some(response) => respond(&active, &response),
                None => self.handover.postpone(active, pid),
            }
        }
        end.then_some(Next::End)
    }

    pub(super) fn answer(&mut self, started: Instant, worlds: &mut impl Worlds) {
        let Some(lease) = &mut self.lease else {
            return self.record_inputs();
        };
        let lines = self.frame.total_bytes() / ALIGNMENT;
        let Some(Ok(mut loan)) = loaned::loan(&lease.publisher, lines) else {
            // the holder keeps more frames than it said: it gets an error: its lease is lost
            self.record_inputs();
            return self.renew();
        };
        let words = loaned::words(loan.payload_mut());
        let (head, arena) = words.split_at_mut(Table::head_bytes(self.frame.rows().len()) / 8);
        head[..self.frame.words().len()].copy_from_slice(self.frame.words());
        let is_good = worlds.frame(arena, Some(&lease.memory));
        let on_device = worlds.on_device();
        self.frames += 1;
        self.observers.changed();
        let made = Instant::now();
        let common = header(&self.description, &self.frame, self.frames);
        let busy_ns = made.duration_since(started).as_nanos() as u64;
        let is_step = self.inbox.op() == Op::Step;
        let now = match self.pacer.is_paced() && is_step {
            true => {
                self.pacer.hold();
                Instant::now()
            }
            false => made,
        };
        *loan.user_header_mut() = FrameHeader {
            epoch: lease.epoch,
            ack_seq: self.inbox.header().seq,
            busy_ns,
            core: self.affinity.core(self.pacer.is_paced()),
            slot: on_device.map_or(0, |(slot, _)| 1 + slot as u64),
            done: on_device.map_or(0, |(_, done)| done),
            due_next: self.pacer.due_next(),
            ..common
        };
        if let Some(holder) = &mut lease.holder {
            holder.beat = now;
        }
        let Some(Ok(sent)) = guarded(|| loaned::send_kept(&mut lease.publisher, loan)) else {
            self.journals.skip();
            return self.renew(); // the holder cannot be reached: it gets an error: its lease is lost
        };
        // a holder that cannot be notified looks by itself after 50 ms
        guarded(|| lease.notifier.notify());
        if is_step {
            self.pacer.leave(now, busy_ns, true);
        }
        // last: nobody waits for it
        let head = Table::head_bytes(self.frame.rows().len()) / 8;
        if is_good && self.observers.is_due() {
            self.observers
                .show(Instant::now(), common, &self.frame, &sent[head..], worlds);
        }
        // the steps of a rollout were recorded one by one
        if is_good && self.journals.are_read() && self.inbox.op() != Op::Rollout {
            let occasion = Occasion {
                description: &self.description,
                inbox: &self.inbox,
                table: &self.frame,
            };
            self.journals.entry(&occasion, Some(&sent[head..]));
        }
    }

    /// Sends recorders a command whose inputs were set, but that has no client left to get a frame.
    pub(super) fn record_inputs(&mut self) {
        // the steps of a rollout were recorded one by one
        if self.inbox.op() == Op::Rollout {
            return;
        }
        let occasion = Occasion {
            description: &self.description,
            inbox: &self.inbox,
            table: &self.frame,
        };
        self.journals.entry(&occasion, None);
    }

    pub(super) fn refuse(&mut self, kind: RefusalKind, reason: &str) {
        // nobody waits for a daemon that ends: its client sees that it goes away
        if kind == RefusalKind::Stale && self.stop.load(Ordering::Relaxed) {
            return;
        }
        let Some(lease) = &mut self.lease else {
            return;
        };
        let room = budget::slot_bytes(&self.frame) - Table::head_bytes(1);
        let end = reason.floor_char_boundary(room);
        let reason = &reason.as_bytes()[..end];
        let table = Table::lay_out([("reason".to_owned(), Dtype::U8, vec![reason.len()], 0)]);
        let lines = table.total_bytes() / ALIGNMENT;
        let Some(Ok(mut loan)) = loaned::loan(&lease.publisher, lines) else {
            return self.renew();
        };
        let words = loaned::words(loan.payload_mut());
        words[..table.words().len()].copy_from_slice(table.words());
        let offset = table.rows()[0].offset;
        bytemuck::cast_slice_mut::<u64, u8>(words)[offset..offset + reason.len()]
            .copy_from_slice(reason);
        *loan.user_header_mut() = FrameHeader {
            epoch: lease.epoch,
            ack_seq: self.inbox.header().seq,
            outcome: kind as u32,
            core: self.affinity.core(self.pacer.is_paced()),
            ..header(&self.description, &table, self.frames)
        };
        if !matches!(guarded(|| loaned::send(loan)), Some(Ok(_))) {
            return self.renew();
        }
        guarded(|| lease.notifier.notify());
    }

    /// Tells clients when another program has cut memory: some of them would wait for what cannot come.
    fn mark_damage(&mut self) {
        let faults = mapping::faults();
        if faults == self.faults {
            return;
        }
        self.faults = faults;
        let (session, owner) = (self.description.session, self.node.owner());
        if mapping::is_own_damaged(owner) {
            described::mark_damaged(&self.paths, session, Damage::Daemon);
        } else if mapping::is_damaged(owner) {
            // whose it was is not known; most likely the controller's
            described::mark_damaged(&self.paths, session, Damage::Lease(self.epochs));
            self.lose_clients();
        }
    }

    /// Looks at control requests, leases, observers and recorders.
    pub(super) fn poll_services(&mut self) -> Option<Next> {
        let now = Instant::now();
        let gap = now.duration_since(self.polled);
        self.polled = now;
        if gap > HELD_UP
            && let Some(lease) = &mut self.lease
        {
            lease.leave_out(gap, now); // the heartbeats of that time wait unread
        }
        if self.stop.load(Ordering::Relaxed) {
            return Some(Next::End);
        }
        // what panics over damaged memory loses those who use it, and nobody else
        self.mark_damage();
        let next = guarded(|| self.control()).flatten();
        let is_over = guarded(|| {
            let lease = self.lease.as_mut();
            lease.is_some_and(|lease| lease.is_over(&self.control))
        });
        if is_over.unwrap_or(true) {
            self.renew();
        }
        guarded(|| self.lease.iter().for_each(Lease::refresh));
        // new observers get the frame shown last, dead ones give their slots back
        guarded(|| self.observers.refresh());
        let session = self.description.session;
        for Unreached { port, error } in unreached::take() {
            described::mark_unreached(&self.paths, session, port, &error);
        }
        let waits =
            guarded(|| self.journals.refresh(session, &self.control)).unwrap_or_else(|| {
                self.journals.lose();
                false
            });
        let ended = self.handover.is_due().then_some(Next::LeaseEnded);
        let visits = self.visitor.is_some().then_some(Next::DeviceMemory);
        next.or(ended).or(visits).or(waits.then_some(Next::Record))
    }
}

/// Answers a request. An error is ignored: a client that died or gave up needs no answer.
fn respond(active: &transport::Asked<S>, response: &Response) {
    let bytes = serde_json::to_vec(response).expect("responses are plain data");
    if let Ok(loan) = active.loan_slice_uninit(bytes.len()) {
        let _ = loan.write_from_slice(&bytes).send();
    }
}

impl State {
    /// Looks for a command.
    fn poll_commands(&mut self) -> Result<Option<Next>, ProtocolError> {
        let Some(lease) = &mut self.lease else {
            return Ok(None);
        };
        // a client that was killed while it connected is an error until it is cleaned up: then as if it were not there
        let Ok(Some(sample)) = lease.subscriber.receive() else {
            return Ok(None);
        };
        let Some((header, words)) = loaned::received(&sample) else {
            // its holder gets an error: its lease is lost
            guarded(|| drop(sample));
            self.renew();
            return Ok(None);
        };
        let taken = self.inbox.take(header, words);
        // the next command needs its slot, also where memory of another client was cut
        guarded(|| drop(sample));
        if header.session != self.description.session
            || header.epoch != lease.epoch
            || header.seq <= lease.last_seq
        {
            let reason = format!(
                "command {} of session {:016x}, lease {} is stale: session {:016x}, lease {} is at command {}",
                header.seq,
                header.session,
                header.epoch,
                self.description.session,
                lease.epoch,
                lease.last_seq
            );
            self.refuse(RefusalKind::Stale, &reason);
            return Ok(None);
        }
        lease.last_seq = header.seq;
        lease.joined();
        if let Err(problem) = taken {
            self.refuse(
                RefusalKind::Malformed,
                &format!("malformed command: {problem}"),
            );
            return Ok(None);
        }
        match self.inbox.op() {
            Op::Step => self.pacer.receive(),
            _ => self.pacer.rest(),
        }
        Ok(Some(Next::Command))
    }
}

impl Awaited<Next> for State {
    fn poll(&mut self) -> Result<Option<Next>, ProtocolError> {
        let next = self.poll_commands()?;
        let is_late = || self.pacer.deadline().is_some_and(|due| clock::now() >= due);
        Ok(next.or_else(|| is_late().then_some(Next::Late)))
    }

    fn patience(&self) -> Option<Duration> {
        let due = self.pacer.deadline()?;
        Some(Duration::from_nanos(due.saturating_sub(clock::now())))
    }

    fn poll_rest(&mut self) -> Result<Option<Next>, ProtocolError> {
        let next = self.poll_services();
        Ok(next.or(self.observers.is_due().then_some(Next::Observe)))
    }
}

/// What every frame's head has in common.
pub(super) fn header(description: &Description, table: &Table, frame: u64) -> FrameHeader {
    let (session, schema) = (description.session, description.schema);
    FrameHeader {
        session,
        schema,
        frame,
        rows: table.rows().len() as u32,
        ..FrameHeader::default()
    }
}

//! The controlling end of a client: one lease, one command in flight.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::doors::iceoryx2::prelude::PortFactory;
use crate::doors::sync::Arc;
use crate::doors::sync::atomic::Ordering;
use crate::doors::system::files::shared_memory;
use crate::doors::system::process;
use crate::doors::time::Instant;
use crate::lease::answer::{check_table, refusal};
use crate::lease::device_memory::{self, Delivery};
use crate::lease::heartbeat::HeartbeatThread;
use crate::memory::frame::{Alive, FrameSample};
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::memory::port::Port;
use crate::presence::connection::{Connection, S, damaged, intact, intact_lease, malformed, pause};
use crate::presence::liveness::{Peer, Reach};
use crate::transport::{self, CommandPublisher, FrameService, FrameSubscriber, Sleeper};
use crate::waiting::affinity::CoreAffinity;
use crate::waiting::hook::Hook;
use crate::waiting::waiter::{Awaited, Waiter, cores};
use crate::wire::command::{Call, command_bytes};
use crate::wire::control::{Request, Response};
use crate::{ALIGNMENT, CommandHeader, Description, Frame, Op, ProtocolError, RefusalKind, Table};

/// A step that takes longer than this is taken for a daemon that stands.
const ANSWER_MAX: Duration = Duration::from_secs(120);

/// How long a lease is asked for again that cannot be had though nobody alive holds it.
const ACQUIRE_MAX: Duration = Duration::from_secs(10);

/// How long a daemon is waited for that granted a lease to a call of ours which was interrupted: it misses the holder sooner.
const ABANDONED_MAX: Duration = Duration::from_secs(2);

/// How long a release waits for the daemon to take note.
const RELEASE_MAX: Duration = Duration::from_millis(250);

/// The ports of a lease.
type Ports = (
    FrameService<S>,
    FrameSubscriber<S>,
    Sleeper<S>,
    CommandPublisher<S>,
);

/// What became of the command sent last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Flight {
    /// Its answer was taken, or there is none.
    Landed,
    /// A step that was sent for [`Controller::recv`].
    Sent,
    /// Its answer was not waited for, since the caller interrupted: the next command takes it first.
    Abandoned(Op),
}

/// A held lease.
#[derive(Debug)]
pub(crate) struct Controller {
    connection: Arc<Connection>,
    description: Arc<Description>,
    epoch: u64,
    seq: u64,
    flight: Flight,
    /// One an operation, and the last for steps of which the caller did something else meanwhile.
    waiters: [Waiter; Op::ALL.len() + 1],
    affinity: CoreAffinity,
    table: Option<Arc<Table>>,
    /// When the frame of the next step is due [ns]; 0 where it comes as soon as it can.
    due: u64,
    frames: Arc<Alive>,
    publisher: CommandPublisher<S>,
    subscriber: Arc<FrameSubscriber<S>>,
    listener: Sleeper<S>,
    service: FrameService<S>,
    /// Of both ports.
    reach: [Reach; 2],
    /// Last, so that it ends last: the daemon must not think us gone before the ports are.
    _heartbeat: HeartbeatThread,
}

impl Controller {
    pub(crate) fn acquire(
        connection: &Arc<Connection>,
        description: &Arc<Description>,
        frames: &Arc<Alive>,
        hook: Hook<'_>,
    ) -> Result<Controller, ProtocolError> {
        // what an earlier call did not wait for may be granted yet, to nobody
        let abandoned = &connection.abandoned;
        let was_abandoned = abandoned.swap(false, Ordering::Relaxed);
        let acquired = Controller::ask(connection, description, frames, was_abandoned, hook);
        if let Err(ProtocolError::Interrupted | ProtocolError::Timeout { .. }) = acquired {
            abandoned.store(true, Ordering::Relaxed);
        }
        acquired
    }

    /// Asks for a lease until there is one, or nobody can tell when.
    fn ask(
        connection: &Arc<Connection>,
        description: &Arc<Description>,
        frames: &Arc<Alive>,
        was_abandoned: bool,
        hook: Hook<'_>,
    ) -> Result<Controller, ProtocolError> {
        // from the first answer on, since a daemon at long work answers late
        let mut answered = None;
        let own_pid = crate::doors::process::id();
        loop {
            let error = match ask_for_lease(connection, hook) {
                Ok(epoch) => match open_lease(connection, description, frames, epoch, hook) {
                    Ok(controller) => return Ok(controller),
                    Err(error) => error,
                },
                Err(error) => error,
            };
            let answered: Instant = *answered.get_or_insert_with(Instant::now);
            // a daemon that is short of time takes a lease back whose ports it did not see in time, and cleans up after a
            // dead holder late
            let again = match error {
                ProtocolError::Transport { .. } | ProtocolError::LeaseLost { .. } => true,
                ProtocolError::LeaseHeld { pid, .. } => {
                    process::is_gone(pid, connection.peer.beacon.pid)
                        || was_abandoned && pid == own_pid && answered.elapsed() < ABANDONED_MAX
                }
                _ => false,
            };
            if !again || answered.elapsed() > ACQUIRE_MAX {
                return Err(error);
            }
            pause(hook)?;
        }
    }

    fn new(
        connection: &Arc<Connection>,
        description: &Arc<Description>,
        frames: &Arc<Alive>,
        epoch: u64,
        ports: Ports,
    ) -> Controller {
        let (service, subscriber, listener, publisher) = ports;
        // the daemon's step needs its threads, and we spin on one more
        let free_core = cores() > description.busy_threads();
        let reach = [subscriber.id().value(), publisher.id().value()];
        Controller {
            reach: reach.map(|port| connection.peer.reach(port)),
            connection: Arc::clone(connection),
            description: Arc::clone(description),
            epoch,
            seq: 0,
            flight: Flight::Landed,
            waiters: std::array::from_fn(|_| Waiter::new(free_core)),
            affinity: CoreAffinity::new(),
            table: None,
            due: 0,
            frames: Arc::clone(frames),
            publisher,
            subscriber: Arc::new(subscriber),
            listener,
            service,
            _heartbeat: HeartbeatThread::start(connection, epoch),
        }
    }

    /// Sends one command and waits for its frame.
    pub(crate) fn run(&mut self, call: &Call<'_>, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.make_ready(call, hook)?;
        self.publish(call)?;
        self.flight = Flight::Abandoned(call.op); // until it is answered
        let sample = self.answer(call.op as usize - 1, hook)?;
        self.open(sample)
    }

    /// Sends a step, whose frame [`Controller::recv`] waits for.
    pub(crate) fn send(&mut self, call: &Call<'_>, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.make_ready(call, hook)?;
        self.publish(call)?;
        self.flight = Flight::Sent;
        Ok(())
    }

    /// Waits for the frame of the step that was sent.
    pub(crate) fn recv(&mut self, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        if self.flight != Flight::Sent {
            self.connection.peer.check()?;
            return Err(ProtocolError::NothingSent);
        }
        let sample = self.answer(Op::ALL.len(), hook)?;
        self.open(sample)
    }

    /// Asks for device memory of this lease.
    pub(crate) fn device_memory(&mut self, hook: Hook<'_>) -> Result<Delivery, ProtocolError> {
        self.land(hook)?;
        let (peer, epoch) = (&self.connection.peer, self.epoch);
        let socket = device_memory::visit(&peer.paths, peer.beacon.session, epoch);
        let socket = socket.or_else(|error| peer.check().and(Err(error)))?;
        match self
            .connection
            .ask(&Request::DeviceMemory { epoch }, hook)?
        {
            Response::BySocket => {}
            Response::Refused { reason } => return Err(ProtocolError::NotShared { reason }),
            _ => return Err(malformed("the answer to a request for device memory")),
        }
        // the driver compiles and takes memory meanwhile
        let delivery = device_memory::receive(&socket, ANSWER_MAX, hook)?;
        delivery.ok_or_else(|| peer.timeout(ANSWER_MAX))
    }

    /// Checks a command, and that nothing is in the way of its frame.
    fn make_ready(&mut self, call: &Call<'_>, hook: Hook<'_>) -> Result<(), ProtocolError> {
        call.check(&self.description)?;
        self.land(hook)?;
        self.frames.check(self.description.frames_held)
    }

    /// Takes the answer to a command that was abandoned.
    pub(crate) fn land(&mut self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        match self.flight {
            Flight::Landed => Ok(()),
            Flight::Sent => {
                // that the daemon is lost explains more
                self.connection.peer.check()?;
                Err(ProtocolError::StepInFlight)
            }
            Flight::Abandoned(op) => self.answer(op as usize - 1, hook).map(drop),
        }
    }

    /// Lets a test send what it likes, and reads the answer.
    #[cfg(all(test, not(simulated)))]
    pub(crate) fn raw(
        &mut self,
        send: impl FnOnce(&CommandPublisher<S>, u64),
    ) -> Result<Frame, ProtocolError> {
        self.seq += 1;
        send(&self.publisher, self.seq);
        self.connection.notify();
        let sample = self.answer(Op::Step as usize - 1, &mut crate::keep_waiting())?;
        self.open(sample)
    }

    fn publish(&mut self, call: &Call<'_>) -> Result<(), ProtocolError> {
        let failed =
            |error: &dyn std::fmt::Debug| ProtocolError::transport("send a command", error);
        let damaged = || damaged(&self.connection.peer, "send a command");
        let lines = call.bytes(&self.description) / ALIGNMENT;
        let mut loan = loaned::loan(&self.publisher, lines)
            .ok_or_else(damaged)?
            .map_err(|error| failed(&error))?;
        self.seq += 1;
        *loan.user_header_mut() = CommandHeader {
            session: self.connection.peer.beacon.session,
            epoch: self.epoch,
            seq: self.seq,
            op: call.op as u32,
            rows: call.rows() as u32,
            core: self.affinity.core(self.due != 0),
        };
        call.write(&self.description, loaned::words(loan.payload_mut()));
        let sent = guarded(|| loaned::send(loan)).ok_or_else(damaged)?;
        if sent.map_err(|error| failed(&error))? == 0 {
            self.connection.peer.check()?;
            return Err(self.connection.peer.lease_lost());
        }
        self.connection.notify();
        Ok(())
    }

    /// Waits for the answer to the command sent last, at a pace.
    fn answer(&mut self, waiter: usize, hook: Hook<'_>) -> Result<FrameSample, ProtocolError> {
        let mut awaited = Answer {
            seq: self.seq,
            epoch: self.epoch,
            subscriber: &self.subscriber,
            service: &self.service,
            reach: &self.reach,
            peer: &self.connection.peer,
            hook,
            since: Instant::now(),
        };
        let is_step = waiter == Op::Step as usize - 1 || waiter == Op::ALL.len();
        let due = if is_step { self.due } else { 0 };
        let (waiter, peer) = (&mut self.waiters[waiter], &self.connection.peer);
        let sample = guarded(|| waiter.wait_due(due, &self.listener, &mut awaited))
            .ok_or_else(|| damaged(peer, "wait for a frame"))??;
        self.flight = Flight::Landed;
        let head = loaned::head(&sample).ok_or_else(|| damaged(peer, "read a frame"))?;
        self.due = head.due_next;
        let shared = head.core == self.affinity.core(self.due != 0);
        self.waiters
            .iter_mut()
            .for_each(|waiter| waiter.share(shared));
        Ok(sample)
    }

    /// Makes a frame of an answer, or an error of a refusal.
    fn open(&mut self, sample: FrameSample) -> Result<Frame, ProtocolError> {
        let peer = &self.connection.peer;
        intact(peer)?;
        let (header, payload) =
            loaned::received(&sample).ok_or_else(|| damaged(peer, "read a frame"))?;
        if header.outcome != 0 {
            return Err(refusal(header.outcome, header.rows, payload));
        }
        if header.session != self.connection.peer.beacon.session
            || header.schema != self.description.schema
        {
            return Err(malformed("the head of a frame: another session or schema"));
        }
        let table = check_table(&mut self.table, payload, header.rows)?;
        let base = payload.as_ptr() as usize;
        let (head, reader) = ((header, base), Arc::clone(&self.subscriber));
        Ok(Frame::new(head, sample, table, &self.frames, reader))
    }
}

/// Asks for the lease once.
fn ask_for_lease(connection: &Connection, hook: Hook<'_>) -> Result<u64, ProtocolError> {
    let pid = crate::doors::process::id();
    match connection.ask(&Request::Acquire { pid }, hook)? {
        Response::Granted { epoch } => Ok(epoch),
        Response::Held { pid } => Err(ProtocolError::LeaseHeld {
            name: connection.peer.paths.name().to_owned(),
            pid,
        }),
        Response::NoMemory { free, needed } => Err(ProtocolError::SharedMemory {
            path: shared_memory().to_owned(),
            free,
            needed,
            what: "the frames of a new lease".to_owned(),
        }),
        Response::Refused { reason } => Err(ProtocolError::CommandRefused {
            kind: RefusalKind::Backend,
            reason,
        }),
        _ => Err(malformed("the answer to acquire")),
    }
}

/// Opens the ports of a lease that was granted, or gives it back.
fn open_lease(
    connection: &Arc<Connection>,
    description: &Arc<Description>,
    frames: &Arc<Alive>,
    epoch: u64,
    hook: Hook<'_>,
) -> Result<Controller, ProtocolError> {
    let bytes = command_bytes(description);
    let ports = connection.with_node(|node| {
        let service = transport::open_frames(node, epoch)?;
        let event = transport::open_event(node, &format!("obs/{epoch}"))?;
        let subscriber = transport::frame_subscriber(&service)?;
        let listener = transport::listener(&event)?;
        // last: the daemon counts the lease as used once it sees this
        let commands = transport::open_commands(node, epoch)?;
        let publisher = transport::command_publisher(&commands, bytes)?;
        Ok((service, subscriber, listener, publisher))
    });
    if ports.is_err() {
        connection.post(&Request::Release { epoch });
        connection.peer.check()?;
    }
    let controller = Controller::new(connection, description, frames, epoch, ports?);
    // the daemon has seen the ports now, unless it took the lease back while they were opened
    match connection.holder(hook)? {
        Some((_, Some(present))) if present == epoch => Ok(controller),
        // an earlier daemon tells of the process alone
        Some((pid, None)) if pid == crate::doors::process::id() => Ok(controller),
        _ => Err(connection.peer.lease_lost()),
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        // a daemon that we notify only while we go may not find the message any more, and would wait for us to come
        let (release, start) = (Request::Release { epoch: self.epoch }, Instant::now());
        let asked = self.connection.ask_within(RELEASE_MAX, &release, &mut || {
            if start.elapsed() > RELEASE_MAX {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        // another call may be waiting for its own answer for longer
        if asked.is_err() {
            self.connection.post(&release);
            self.connection.notify();
        }
    }
}

/// The wait for the answer to a command; where the transport panics over what it reads, so does the wait.
struct Answer<'a> {
    seq: u64,
    epoch: u64,
    subscriber: &'a FrameSubscriber<S>,
    service: &'a FrameService<S>,
    reach: &'a [Reach],
    peer: &'a Peer,
    hook: Hook<'a>,
    since: Instant,
}

impl Awaited<FrameSample> for Answer<'_> {
    fn poll(&mut self) -> Result<Option<FrameSample>, ProtocolError> {
        loop {
            match self.subscriber.receive() {
                Ok(None) => return Ok(None),
                Ok(Some(sample)) => {
                    let sample = Port::with_owner(self.subscriber.owner(), sample);
                    let header = loaned::head(&sample)
                        .ok_or_else(|| damaged(self.peer, "receive a frame"))?;
                    if header.ack_seq == self.seq && header.epoch == self.epoch {
                        return Ok(Some(sample));
                    }
                }
                Err(error) => return Err(ProtocolError::transport("receive a frame", error)),
            }
        }
    }

    fn poll_rest(&mut self) -> Result<Option<FrameSample>, ProtocolError> {
        if (self.hook)().is_break() {
            return Err(ProtocolError::Interrupted);
        }
        self.peer.check()?;
        intact_lease(self.peer, self.epoch)?;
        self.peer.check_reach(self.reach)?;
        if self.service.dynamic_config().number_of_publishers() == 0 {
            // that the daemon has ended since explains more
            self.peer.check()?;
            return Err(self.peer.lease_lost());
        }
        if self.since.elapsed() > ANSWER_MAX {
            return Err(self.peer.timeout(ANSWER_MAX));
        }
        Ok(None)
    }
}

//! The controlling end of a client: one lease, one command in flight.

use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::PortFactory;

use crate::apart::Apart;
use crate::client::Hook;
use crate::command::{Call, command_bytes};
use crate::control::{Request, Response};
use crate::frame::{Alive, FrameSample};
use crate::heart::Heart;
use crate::host::memory::reserve;
use crate::link::{Link, S, malformed};
use crate::liveness::Peer;
use crate::loan;
use crate::pace::{Pace, Waiting, cores};
use crate::transport::{self, CommandPublisher, FrameService, FrameSubscriber};
use crate::{ALIGNMENT, CommandHeader, Description, Frame, Op, ProtocolError, RefusalKind, Table};

/// A step that takes longer than this is taken for a daemon that stands.
const ANSWER_MAX: Duration = Duration::from_secs(120);

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
    link: Arc<Link>,
    description: Arc<Description>,
    epoch: u64,
    seq: u64,
    flight: Flight,
    /// One an operation, and the last for steps of which the caller did something else meanwhile.
    paces: [Pace; Op::ALL.len() + 1],
    apart: Apart,
    table: Option<Arc<Table>>,
    frames: Arc<Alive>,
    publisher: CommandPublisher<S>,
    subscriber: FrameSubscriber<S>,
    listener: Listener<S>,
    service: FrameService<S>,
    /// Last, so that it ends last: the daemon must not think us gone before the ports are.
    _heart: Heart,
}

impl Controller {
    pub(crate) fn acquire(
        link: &Arc<Link>,
        description: &Arc<Description>,
        frames: &Arc<Alive>,
        hook: Hook<'_>,
    ) -> Result<Controller, ProtocolError> {
        let name = || link.peer.place.name().to_owned();
        let epoch = match link.ask(
            &Request::Acquire {
                pid: std::process::id(),
            },
            hook,
        )? {
            Response::Granted { epoch } => epoch,
            Response::Held { pid } => return Err(ProtocolError::LeaseHeld { name: name(), pid }),
            Response::NoMemory { free, needed } => {
                let (path, what) = (
                    crate::place::SHARED_MEMORY.to_owned(),
                    "the frames of a new lease".to_owned(),
                );
                return Err(ProtocolError::SharedMemory {
                    path,
                    free,
                    needed,
                    what,
                });
            }
            Response::Refused { reason } => {
                let kind = RefusalKind::Backend;
                return Err(ProtocolError::CommandRefused { kind, reason });
            }
            _ => return Err(malformed("the answer to acquire")),
        };
        let bytes = command_bytes(description);
        let ports = link.with_node(|node| {
            let service = transport::open_frames(node, epoch)?;
            let event = transport::open_event(node, &format!("obs/{epoch}"))?;
            let subscriber = transport::frame_subscriber(&service, 0)?;
            let listener = transport::listener(&event)?;
            // last: the daemon counts the lease as used once it sees this
            let commands = transport::open_commands(node, epoch)?;
            let publisher = transport::command_publisher(&commands, bytes)?;
            let prefix = node.config().global.prefix.to_string();
            reserve(&prefix, publisher.id().value(), "the commands of a lease")?;
            Ok((service, subscriber, listener, publisher))
        });
        let (service, subscriber, listener, publisher) = match ports {
            Ok(ports) => ports,
            Err(error) => {
                link.tell(&Request::Release { epoch });
                link.peer.check()?;
                return Err(error);
            }
        };
        // the daemon's step needs its threads, and we spin on one more
        let free_core = cores() > description.busy_threads();
        Ok(Controller {
            link: Arc::clone(link),
            description: Arc::clone(description),
            epoch,
            seq: 0,
            flight: Flight::Landed,
            paces: std::array::from_fn(|_| Pace::new(free_core)),
            apart: Apart::new(),
            table: None,
            frames: Arc::clone(frames),
            publisher,
            subscriber,
            listener,
            service,
            _heart: Heart::start(link, epoch),
        })
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
            self.link.peer.check()?;
            return Err(ProtocolError::NothingSent);
        }
        let sample = self.answer(Op::ALL.len(), hook)?;
        self.open(sample)
    }

    /// Checks a command, and that nothing is in the way of its frame.
    fn make_ready(&mut self, call: &Call<'_>, hook: Hook<'_>) -> Result<(), ProtocolError> {
        call.check(&self.description)?;
        match self.flight {
            Flight::Landed => {}
            Flight::Sent => {
                // that the daemon is lost explains more
                self.link.peer.check()?;
                return Err(ProtocolError::StepInFlight);
            }
            Flight::Abandoned(op) => drop(self.answer(op as usize - 1, hook)?),
        }
        self.frames.check(self.description.frames_held)
    }

    /// Lets a test send what it likes, and reads the answer.
    #[cfg(test)]
    pub(crate) fn raw(
        &mut self,
        send: impl FnOnce(&CommandPublisher<S>, u64),
    ) -> Result<Frame, ProtocolError> {
        self.seq += 1;
        send(&self.publisher, self.seq);
        self.link.notify();
        let sample = self.answer(Op::Step as usize - 1, &mut crate::keep_waiting())?;
        self.open(sample)
    }

    fn publish(&mut self, call: &Call<'_>) -> Result<(), ProtocolError> {
        let failed =
            |error: &dyn std::fmt::Debug| ProtocolError::transport("send a command", error);
        let mut loan = self
            .publisher
            .loan_slice_uninit(call.bytes(&self.description) / ALIGNMENT)
            .map_err(|error| failed(&error))?;
        self.seq += 1;
        *loan.user_header_mut() = CommandHeader {
            session: self.link.peer.beacon.session,
            epoch: self.epoch,
            seq: self.seq,
            op: call.op as u32,
            rows: call.rows() as u32,
            core: self.apart.core(),
        };
        call.write(&self.description, loan::words(loan.payload_mut()));
        if loan::send(loan).map_err(|error| failed(&error))? == 0 {
            self.link.peer.check()?;
            return Err(self.link.peer.lease_lost());
        }
        self.link.notify();
        Ok(())
    }

    /// Waits for the answer to the command sent last, at a pace.
    fn answer(&mut self, pace: usize, hook: Hook<'_>) -> Result<FrameSample, ProtocolError> {
        let mut waiting = Answer {
            seq: self.seq,
            epoch: self.epoch,
            subscriber: &self.subscriber,
            service: &self.service,
            peer: &self.link.peer,
            hook,
            since: Instant::now(),
        };
        let sample = self.paces[pace].wait(&self.listener, &mut waiting)?;
        self.flight = Flight::Landed;
        let shared = sample.user_header().core == self.apart.core();
        self.paces.iter_mut().for_each(|pace| pace.share(shared));
        Ok(sample)
    }

    /// Makes a frame of an answer, or an error of a refusal.
    fn open(&mut self, sample: FrameSample) -> Result<Frame, ProtocolError> {
        let header = *sample.user_header();
        let payload = bytemuck::cast_slice(sample.payload());
        if header.outcome != 0 {
            return Err(refusal(header.outcome, header.rows, payload));
        }
        if header.session != self.link.peer.beacon.session
            || header.schema != self.description.schema
        {
            return Err(malformed("the head of a frame: another session or schema"));
        }
        let table = check_table(&mut self.table, payload, header.rows)?;
        Ok(Frame::new(sample, table, Arc::clone(&self.frames)))
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.link.tell(&Request::Release { epoch: self.epoch });
        self.link.notify();
    }
}

/// The wait for the answer to a command.
struct Answer<'a> {
    seq: u64,
    epoch: u64,
    subscriber: &'a FrameSubscriber<S>,
    service: &'a FrameService<S>,
    peer: &'a Peer,
    hook: Hook<'a>,
    since: Instant,
}

impl Waiting<FrameSample> for Answer<'_> {
    fn look(&mut self) -> Result<Option<FrameSample>, ProtocolError> {
        loop {
            match self.subscriber.receive() {
                Ok(None) => return Ok(None),
                Ok(Some(sample)) => {
                    let header = sample.user_header();
                    if header.ack_seq == self.seq && header.epoch == self.epoch {
                        return Ok(Some(sample));
                    }
                }
                Err(error) => return Err(ProtocolError::transport("receive a frame", error)),
            }
        }
    }

    fn around(&mut self) -> Result<Option<FrameSample>, ProtocolError> {
        if (self.hook)().is_break() {
            return Err(ProtocolError::Interrupted);
        }
        self.peer.check()?;
        if self.service.dynamic_config().number_of_publishers() == 0 {
            return Err(self.peer.lease_lost());
        }
        if self.since.elapsed() > ANSWER_MAX {
            return Err(self.peer.timeout(ANSWER_MAX));
        }
        Ok(None)
    }
}

/// Checks the table of a frame, unless one of the same schema was checked before: the daemon lays out every frame alike.
///
/// Either way what is read lies inside the payload, whatever the daemon wrote.
pub(crate) fn check_table(
    known: &mut Option<Arc<Table>>,
    payload: &[u64],
    rows: u32,
) -> Result<Arc<Table>, ProtocolError> {
    if let Some(table) = known
        && table.rows().len() == rows as usize
        && table.total_bytes() <= size_of_val(payload)
    {
        return Ok(Arc::clone(table));
    }
    let malformed = |problem| ProtocolError::Malformed {
        from: "the daemon",
        problem,
    };
    let table = Arc::new(Table::parse(payload, rows).map_err(malformed)?);
    Ok(Arc::clone(known.insert(table)))
}

/// The daemon's sentence out of a refusal.
fn refusal(outcome: u32, rows: u32, payload: &[u64]) -> ProtocolError {
    let read = || {
        let table = Table::parse(payload, rows)?;
        let row = table.row("reason").ok_or("a refusal without reason")?;
        let bytes: &[u8] = bytemuck::cast_slice(payload);
        Ok::<_, String>(
            String::from_utf8_lossy(&bytes[row.offset..row.offset + row.bytes]).into_owned(),
        )
    };
    match read() {
        Ok(reason) => ProtocolError::CommandRefused {
            kind: RefusalKind::from_wire(outcome),
            reason,
        },
        Err(problem) => ProtocolError::Malformed {
            from: "the daemon",
            problem,
        },
    }
}

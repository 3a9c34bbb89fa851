//! The controlling end of a client: one lease, one command in flight.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::PortFactory;

use crate::client::{Command, Hook, Link, S, Values, lock, malformed};
use crate::control::{Request, Response};
use crate::frame::FrameSample;
use crate::header::encode_row;
use crate::host::memory::reserve;
use crate::liveness::Peer;
use crate::pace::{Pace, Waiting, cores};
use crate::transport::{self, CommandPublisher, FrameService, FrameSubscriber};
use crate::{
    ALIGNMENT, CommandHeader, Description, Dtype, Frame, InputInfo, Op, ProtocolError, ROWS_MAX,
    RefusalKind, Table,
};

/// Name of the mask in a command.
pub(crate) const MASK: &str = "mask";
/// How often the lease is confirmed.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// A held lease.
#[derive(Debug)]
pub(crate) struct Controller {
    link: Arc<Link>,
    description: Arc<Description>,
    epoch: u64,
    seq: u64,
    /// A command whose answer was not waited for, since the caller interrupted.
    unanswered: bool,
    paces: [Pace; 4],
    table: Option<Arc<Table>>,
    frames: Arc<AtomicUsize>,
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
        frames: &Arc<AtomicUsize>,
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
            unanswered: false,
            paces: std::array::from_fn(|_| Pace::new(free_core)),
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
    pub(crate) fn run(
        &mut self,
        op: Op,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        self.check(op, arrays, mask)?;
        let held = self.frames.load(Ordering::Acquire);
        if held >= self.description.frames_held {
            return Err(ProtocolError::FramesHeld { held });
        }
        if self.unanswered {
            drop(self.answer(op, hook)?);
        }
        self.send(op, arrays, mask)?;
        let sample = self.answer(op, hook)?;
        self.open(sample)
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
        let sample = self.answer(Op::Step, &mut crate::keep_waiting())?;
        self.open(sample)
    }

    /// Finds what the daemon would refuse anyway, with the names at hand.
    fn check(
        &self,
        op: Op,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
    ) -> Result<(), ProtocolError> {
        let worlds = self.description.worlds;
        let (inputs, verb): (&[InputInfo], _) = match op {
            Op::Write => (&self.description.writes, "written"),
            _ => (&self.description.commands, "commanded"),
        };
        if arrays.len() >= ROWS_MAX {
            let (expected, got) = (
                format!("at most {} arrays", ROWS_MAX - 1),
                arrays.len().to_string(),
            );
            return Err(ProtocolError::Shape {
                field: "command".to_owned(),
                expected,
                got,
            });
        }
        for (index, array) in arrays.iter().enumerate() {
            let Some(input) = inputs.iter().find(|input| input.name == array.field) else {
                let known = inputs
                    .iter()
                    .map(|input| input.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ");
                return Err(ProtocolError::NotAnInput {
                    field: array.field.to_owned(),
                    verb,
                    known,
                });
            };
            let shape = |expected, got| ProtocolError::Shape {
                field: array.field.to_owned(),
                expected,
                got,
            };
            let columns = &array.columns;
            if columns.start > columns.end || columns.end > input.columns {
                return Err(shape(
                    format!("columns within 0..{}", input.columns),
                    format!("{columns:?}"),
                ));
            }
            if array.values.len() != worlds * columns.len() {
                let expected = format!(
                    "{worlds} worlds x {} columns = {}",
                    columns.len(),
                    worlds * columns.len()
                );
                return Err(shape(
                    format!("{expected} entries"),
                    format!("{}", array.values.len()),
                ));
            }
            let overlaps = |other: &&Command<'_>| {
                other.field == array.field
                    && other.columns.start < columns.end
                    && columns.start < other.columns.end
            };
            if arrays[..index].iter().find(overlaps).is_some() {
                return Err(shape(
                    "each column at most once".to_owned(),
                    format!("{columns:?} twice"),
                ));
            }
        }
        match mask {
            Some(mask) if mask.len() != worlds => Err(ProtocolError::Shape {
                field: MASK.to_owned(),
                expected: format!("({worlds},)"),
                got: format!("({},)", mask.len()),
            }),
            _ => Ok(()),
        }
    }

    fn send(
        &mut self,
        op: Op,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
    ) -> Result<(), ProtocolError> {
        let (worlds, real) = (self.description.worlds, self.description.real());
        let rows = arrays.len() + usize::from(mask.is_some());
        let head = Table::head_bytes(rows);
        let padded =
            |array: &Command<'_>| (array.values.len() * real.size()).next_multiple_of(ALIGNMENT);
        let total = head
            + arrays.iter().map(padded).sum::<usize>()
            + mask.map_or(0, |_| mask_bytes(worlds));
        let failed =
            |error: &dyn std::fmt::Debug| ProtocolError::transport("send a command", error);
        let mut loan = self
            .publisher
            .loan_slice_uninit(total / ALIGNMENT)
            .map_err(|error| failed(&error))?;
        self.seq += 1;
        *loan.user_header_mut() = CommandHeader {
            session: self.link.peer.beacon.session,
            epoch: self.epoch,
            seq: self.seq,
            op: op as u32,
            rows: rows as u32,
            probing: u64::from(self.paces[op as usize - 1].probes()),
        };
        let words = crate::loan::words(loan.payload_mut());
        let (table, data) = words.split_at_mut(head / 8);
        let (table, _) = table.as_chunks_mut();
        let mut offset = 0;
        for (row, array) in table.iter_mut().zip(arrays) {
            let shape = [worlds, array.columns.len()];
            encode_row(
                row,
                array.field,
                real,
                &shape,
                array.columns.start,
                head + offset,
            );
            copy_values(
                array.values,
                real,
                &mut data[offset / 8..(offset + padded(array)) / 8],
            );
            offset += padded(array);
        }
        if let Some(mask) = mask {
            encode_row(
                &mut table[arrays.len()],
                MASK,
                Dtype::U8,
                &[worlds],
                0,
                head + offset,
            );
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut data[offset / 8..]);
            bytes
                .iter_mut()
                .zip(mask)
                .for_each(|(byte, &set)| *byte = u8::from(set));
        }
        // SAFETY: shared memory is zero or was written, and any bits are a line.
        let sent = unsafe { loan.assume_init() }
            .send()
            .map_err(|error| failed(&error))?;
        if sent == 0 {
            self.link.peer.check()?;
            return Err(self.link.peer.lease_lost());
        }
        self.unanswered = true;
        self.link.notify();
        Ok(())
    }

    /// Waits for the answer to the command sent last.
    fn answer(&mut self, op: Op, hook: Hook<'_>) -> Result<FrameSample, ProtocolError> {
        let mut waiting = Answer {
            seq: self.seq,
            epoch: self.epoch,
            subscriber: &self.subscriber,
            service: &self.service,
            peer: &self.link.peer,
            hook,
        };
        let sample = self.paces[op as usize - 1].wait(&self.listener, &mut waiting)?;
        self.unanswered = false;
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
        self.frames.fetch_add(1, Ordering::Acquire);
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

/// Bytes that the largest command of a run takes: every input of a step or of a write, and a mask.
pub(crate) fn command_bytes(description: &Description) -> usize {
    let columns = |inputs: &[InputInfo]| inputs.iter().map(|input| input.columns).sum::<usize>();
    let columns = columns(&description.commands).max(columns(&description.writes));
    let entries = description.worlds * columns * description.real().size();
    // an input may come in several pieces, each rounded up
    let head = Table::head_bytes(ROWS_MAX) + ROWS_MAX * ALIGNMENT;
    head + entries.next_multiple_of(ALIGNMENT) + mask_bytes(description.worlds)
}

fn mask_bytes(worlds: usize) -> usize {
    worlds.next_multiple_of(ALIGNMENT)
}

/// Copies numbers into words, converting them to `real`.
fn copy_values(values: Values<'_>, real: Dtype, words: &mut [u64]) {
    fn into<A: Copy, B: bytemuck::Pod>(values: &[A], words: &mut [u64], convert: impl Fn(A) -> B) {
        let entries: &mut [B] = bytemuck::cast_slice_mut(words);
        entries
            .iter_mut()
            .zip(values)
            .for_each(|(entry, &value)| *entry = convert(value));
    }
    match (values, real) {
        (Values::F32(values), Dtype::F64) => into(values, words, f64::from),
        (Values::F32(values), _) => into(values, words, |value| value),
        (Values::F64(values), Dtype::F64) => into(values, words, |value| value),
        (Values::F64(values), _) => into(values, words, |value| value as f32),
    }
}

/// The thread that confirms the lease; a stopped process has no heartbeat.
#[derive(Debug)]
struct Heart {
    stop: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Heart {
    fn start(link: &Arc<Link>, epoch: u64) -> Heart {
        let stop = Arc::new((Mutex::new(false), Condvar::new()));
        let (link, theirs) = (Arc::clone(link), Arc::clone(&stop));
        let beat = move || {
            let (stopped, signal) = &*theirs;
            let mut guard = lock(stopped);
            while !*guard {
                guard = signal
                    .wait_timeout(guard, HEARTBEAT)
                    .map_or_else(|poison| poison.into_inner().0, |(guard, _)| guard);
                if !*guard {
                    link.tell(&Request::Heartbeat { epoch });
                }
            }
        };
        // without a thread the lease can be taken over while nobody steps, which is a lesser evil than no lease
        let thread = std::thread::Builder::new()
            .name("tightloop-heart".to_owned())
            .spawn(beat)
            .ok();
        Heart { stop, thread }
    }
}

impl Drop for Heart {
    fn drop(&mut self) {
        *lock(&self.stop.0) = true;
        self.stop.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

//! The recording end of a client: every command that a daemon carries out, in order, as it was carried out.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::prelude::{ZeroCopySend, ipc_threadsafe};
use iceoryx2::sample::Sample;

use crate::client::Hook;
use crate::control::{Request, Response};
use crate::host::memory::reserve;
use crate::link::{Link, S, malformed};
use crate::transport::{self, JournalSubscriber, SLICE};
use crate::{ALIGNMENT, Description, Line, ProtocolError, RefusalKind};

/// Entries are looked for this often while none comes: the daemon wakes nobody for them, and a thread that wakes often takes
/// a core from its step.
const NAP: Duration = Duration::from_millis(5);

/// In place of an [`crate::Op`]: nothing comes any more, for the reason that is the command's bytes.
pub(crate) const ENDED: u32 = u32::MAX;

/// Head of an entry of a journal.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("tightloop.JournalHeader.v1")]
pub struct JournalHeader {
    /// Run of the daemon.
    pub session: u64,
    /// 0, 1, 2 … within a journal: a number that does not come was lost.
    pub entry: u64,
    /// Bytes of the command; in a piece of a state, bytes of the whole of it.
    pub bytes: u64,
    /// In a piece of a state, the first of its bytes that are here.
    pub first: u64,
    /// Bytes of the arrays observed, each padded to [`ALIGNMENT`].
    pub observed: u64,
    /// The [`crate::Op`] that was carried out; 0: this is a piece of the state of all worlds at this place; [`ENDED`].
    pub op: u32,
    /// Rows in the field table of the command.
    pub rows: u32,
    /// Digests of the frame; 0 where the inputs were set and nobody was left to get a frame.
    pub digests: u32,
    /// Zero.
    pub reserved: u32,
}
const _: () = assert!(size_of::<JournalHeader>() == 56 && align_of::<JournalHeader>() == 8);

impl JournalHeader {
    /// Whether this is a piece of the state of all worlds.
    pub fn is_state(&self) -> bool {
        self.op == 0
    }

    /// Whether this says why nothing comes any more.
    pub fn is_end(&self) -> bool {
        self.op == ENDED
    }

    /// Bytes of command or piece, of digests and of arrays as they lie in a payload of `payload` bytes, each from the next
    /// line on; `None` when they do not fit there.
    fn parts(&self, payload: usize) -> Option<[usize; 3]> {
        let padded = |bytes: usize| bytes.checked_next_multiple_of(ALIGNMENT);
        let (bytes, first) = (
            usize::try_from(self.bytes).ok()?,
            usize::try_from(self.first).ok()?,
        );
        let body = if self.is_state() {
            bytes.checked_sub(first)?.min(payload)
        } else {
            bytes
        };
        let digests = (self.digests as usize).checked_mul(size_of::<u32>())?;
        let observed = usize::try_from(self.observed).ok()?;
        let needed = padded(body)?
            .checked_add(padded(digests)?)?
            .checked_add(observed)?;
        let is_words = !self.is_state() && !self.is_end();
        let fits = needed <= payload && (!is_words || body % 8 == 0) && observed % 8 == 0;
        fits.then_some([body, digests, observed])
    }
}

/// One entry of a journal, in shared memory until it is dropped.
#[derive(Debug)]
pub struct Entry {
    sample: Sample<ipc_threadsafe::Service, [Line], JournalHeader>,
    parts: [usize; 3],
    /// Entries that were lost right before this one.
    pub lost: u64,
}

impl Entry {
    /// What it is.
    pub fn header(&self) -> &JournalHeader {
        self.sample.user_header()
    }

    /// The command: field table and arrays, as the daemon took them.
    pub fn command(&self) -> &[u64] {
        bytemuck::cast_slice(self.part(0))
    }

    /// A piece of the state of all worlds.
    pub fn piece(&self) -> &[u8] {
        self.part(0)
    }

    /// Why nothing comes any more.
    pub fn reason(&self) -> String {
        String::from_utf8_lossy(self.part(0)).into_owned()
    }

    /// Digests of the frame; see [`crate::digest`].
    pub fn digests(&self) -> &[u32] {
        bytemuck::cast_slice(self.part(1))
    }

    /// The arrays asked for, in the order of the frame, each padded to [`ALIGNMENT`].
    pub fn observed(&self) -> &[u64] {
        bytemuck::cast_slice(self.part(2))
    }

    fn part(&self, index: usize) -> &[u8] {
        let before = self.parts[..index].iter();
        let first = before
            .map(|bytes| bytes.next_multiple_of(ALIGNMENT))
            .sum::<usize>();
        let bytes: &[u8] = bytemuck::cast_slice(self.sample.payload());
        &bytes[first..first + self.parts[index]]
    }
}

/// A subscription to what a daemon does, which ends when this is dropped.
///
/// It begins with the state of all worlds, in pieces; then comes every command that is carried out, after a restore the state
/// again. Worlds that are lost end it, with the reason. The daemon never waits: who does not take its entries in time loses the oldest.
#[derive(Debug)]
pub struct Journal {
    link: Arc<Link>,
    subscriber: JournalSubscriber<S>,
    next: u64,
    looked: Instant,
}

impl Journal {
    /// `fields`: those whose arrays come with each entry.
    pub(crate) fn open(
        link: &Arc<Link>,
        description: &Description,
        fields: &[String],
        hook: Hook<'_>,
    ) -> Result<Journal, ProtocolError> {
        let mut observed = 0;
        for name in fields {
            let known = || description.fields.iter().map(|field| field.name.as_str());
            let Some(row) = known().position(|field| field == name) else {
                return Err(ProtocolError::NoField {
                    field: name.clone(),
                    known: known().collect::<Vec<_>>().join(", "),
                });
            };
            observed |= 1 << row;
        }
        let (journal, port) = match link.ask(&Request::Journal { observed }, hook)? {
            Response::Journal { journal, port } => {
                (journal, u128::from(port[0]) << 64 | u128::from(port[1]))
            }
            Response::NoMemory { free, needed } => {
                return Err(ProtocolError::SharedMemory {
                    path: crate::place::SHARED_MEMORY.to_owned(),
                    free,
                    needed,
                    what: "the journal of a recorder".to_owned(),
                });
            }
            Response::Refused { reason } => {
                let kind = RefusalKind::Backend;
                return Err(ProtocolError::CommandRefused { kind, reason });
            }
            _ => return Err(malformed("the answer to journal")),
        };
        let subscriber = link.with_node(|node| {
            let prefix = node.config().global.prefix.to_string();
            reserve(&prefix, port, "the journal of a recorder")?;
            transport::journal_subscriber(&transport::open_journal(node, journal)?)
        });
        let subscriber = match subscriber {
            Ok(subscriber) => subscriber,
            Err(error) => {
                link.peer.check()?;
                return Err(error);
            }
        };
        // a daemon that sleeps begins the journal when it looks around
        link.notify();
        Ok(Journal {
            link: Arc::clone(link),
            subscriber,
            next: 0,
            looked: Instant::now(),
        })
    }

    /// Entries that may wait at most: of more, the oldest are lost.
    pub fn depth(&self) -> usize {
        self.subscriber.buffer_size()
    }

    /// The next entry; `None` when none came within `timeout`.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`] and its kin, once all entries that it left were returned;
    /// [`ProtocolError::Interrupted`], [`ProtocolError::Malformed`], [`ProtocolError::Transport`].
    pub fn next(
        &mut self,
        timeout: Duration,
        hook: Hook<'_>,
    ) -> Result<Option<Entry>, ProtocolError> {
        let start = Instant::now();
        loop {
            if let Some(entry) = self.receive()? {
                return Ok(Some(entry));
            }
            if self.looked.elapsed() > SLICE {
                self.looked = Instant::now();
                if let Err(gone) = self.link.peer.check() {
                    // what it said last may have come between the two looks
                    return self
                        .receive()
                        .unwrap_or(None)
                        .map_or(Err(gone), |entry| Ok(Some(entry)));
                }
                if let ControlFlow::Break(()) = hook() {
                    return Err(ProtocolError::Interrupted);
                }
            }
            if start.elapsed() >= timeout {
                return Ok(None);
            }
            std::thread::sleep(NAP.min(timeout));
        }
    }

    fn receive(&mut self) -> Result<Option<Entry>, ProtocolError> {
        let received = self.subscriber.receive();
        let sample = match received {
            Ok(None) => return Ok(None),
            Ok(Some(sample)) => sample,
            Err(error) => {
                self.link.peer.check()?;
                return Err(ProtocolError::transport("receive an entry", error));
            }
        };
        let header = *sample.user_header();
        if header.session != self.link.peer.beacon.session || header.entry < self.next {
            return Err(malformed(
                "the head of an entry: another session, or out of order",
            ));
        }
        let parts = header
            .parts(size_of_val(sample.payload()))
            .ok_or_else(|| malformed("the head of an entry: its parts do not fit"))?;
        let lost = header.entry - self.next;
        self.next = header.entry + 1;
        Ok(Some(Entry {
            sample,
            parts,
            lost,
        }))
    }
}

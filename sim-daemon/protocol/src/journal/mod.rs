//! The recording end of a client: every command that a daemon carries out, in order, as it was carried out.

pub mod digest;

use std::ops::ControlFlow;
use std::time::Duration;

use crate::doors::iceoryx2::sample::Sample;
use crate::doors::sync::Arc;
use crate::doors::system::files::shared_memory;
use crate::doors::time::Instant;
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::memory::port::Port;
use crate::presence::connection::{Connection, S, damaged, intact, intact_there, malformed};
use crate::transport::budget::reserve;
use crate::transport::{self, JournalSubscriber};
use crate::waiting::SLICE;
use crate::waiting::hook::Hook;
use crate::wire::control::{Request, Response};
use crate::{ALIGNMENT, Description, JournalHeader, Line, ProtocolError, RefusalKind};

/// Entries are looked for this often while none comes: the daemon wakes nobody for them, and a thread that wakes often takes
/// a core from its step.
const NAP: Duration = Duration::from_millis(5);

/// One entry of a journal, in shared memory until it is dropped.
#[derive(Debug)]
pub struct Entry {
    sample: Port<Sample<S, [Line], JournalHeader>>,
    header: JournalHeader,
    parts: [usize; 3],
    /// Entries that were lost right before this one.
    pub lost: u64,
}

impl Entry {
    /// What it is.
    pub fn header(&self) -> &JournalHeader {
        &self.header
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

    /// Digests of the frame; see [`crate::journal::digest`].
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
    connection: Arc<Connection>,
    subscriber: JournalSubscriber<S>,
    next: u64,
    polled: Instant,
}

impl Journal {
    /// `fields`: those whose arrays come with each entry.
    pub(crate) fn open(
        connection: &Arc<Connection>,
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
        let (journal, port) = match connection.ask(&Request::Journal { observed }, hook)? {
            Response::Journal { journal, port } => {
                (journal, u128::from(port[0]) << 64 | u128::from(port[1]))
            }
            Response::NoMemory { free, needed } => {
                return Err(ProtocolError::SharedMemory {
                    path: shared_memory().to_owned(),
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
        let subscriber = connection.ports(hook, |node| {
            let folder = connection.peer.paths.shared_folder();
            reserve(&folder, port, "the journal of a recorder")?;
            transport::journal_subscriber(&transport::open_journal(node, journal)?)
        })?;
        // a daemon that sleeps begins the journal when it looks around
        connection.notify();
        Ok(Journal {
            connection: Arc::clone(connection),
            subscriber,
            next: 0,
            polled: Instant::now(),
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
            if self.polled.elapsed() > SLICE {
                self.polled = Instant::now();
                intact_there(&self.connection.peer)?;
                if let Err(gone) = self.connection.peer.check() {
                    // what it said last may have come between the two looks
                    return self
                        .receive()
                        .unwrap_or(None)
                        .map_or(Err(gone), |entry| Ok(Some(entry)));
                }
                if let ControlFlow::Break(()) = hook() {
                    return Err(ProtocolError::Interrupted);
                }
                let port = self.subscriber.id().value();
                let peer = &self.connection.peer;
                peer.check_reach(&[peer.reach(port)])?;
            }
            if start.elapsed() >= timeout {
                return Ok(None);
            }
            crate::doors::thread::sleep(NAP.min(timeout));
        }
    }

    fn receive(&mut self) -> Result<Option<Entry>, ProtocolError> {
        let peer = &self.connection.peer;
        let received = guarded(|| self.subscriber.receive())
            .ok_or_else(|| damaged(peer, "receive an entry"))?;
        let sample = match received {
            Ok(None) => return Ok(None),
            Ok(Some(sample)) => Port::with_owner(self.subscriber.owner(), sample),
            Err(error) => {
                self.connection.peer.check()?;
                return Err(ProtocolError::transport("receive an entry", error));
            }
        };
        intact(peer)?;
        let (header, payload) =
            loaned::received(&sample).ok_or_else(|| damaged(peer, "read an entry"))?;
        if header.session != self.connection.peer.beacon.session || header.entry < self.next {
            return Err(malformed(
                "the head of an entry: another session, or out of order",
            ));
        }
        let parts = header
            .parts(size_of_val(payload))
            .ok_or_else(|| malformed("the head of an entry: its parts do not fit"))?;
        let lost = header.entry - self.next;
        self.next = header.entry + 1;
        Ok(Some(Entry {
            sample,
            parts,
            lost,
            header,
        }))
    }
}

//! Journals: to each recorder what its daemon has carried out. Without one, this is a look at an empty list.

use std::time::Duration;

use super::Inbox;
use super::worlds::S;
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::doors::iceoryx2::port::update_connections::UpdateConnections;
use crate::doors::iceoryx2::prelude::{Node, PortFactory};
use crate::doors::time::Instant;
use crate::journal::digest::{digest, digests_of};
use crate::memory::guard::guarded;
use crate::memory::loaned;
use crate::memory::storage;
use crate::transport::budget;
use crate::transport::{self, ControlService, JournalPublisher, JournalService, journal_slots};
use crate::wire::journal_header::{ENDED, JournalHeader};
use crate::{ALIGNMENT, Description, ProtocolError, Row, Table};

/// Recorders that one daemon serves at once.
pub(super) const RECORDERS_MAX: usize = 4;
/// A recorder that lives and did not join its journal within this time, in which it takes the memory, is not coming.
const JOIN_MAX: Duration = Duration::from_secs(10);
/// Shared memory of one journal, if entries are small enough [bytes].
const JOURNAL: usize = 32 << 20;
/// Fewest and most entries that wait for a recorder.
const DEPTH: std::ops::RangeInclusive<usize> = 16..=8192;
/// Entries that wait for a recorder besides the state of all worlds, whose pieces come at once.
const BESIDE_STATE: usize = 8;

/// The journals of a daemon.
#[derive(Debug, Default)]
pub(super) struct Journals {
    open: Vec<Journal>,
    opened: u64,
    /// Why there is nothing to record any more.
    ended: Option<String>,
}

/// One recorder's.
#[derive(Debug)]
struct Journal {
    /// Who asked for it.
    recorder: UniqueClientId,
    service: JournalService<S>,
    publisher: JournalPublisher<S>,
    /// Rows of the frame that it wants whole: a bit each.
    observed: u64,
    slot_bytes: usize,
    since: Instant,
    joined: bool,
    /// It has the state from which it goes on.
    begun: bool,
    /// It was notified that nothing comes any more.
    ended: bool,
    entries: u64,
}

/// What all entries of a frame have in common.
pub(super) struct Occasion<'a> {
    pub(super) description: &'a Description,
    pub(super) inbox: &'a Inbox,
    pub(super) table: &'a Table,
}

impl Journals {
    /// Bytes of an entry, and how many of them wait at most.
    fn size(description: &Description, frame: &Table, observed: u64) -> (usize, usize) {
        let digests = (digests_of(frame) * size_of::<u32>()).next_multiple_of(ALIGNMENT);
        let observed: usize = rows(frame, observed).map(padded).sum();
        let slot = crate::wire::command::command_bytes(description) + digests + observed;
        let pieces = (description.state_bytes as usize).div_ceil(slot);
        let depth = (JOURNAL / slot).clamp(*DEPTH.start(), *DEPTH.end());
        (slot, depth.max(pieces + BESIDE_STATE))
    }

    /// Shared memory that a journal takes, and memory of our own for a state [bytes].
    pub(super) fn bytes(description: &Description, frame: &Table, observed: u64) -> (usize, u64) {
        let (slot, depth) = Journals::size(description, frame, observed);
        let shared = budget::journal_bytes(slot, journal_slots(depth));
        (shared, description.state_bytes)
    }

    /// Lets go of all recorders.
    pub(super) fn lose(&mut self) {
        let open = std::mem::take(&mut self.open);
        guarded(|| drop(open));
    }

    pub(super) fn are_full(&self) -> bool {
        self.open.len() >= RECORDERS_MAX
    }

    /// Opens the next journal; returns its number and the port that sends, whose memory the recorder takes before it
    /// joins: 33 MB are 20 ms, which the worlds would wait.
    pub(super) fn open(
        &mut self,
        node: &Node<S>,
        description: &Description,
        frame: &Table,
        recorder: UniqueClientId,
        observed: u64,
    ) -> Result<(u64, u128), ProtocolError> {
        let (slot_bytes, depth) = Journals::size(description, frame, observed);
        self.opened += 1;
        let service = transport::create_journal(node, self.opened, depth)?;
        let make = || transport::journal_publisher(&service, slot_bytes);
        let publisher = storage::reserved_by_reader(make)?;
        let port = publisher.id().value();
        self.open.push(Journal {
            recorder,
            service,
            publisher,
            observed,
            slot_bytes,
            since: Instant::now(),
            joined: false,
            begun: false,
            ended: false,
            entries: 0,
        });
        Ok((self.opened, port))
    }

    /// Meets new recorders and forgets those that went. Returns whether one waits for the state to begin with.
    pub(super) fn refresh(&mut self, session: u64, control: &ControlService<S>) -> bool {
        self.open.retain_mut(|journal| {
            let recorders = journal.service.dynamic_config().number_of_subscribers();
            journal.joined |= recorders > 0;
            // a recorder that cannot be reached is one that went: the next look tells
            let _ = journal.publisher.update_connections();
            let is_coming = || {
                journal.since.elapsed() < JOIN_MAX
                    && transport::is_present(control, journal.recorder)
            };
            recorders > 0 || (!journal.joined && is_coming())
        });
        self.send_end(session);
        let waits = |journal: &Journal| journal.joined && !journal.begun;
        self.ended.is_none() && self.open.iter().any(waits)
    }

    /// Whether somebody records.
    pub(super) fn are_read(&self) -> bool {
        self.ended.is_none() && self.open.iter().any(|journal| journal.begun)
    }

    /// Why there is nothing to record any more.
    pub(super) fn ended(&self) -> Option<&str> {
        self.ended.as_deref()
    }

    /// Ends all journals, those included that are still to be joined.
    pub(super) fn end(&mut self, session: u64, reason: &str) {
        self.ended = Some(reason.to_owned());
        self.send_end(session);
    }

    fn send_end(&mut self, session: u64) {
        let Some(reason) = &self.ended else {
            return;
        };
        let is_open = |journal: &&mut Journal| journal.joined && !journal.ended;
        for journal in self.open.iter_mut().filter(is_open) {
            journal.ended = true;
            journal.end(session, reason);
        }
    }

    /// Sends the state of all worlds to those who wait for one, or to `all`.
    pub(super) fn state(&mut self, session: u64, state: &[u8], all: bool) {
        for journal in &mut self.open {
            if journal.joined && (all || !journal.begun) {
                journal.begun = true;
                journal.state(session, state);
            }
        }
    }

    /// Leaves out an entry that cannot be sent, so that a gap shows.
    pub(super) fn skip(&mut self) {
        let begun = self.open.iter_mut().filter(|journal| journal.begun);
        begun.for_each(|journal| journal.entries += 1);
    }

    /// Sends what was carried out, with the digests of the frame in `arena` if there is one.
    pub(super) fn entry(&mut self, occasion: &Occasion<'_>, arena: Option<&[u64]>) {
        for journal in self.open.iter_mut().filter(|journal| journal.begun) {
            journal.entry(occasion, arena);
        }
    }
}

impl Journal {
    fn end(&mut self, session: u64, reason: &str) {
        let room = reason.floor_char_boundary(self.slot_bytes);
        let reason = &reason.as_bytes()[..room];
        let header = JournalHeader {
            session,
            bytes: reason.len() as u64,
            op: ENDED,
            ..JournalHeader::default()
        };
        let padded = reason.len().next_multiple_of(ALIGNMENT);
        self.send(header, padded, |bytes| {
            bytes[..reason.len()].copy_from_slice(reason);
        });
    }

    fn state(&mut self, session: u64, state: &[u8]) {
        for (index, piece) in state.chunks(self.slot_bytes).enumerate() {
            let header = JournalHeader {
                session,
                bytes: state.len() as u64,
                first: (index * self.slot_bytes) as u64,
                ..JournalHeader::default()
            };
            self.send(header, piece.len(), |bytes| {
                bytes[..piece.len()].copy_from_slice(piece);
            });
        }
    }

    fn entry(&mut self, occasion: &Occasion<'_>, arena: Option<&[u64]>) {
        let (inbox, frame) = (occasion.inbox, occasion.table);
        let command: &[u8] = bytemuck::cast_slice(inbox.payload());
        let digests = arena.map_or(0, |_| digests_of(frame));
        let observed: usize = match arena {
            Some(_) => rows(frame, self.observed).map(padded).sum(),
            None => 0,
        };
        let header = JournalHeader {
            session: occasion.description.session,
            bytes: command.len() as u64,
            observed: observed as u64,
            op: inbox.op() as u32,
            rows: inbox.header().rows,
            digests: digests as u32,
            ..JournalHeader::default()
        };
        let of_command = command.len().next_multiple_of(ALIGNMENT);
        let of_digests = (digests * size_of::<u32>()).next_multiple_of(ALIGNMENT);
        let wanted = self.observed;
        self.send(header, of_command + of_digests + observed, |bytes| {
            bytes[..command.len()].copy_from_slice(command);
            let Some(arena) = arena else {
                return;
            };
            let bytes = &mut bytes[of_command..];
            let room = &mut bytes[..digests * size_of::<u32>()];
            digest(frame, arena, bytemuck::cast_slice_mut(room));
            let mut rest = &mut bytes[of_digests..];
            let (from, head): (&[u8], _) = (
                bytemuck::cast_slice(arena),
                Table::head_bytes(frame.rows().len()),
            );
            for row in rows(frame, wanted) {
                let (array, others) = rest.split_at_mut(padded(row));
                array[..row.bytes].copy_from_slice(&from[row.offset - head..][..row.bytes]);
                rest = others;
            }
        });
    }

    /// Sends an entry of at most `slot_bytes`. One that cannot be sent is a number that does not come.
    fn send(&mut self, header: JournalHeader, bytes: usize, fill: impl FnOnce(&mut [u8])) {
        let entry = self.entries;
        self.entries += 1;
        let lines = bytes.div_ceil(ALIGNMENT);
        let Some(Ok(mut loan)) = loaned::loan(&self.publisher, lines) else {
            return;
        };
        fill(bytemuck::cast_slice_mut(loaned::words(loan.payload_mut())));
        *loan.user_header_mut() = JournalHeader { entry, ..header };
        // a recorder that cannot be reached is one that went: the next look tells
        guarded(|| loaned::send(loan));
    }
}

/// The rows of a frame that are wanted whole.
fn rows(frame: &Table, observed: u64) -> impl Iterator<Item = &Row> {
    let wanted = move |(index, _): &(usize, &Row)| observed >> index & 1 == 1;
    frame
        .rows()
        .iter()
        .enumerate()
        .filter(wanted)
        .map(|(_, row)| row)
}

fn padded(row: &Row) -> usize {
    row.bytes.next_multiple_of(ALIGNMENT)
}

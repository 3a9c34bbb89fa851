//! Connections: samples that wait for a receiver, and slots on their way back.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;

use super::bag::{Entry, Lane, Role};
use super::degradation::Handler;
use super::names::Names;
use super::slot::Slot;
use super::wires::Parcel;

/// Which end of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    Sender,
    Receiver,
}

/// From a port that sends to one that receives.
#[derive(Debug)]
pub(crate) struct Connection {
    pub(crate) path: PathBuf,
    pub(crate) lane: Lane,
    pub(crate) sender: bool,
    pub(crate) receiver: bool,
    /// Nobody joins any more.
    pub(crate) marked: bool,
    pub(crate) channels: Vec<Channel>,
}

/// One of its queues.
#[derive(Debug, Default)]
pub(crate) struct Channel {
    /// The request that it answers; 0 when closed.
    pub(crate) state: u64,
    pub(crate) waiting: VecDeque<Parcel>,
    pub(crate) returned: VecDeque<usize>,
    /// Slots that were sent and did not come back.
    pub(crate) used: Vec<usize>,
}

/// A port that sends, as its process knows it.
#[derive(Debug)]
pub(crate) struct Outlet {
    pub(crate) node: u128,
    pub(crate) service: u128,
    pub(crate) role: Role,
    pub(crate) names: Names,
    /// Changes of the list of receivers that were seen.
    pub(crate) seen: Option<u64>,
    /// Connections by receiver.
    pub(crate) peers: BTreeMap<u128, u64>,
    /// Its port is there, and not only a loan of it.
    pub(crate) is_active: bool,
    pub(crate) loans: usize,
    pub(crate) loans_max: usize,
    /// Room for the header and for the payload of a slot [bytes].
    pub(crate) slot_bytes: (usize, usize),
    /// Entries that a slot has room for.
    pub(crate) length_max: usize,
    pub(crate) slots: BTreeMap<usize, Arc<Slot>>,
    references: Vec<u32>,
    pub(crate) free: Vec<usize>,
    pub(crate) history: VecDeque<usize>,
    history_max: usize,
    pub(crate) requests: RequestCounts,
    pub(crate) handler: Option<Handler>,
}

/// What a client knows of its requests.
#[derive(Debug, Default)]
pub(crate) struct RequestCounts {
    pub(crate) loaned: usize,
    pub(crate) active: usize,
    /// Channels that no request has.
    pub(crate) channels: VecDeque<usize>,
    pub(crate) last: u64,
}

/// A port that receives, as its process knows it.
#[derive(Debug)]
pub(crate) struct Inlet {
    pub(crate) node: u128,
    pub(crate) service: u128,
    pub(crate) role: Role,
    pub(crate) names: Names,
    pub(crate) seen: Option<u64>,
    /// Links by sender.
    pub(crate) peers: BTreeMap<u128, u64>,
    /// Links that have samples yet, of senders that are gone.
    pub(crate) expired: Vec<u64>,
    pub(crate) links: BTreeMap<u64, Link>,
    pub(crate) entry: Entry,
    pub(crate) handler: Option<Handler>,
}

/// The end of a connection at a receiver.
#[derive(Debug)]
pub(crate) struct Link {
    pub(crate) connection: u64,
    pub(crate) sender: u128,
    pub(crate) borrowed: Vec<usize>,
}

/// A sample that was received.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) parcel: Parcel,
    pub(crate) link: u64,
    pub(crate) sender: u128,
    pub(crate) channel: usize,
}

/// Every channel of a receiver that has samples has as many out as it may.
#[derive(Debug)]
pub(crate) struct TooMany;

impl Connection {
    pub(crate) fn new(path: PathBuf, lane: Lane) -> Connection {
        let channels = (0..lane.channels).map(|_| Channel::default()).collect();
        Connection {
            path,
            lane,
            sender: false,
            receiver: false,
            marked: false,
            channels,
        }
    }

    fn end(&mut self, end: End) -> &mut bool {
        match end {
            End::Sender => &mut self.sender,
            End::Receiver => &mut self.receiver,
        }
    }

    /// Joins it, unless somebody has or it is being removed.
    pub(crate) fn join(&mut self, end: End) -> bool {
        let marked = self.marked;
        let joined = self.end(end);
        if *joined || marked {
            return false;
        }
        *joined = true;
        true
    }

    /// Leaves it; says whether its file is to be removed. Who had not joined leaves nothing.
    pub(crate) fn leave(&mut self, end: End) -> bool {
        if self.marked {
            return true;
        }
        let was_there = std::mem::take(self.end(end));
        self.marked = was_there && !self.sender && !self.receiver;
        self.marked
    }

    pub(crate) fn has_samples(&self) -> bool {
        let mut channels = self.channels.iter();
        channels.any(|channel| !channel.waiting.is_empty())
    }
}

impl Outlet {
    /// A port with so many slots.
    pub(crate) fn new(
        (node, service, role): (u128, u128, Role),
        names: Names,
        slots: usize,
        history_max: usize,
    ) -> Outlet {
        Outlet {
            node,
            service,
            role,
            names,
            seen: None,
            peers: BTreeMap::new(),
            is_active: true,
            loans: 0,
            loans_max: slots,
            slot_bytes: (0, 0),
            length_max: 0,
            slots: BTreeMap::new(),
            references: vec![0; slots],
            free: (0..slots).rev().collect(),
            history: VecDeque::new(),
            history_max,
            requests: RequestCounts::default(),
            handler: None,
        }
    }

    pub(crate) fn borrow(&mut self, index: usize) {
        self.references[index] += 1;
    }

    pub(crate) fn release(&mut self, index: usize) {
        self.references[index] -= 1;
        if self.references[index] == 0 {
            self.free.push(index);
        }
    }

    pub(crate) fn keep(&mut self, index: usize) {
        if self.history_max == 0 {
            return;
        }
        self.borrow(index);
        self.history.push_back(index);
        if self.history.len() > self.history_max
            && let Some(oldest) = self.history.pop_front()
        {
            self.release(oldest);
        }
    }
}

impl Inlet {
    /// What a port knows that has met nobody.
    pub(crate) fn new(
        (node, service, role): (u128, u128, Role),
        names: Names,
        entry: Entry,
    ) -> Inlet {
        Inlet {
            node,
            service,
            role,
            names,
            seen: None,
            peers: BTreeMap::new(),
            expired: Vec::new(),
            links: BTreeMap::new(),
            entry,
            handler: None,
        }
    }
}

//! What all who opened a service share: its settings, and who is there.

use std::collections::BTreeMap;

use ::iceoryx2::prelude::AttributeSet;
/// Sorts of ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    Publisher,
    Subscriber,
    Client,
    Server,
    Listener,
    Notifier,
}

impl Role {
    /// Those whom a port exchanges samples with.
    pub(crate) fn others(self) -> Role {
        match self {
            Role::Publisher => Role::Subscriber,
            Role::Subscriber => Role::Publisher,
            Role::Client => Role::Server,
            Role::Server => Role::Client,
            Role::Listener => Role::Notifier,
            Role::Notifier => Role::Listener,
        }
    }
}

/// Messaging patterns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pattern {
    PublishSubscribe,
    RequestResponse,
    Event,
}

/// How samples go one way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Lane {
    /// Samples that wait at most.
    pub(crate) buffer: usize,
    /// Samples that a receiver may hold.
    pub(crate) borrowed: usize,
    /// Whether the oldest sample goes for a new one.
    pub(crate) overflow: bool,
    pub(crate) channels: usize,
}

/// What a service was created with.
#[derive(Debug, Clone)]
pub(crate) struct Settings {
    pub(crate) pattern: Pattern,
    /// Names of payloads and headers.
    pub(crate) types: Vec<&'static str>,
    pub(crate) nodes_max: usize,
    /// Ports at most, by role.
    pub(crate) ports_max: BTreeMap<Role, usize>,
    /// Samples, or requests; and answers.
    pub(crate) lanes: [Lane; 2],
    pub(crate) history: usize,
    pub(crate) requests: Requests,
    pub(crate) attributes: AttributeSet,
}

/// Limits of requests.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Requests {
    pub(crate) active: usize,
    pub(crate) loaned: usize,
    pub(crate) fire_and_forget: bool,
}

/// How far the creation of a service got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stage {
    /// The settings cannot be read yet.
    Locked,
    Readable,
    Whole,
}

/// A service.
#[derive(Debug)]
pub(crate) struct Service {
    pub(crate) settings: Settings,
    pub(crate) stage: Stage,
    pub(crate) nodes: Vec<u128>,
    /// The last node went: it is being removed.
    pub(crate) locked: bool,
    bags: BTreeMap<Role, Bag>,
}

/// Ports that are there, dead ones included.
#[derive(Debug, Default)]
struct Bag {
    entries: Vec<Entry>,
    /// Grows with each change.
    changes: u64,
}

/// A port as others see it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) port: u128,
    pub(crate) node: u128,
    /// Samples that wait for it at most.
    pub(crate) buffer: usize,
    /// Old samples that it wants.
    pub(crate) history: usize,
}

impl Service {
    pub(crate) fn new(settings: Settings) -> Service {
        Service {
            settings,
            stage: Stage::Locked,
            nodes: Vec::new(),
            locked: false,
            bags: BTreeMap::new(),
        }
    }

    pub(crate) fn entries(&self, role: Role) -> &[Entry] {
        self.bags.get(&role).map_or(&[], |bag| &bag.entries)
    }

    /// How often ports came or went.
    pub(crate) fn changes(&self, role: Role) -> u64 {
        self.bags.get(&role).map_or(0, |bag| bag.changes)
    }

    /// Adds a port, if there is room.
    pub(crate) fn add(&mut self, role: Role, entry: Entry) -> bool {
        let most = self.settings.ports_max.get(&role).copied().unwrap_or(0);
        let bag = self.bags.entry(role).or_default();
        if bag.entries.len() >= most {
            return false;
        }
        bag.entries.push(entry);
        bag.changes += 1;
        true
    }

    /// Removes a port; says whether it was there.
    pub(crate) fn remove(&mut self, role: Role, port: u128) -> bool {
        let Some(bag) = self.bags.get_mut(&role) else {
            return false;
        };
        let before = bag.entries.len();
        bag.entries.retain(|entry| entry.port != port);
        let was_there = bag.entries.len() < before;
        bag.changes += u64::from(was_there);
        was_there
    }

    /// Lets go of a node; says whether it was the last one.
    pub(crate) fn leave(&mut self, node: u128) -> bool {
        self.nodes.retain(|other| *other != node);
        if self.nodes.is_empty() && !self.locked {
            self.locked = true;
            return true;
        }
        false
    }

    /// How the samples from a port of that role go, to a receiver that lets so many wait.
    pub(crate) fn lane(&self, sender: Role, receiver: &Entry) -> Lane {
        match sender {
            Role::Server => self.settings.lanes[1],
            Role::Client => self.settings.lanes[0],
            _ => Lane {
                buffer: receiver.buffer,
                ..self.settings.lanes[0]
            },
        }
    }
}

/// A number of a service's name and pattern, in the names of files.
pub(crate) fn service_hash(name: &str, pattern: Pattern) -> String {
    let pattern = format!("{pattern:?}");
    let hash = super::hash(&[name, &pattern]);
    let other = super::hash(&[&pattern, name]);
    format!("{hash:016x}{other:016x}{:08x}", hash as u32)
}

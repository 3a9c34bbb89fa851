//! Samples on their way: loaned, delivered, taken, and given back.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::queue::{Connection, Outlet, Received, TooMany};
use super::slot::Slot;
use super::wires::{Parcel, Wires};
use crate::world::World;

/// Takes slots back that receivers returned.
fn take_back(outlet: &mut Outlet, connections: &mut BTreeMap<u64, Connection>) {
    let peers: Vec<u64> = outlet.peers.values().copied().collect();
    for id in peers {
        let Some(connection) = connections.get_mut(&id) else {
            continue;
        };
        for channel in &mut connection.channels {
            while let Some(index) = channel.returned.pop_front() {
                channel.used.retain(|used| *used != index);
                outlet.release(index);
            }
        }
    }
}

/// Puts a sample into a channel; says whether it is there.
fn put(outlet: &mut Outlet, connection: &mut Connection, channel: usize, parcel: Parcel) -> bool {
    let lane = connection.lane;
    let channel = &mut connection.channels[channel];
    let is_full = channel.waiting.len() >= lane.buffer.max(1);
    if is_full && !lane.overflow {
        return false;
    }
    outlet.borrow(parcel.index);
    channel.used.push(parcel.index);
    channel.waiting.push_back(parcel);
    if is_full && let Some(oldest) = channel.waiting.pop_front() {
        channel.used.retain(|used| *used != oldest.index);
        outlet.release(oldest.index);
    }
    true
}

impl World {
    /// Loans a slot; `None` when none is free.
    pub(crate) fn loan(&mut self, port: u128) -> Option<Parcel> {
        let Wires {
            outlets,
            connections,
            ..
        } = &mut self.wires;
        let outlet = outlets.get_mut(&port)?;
        take_back(outlet, connections);
        // as a rule the one that came back last, which readers would notice first
        let last = outlet.free.len().checked_sub(1)?;
        let place = match self.rng.bool() {
            true => last,
            false => self.rng.usize(0..=last),
        };
        let index = outlet.free.swap_remove(place);
        outlet.borrow(index);
        outlet.loans += 1;
        let (head, bytes) = outlet.slot_bytes;
        let make = || Arc::new(Slot::new(head, bytes));
        let slot = Arc::clone(outlet.slots.entry(index).or_insert_with(make));
        let seed = self.rng.u64(..);
        let nodes = &self.wires.nodes;
        let is_read = slot.readers(|readers| {
            let lives = |node: &u128| nodes.get(node).is_some_and(|node| node.lives);
            readers.iter().any(lives)
        });
        if is_read {
            self.wires.overwritten += 1;
            self.line(|| format!("port {port} writes over a sample that somebody reads"));
        }
        slot.fill(seed);
        Some(Parcel { index, slot })
    }

    /// Gives a loan back, sent or not.
    pub(crate) fn give_back(&mut self, port: u128, index: usize) {
        if let Some(outlet) = self.wires.outlets.get_mut(&port) {
            outlet.release(index);
            outlet.loans -= 1;
        }
    }

    /// Delivers a sample to all receivers, or to one; returns to how many.
    pub(crate) fn deliver(
        &mut self,
        port: u128,
        parcel: &Parcel,
        channel: usize,
        only: Option<u128>,
    ) -> usize {
        let Wires {
            outlets,
            connections,
            ..
        } = &mut self.wires;
        let Some(outlet) = outlets.get_mut(&port) else {
            return 0;
        };
        if only.is_none() {
            outlet.keep(parcel.index);
        }
        take_back(outlet, connections);
        let wanted = |peer: &u128| only.is_none_or(|only| only == *peer);
        let peers = outlet.peers.iter().filter(|(peer, _)| wanted(peer));
        let peers: Vec<u64> = peers.map(|(_, id)| *id).collect();
        let mut count = 0;
        for id in peers {
            if let Some(connection) = connections.get_mut(&id) {
                count += usize::from(put(outlet, connection, channel, parcel.clone()));
            }
        }
        count
    }

    /// Gives a new receiver the newest samples that it wants.
    pub(crate) fn deliver_history(&mut self, port: u128, connection: u64, wanted: usize) {
        let Wires {
            outlets,
            connections,
            ..
        } = &mut self.wires;
        let Some(outlet) = outlets.get_mut(&port) else {
            return;
        };
        let Some(buffer) = connections.get(&connection).map(|there| there.lane.buffer) else {
            return;
        };
        let count = wanted.min(buffer);
        let first = outlet.history.len().saturating_sub(count);
        let old: Vec<usize> = outlet.history.iter().skip(first).copied().collect();
        for index in old {
            take_back(outlet, connections);
            let slot = outlet.slots.get(&index).cloned();
            if let (Some(slot), Some(connection)) = (slot, connections.get_mut(&connection)) {
                put(outlet, connection, 0, Parcel { index, slot });
            }
        }
    }

    /// A sender lets go of a connection, with all slots that are out there.
    pub(crate) fn drop_peer(&mut self, port: u128, peer: u128) -> Option<u64> {
        let Wires {
            outlets,
            connections,
            ..
        } = &mut self.wires;
        let outlet = outlets.get_mut(&port)?;
        let id = outlet.peers.remove(&peer)?;
        for channel in &mut connections.get_mut(&id)?.channels {
            for index in std::mem::take(&mut channel.used) {
                outlet.release(index);
            }
        }
        Some(id)
    }

    /// Whether a link has samples, and whether some of them are out.
    pub(crate) fn is_used(&self, inlet: u128, link: u64) -> bool {
        let inlet = self.wires.inlets.get(&inlet);
        let link = inlet.and_then(|inlet| inlet.links.get(&link));
        link.is_some_and(|link| {
            let connection = self.wires.connections.get(&link.connection);
            connection.is_some_and(Connection::has_samples)
                || link.borrowed.iter().any(|count| *count > 0)
        })
    }

    /// Takes the next sample of a channel, of senders that are gone first. Also the links that are to be let go of.
    pub(crate) fn take(
        &mut self,
        port: u128,
        channel: usize,
    ) -> Result<(Option<Received>, Vec<u64>), TooMany> {
        let Some(inlet) = self.wires.inlets.get(&port) else {
            return Ok((None, Vec::new()));
        };
        let mut empty = Vec::new();
        for id in inlet.expired.clone() {
            match self.take_from(port, id, channel) {
                Ok(Some(received)) => return Ok((Some(received), empty)),
                Ok(None) if !self.is_used(port, id) => empty.push(id),
                _ => {}
            }
        }
        let links: Vec<u64> = self
            .wires
            .inlets
            .get(&port)
            .map_or(Vec::new(), |inlet| inlet.links.keys().copied().collect());
        let mut full = false;
        for id in links {
            match self.take_from(port, id, channel) {
                Ok(Some(received)) => return Ok((Some(received), empty)),
                Ok(None) => {}
                Err(TooMany) => full = true,
            }
        }
        match full {
            true => Err(TooMany),
            false => Ok((None, empty)),
        }
    }

    fn take_from(
        &mut self,
        port: u128,
        id: u64,
        channel: usize,
    ) -> Result<Option<Received>, TooMany> {
        let Wires {
            inlets,
            connections,
            ..
        } = &mut self.wires;
        let Some(inlet) = inlets.get_mut(&port) else {
            return Ok(None);
        };
        let node = inlet.node;
        let Some(link) = inlet.links.get_mut(&id) else {
            return Ok(None);
        };
        let Some(connection) = connections.get_mut(&link.connection) else {
            return Ok(None);
        };
        let waiting = &mut connection.channels[channel].waiting;
        if waiting.is_empty() {
            return Ok(None);
        }
        if link.borrowed[channel] >= connection.lane.borrowed.max(1) {
            return Err(TooMany);
        }
        let parcel = waiting.pop_front().expect("it is not empty");
        link.borrowed[channel] += 1;
        parcel.slot.readers(|readers| readers.push(node));
        Ok(Some(Received {
            parcel,
            link: id,
            sender: link.sender,
            channel,
        }))
    }

    /// Gives a sample back that was received.
    pub(crate) fn put_back(&mut self, port: u128, received: &Received) {
        let Wires {
            inlets,
            connections,
            ..
        } = &mut self.wires;
        let Some(inlet) = inlets.get_mut(&port) else {
            return;
        };
        let node = inlet.node;
        received.parcel.slot.readers(|readers| {
            if let Some(place) = readers.iter().position(|reader| *reader == node) {
                readers.swap_remove(place);
            }
        });
        if let Some(link) = inlet.links.get_mut(&received.link)
            && let Some(connection) = connections.get_mut(&link.connection)
        {
            link.borrowed[received.channel] -= 1;
            let channel = &mut connection.channels[received.channel];
            channel.returned.push_back(received.parcel.index);
        }
    }
}

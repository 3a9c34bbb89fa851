//! How ports meet: each looks at the list of the others when that has changed, joins a connection with those that are new, and
//! leaves those of who is gone. A connection that cannot be joined is tried again only when the list changes again.

use std::path::PathBuf;

use super::bag::{Entry, Role};
use super::degradation::degrade;
use super::queue::{Connection, End, Link};
use super::wires::Wires;
use crate::world::{World, step, system_call, with};

/// Bytes of a connection's file, at least, and for each of its slots.
const CONNECTION: u64 = 1024;
const SLOT: u64 = 24;

/// What a port has to do about its list.
struct Plan {
    role: Role,
    service: u128,
    others: Vec<Entry>,
    /// Of ports that send and that receive.
    gone: [Vec<u128>; 2],
}

impl World {
    fn plan(&mut self, port: u128, forced: bool) -> Option<Plan> {
        let Wires {
            outlets,
            inlets,
            services,
            ..
        } = &mut self.wires;
        let (mut outlet, mut inlet) = (outlets.get_mut(&port), inlets.get_mut(&port));
        let (service, role) = match (&outlet, &inlet) {
            (Some(outlet), _) => (outlet.service, outlet.role),
            (None, Some(inlet)) => (inlet.service, inlet.role),
            (None, None) => return None,
        };
        let there = services.get(&service)?;
        let changes = Some(there.changes(role.others()));
        let seen = outlet.as_ref().map(|outlet| outlet.seen);
        let seen = seen.or(inlet.as_ref().map(|inlet| inlet.seen));
        if seen == Some(changes) && !forced {
            return None;
        }
        let others = there.entries(role.others()).to_vec();
        if let Some(outlet) = &mut outlet {
            outlet.seen = changes;
        }
        if let Some(inlet) = &mut inlet {
            inlet.seen = changes;
        }
        let is_gone = |peer: &u128| others.iter().all(|entry| entry.port != *peer);
        let gone = [
            outlet.map_or(Vec::new(), |outlet| {
                outlet.peers.keys().copied().filter(is_gone).collect()
            }),
            inlet.map_or(Vec::new(), |inlet| {
                inlet.peers.keys().copied().filter(is_gone).collect()
            }),
        ];
        Some(Plan {
            role,
            service,
            others,
            gone,
        })
    }
}

/// Looks at the list of a port, if it has changed.
pub(crate) fn refresh(port: u128, forced: bool) {
    let Some(plan) = with(|world| world.plan(port, forced)) else {
        return;
    };
    for other in &plan.others {
        let is_new = |world: &mut World| {
            let Wires {
                outlets, inlets, ..
            } = &world.wires;
            let sends = outlets.get(&port);
            let receives = inlets.get(&port);
            (
                receives.is_some_and(|inlet| !inlet.peers.contains_key(&other.port)),
                sends.is_some_and(|outlet| !outlet.peers.contains_key(&other.port)),
            )
        };
        let (receives, sends) = with(is_new);
        if receives {
            join(&plan, (other.port, port), End::Receiver, other);
        }
        if sends {
            join(&plan, (port, other.port), End::Sender, other);
        }
    }
    let [receivers, senders] = &plan.gone;
    for gone in senders {
        expire(port, *gone);
    }
    for gone in receivers {
        if let Some(connection) = with(|world| world.drop_peer(port, *gone)) {
            leave(connection, End::Sender);
        }
    }
}

/// Joins a connection; what fails is reported, and left until the list changes.
fn join(plan: &Plan, ports: (u128, u128), end: End, other: &Entry) {
    if !is_joined(plan, ports, end, other) {
        degrade(plan.service, ports, end);
    }
}

fn is_joined(plan: &Plan, (sender, receiver): (u128, u128), end: End, other: &Entry) -> bool {
    let port = match end {
        End::Sender => sender,
        End::Receiver => receiver,
    };
    if system_call("opens a connection").is_err() {
        return false;
    }
    let Some(connection) = with(|world| world.connection(plan, (sender, receiver), end, other))
    else {
        return false;
    };
    step("joins a connection");
    let joined = with(|world| {
        world.files.changes += 1;
        let joined = world.wires.connections.get_mut(&connection);
        joined.is_some_and(|joined| joined.join(end))
    });
    if !joined {
        return false;
    }
    match end {
        End::Sender => with(|world| {
            if let Some(outlet) = world.wires.outlets.get_mut(&port) {
                outlet.peers.insert(receiver, connection);
            }
            world.deliver_history(port, connection, other.history);
        }),
        End::Receiver => {
            let opened = system_call("opens a segment").is_ok()
                && with(|world| world.open_segment(port, sender, connection));
            if !opened {
                leave(connection, End::Receiver);
                return false;
            }
        }
    }
    true
}

impl World {
    /// The connection whose file is there, or a new one.
    fn connection(
        &mut self,
        plan: &Plan,
        (sender, receiver): (u128, u128),
        end: End,
        other: &Entry,
    ) -> Option<u64> {
        let wires = &self.wires;
        let (names, entry) = match end {
            End::Sender => (&wires.outlets.get(&sender)?.names, *other),
            End::Receiver => {
                let inlet = wires.inlets.get(&receiver)?;
                (&inlet.names, inlet.entry)
            }
        };
        let path = names.connection(sender, receiver);
        if self.files.exists(&path) {
            return wires.connected.get(&path).copied();
        }
        let role = match end {
            End::Sender => plan.role,
            End::Receiver => plan.role.others(),
        };
        let lane = wires.services.get(&plan.service)?.lane(role, &entry);
        let slots = (lane.buffer + lane.borrowed) * lane.channels;
        let bytes = CONNECTION + SLOT * slots as u64;
        self.files.put(&path, bytes).ok()?;
        self.wires.last += 1;
        let id = self.wires.last;
        let connection = Connection::new(path.clone(), lane);
        self.wires.connections.insert(id, connection);
        self.wires.connected.insert(path, id);
        Some(id)
    }

    /// Opens the memory of a sender, whose file must be there.
    fn open_segment(&mut self, port: u128, sender: u128, connection: u64) -> bool {
        let Wires {
            inlets,
            segments,
            connections,
            last,
            ..
        } = &mut self.wires;
        let Some(inlet) = inlets.get_mut(&port) else {
            return false;
        };
        let is_there = segments.contains(&sender) && self.files.exists(&inlet.names.data(sender));
        let Some(channels) = connections
            .get(&connection)
            .map(|there| there.lane.channels)
        else {
            return false;
        };
        if !is_there {
            return false;
        }
        *last += 1;
        inlet.peers.insert(sender, *last);
        let link = Link {
            connection,
            sender,
            borrowed: vec![0; channels],
        };
        inlet.links.insert(*last, link);
        true
    }
}

/// A receiver lets go of a sender that went, once it has received everything.
fn expire(port: u128, sender: u128) {
    let unused = with(|world| {
        let link = world.wires.inlets.get_mut(&port)?.peers.remove(&sender)?;
        if world.is_used(port, link) {
            world.wires.inlets.get_mut(&port)?.expired.push(link);
            return None;
        }
        Some(link)
    });
    if let Some(link) = unused {
        unlink(port, link);
    }
}

/// A receiver leaves a connection.
pub(crate) fn unlink(port: u128, link: u64) {
    let connection = with(|world| {
        let inlet = world.wires.inlets.get_mut(&port)?;
        inlet.expired.retain(|other| *other != link);
        Some(inlet.links.remove(&link)?.connection)
    });
    if let Some(connection) = connection {
        leave(connection, End::Receiver);
    }
}

/// Leaves a connection; who leaves last removes its file.
pub(crate) fn leave(connection: u64, end: End) {
    step("leaves a connection");
    let path = with(|world| {
        world.files.changes += 1;
        mark(world, connection, end)
    });
    if let Some(path) = path {
        remove("removes a connection", path);
    }
}

fn mark(world: &mut World, id: u64, end: End) -> Option<PathBuf> {
    let connection = world.wires.connections.get_mut(&id)?;
    connection.leave(end).then(|| connection.path.clone())
}

/// Removes a file.
pub(crate) fn remove(door: &str, path: PathBuf) {
    step(door);
    with(|world| world.files.remove(&path));
}

/// Takes a dead port off a connection, whose file is there.
pub(crate) fn detach(path: PathBuf, end: End) {
    step("takes a dead port off a connection");
    let is_last = with(|world| {
        if !world.files.exists(&path) {
            return false;
        }
        let Some(id) = world.wires.connected.get(&path).copied() else {
            return false;
        };
        if let Some(connection) = world.wires.connections.get_mut(&id) {
            connection
                .channels
                .iter_mut()
                .for_each(|channel| channel.state = 0);
        }
        mark(world, id, end).is_some()
    });
    if is_last {
        remove("removes a connection", path);
    }
}

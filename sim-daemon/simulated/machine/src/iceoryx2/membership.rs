//! Who is there: a node's hold on a service, a port's on both, and what each removes when it goes.

use std::path::PathBuf;
use std::sync::Arc;

use super::bag::{Entry, Role};
use super::connect::{self, leave, unlink};
use super::names::Names;
use super::node::NodeHandle;
use super::queue::End;
use crate::world::{is_on, step, system_call, with};
use ::iceoryx2::prelude::{AttributeSet, ServiceName};

/// A service that a node has open.
#[derive(Debug)]
pub(crate) struct ServiceHandle {
    pub(crate) id: u128,
    pub(crate) name: ServiceName,
    pub(crate) hash: String,
    pub(crate) attributes: AttributeSet,
    pub(crate) node: Arc<NodeHandle>,
}

/// Ports that are counted or listed.
#[derive(Debug)]
pub(crate) struct Dynamic {
    service: u128,
}

impl Dynamic {
    pub(crate) fn new(service: u128) -> Dynamic {
        Dynamic { service }
    }

    /// Ports of that sort, dead ones included.
    pub(crate) fn entries(&self, role: Role) -> Vec<Entry> {
        if !is_on() {
            return Vec::new();
        }
        step("looks who is there");
        with(|world| {
            let service = world.wires.services.get(&self.service);
            service.map_or(Vec::new(), |service| service.entries(role).to_vec())
        })
    }
}

impl Drop for ServiceHandle {
    fn drop(&mut self) {
        if !is_on() {
            return;
        }
        step("closes a service");
        let (node, names) = (self.node.id, &self.node.names);
        let left = with(|world| {
            let counts = &mut world.wires.nodes.get_mut(&node)?.services;
            let count = counts.get_mut(&self.id)?;
            *count -= 1;
            if *count > 0 {
                return None;
            }
            counts.remove(&self.id);
            Some(world.wires.services.get_mut(&self.id)?.leave(node))
        });
        let Some(is_last) = left else {
            return;
        };
        connect::remove(
            "removes the tag of a service",
            names.service_tag(node, &self.hash),
        );
        if is_last {
            remove_service(names, self.id, &self.hash);
        }
    }
}

/// Removes the files of a service that is locked.
pub(crate) fn remove_service(names: &Names, id: u128, hash: &str) {
    connect::remove("removes a service", names.dynamic(id));
    connect::remove("removes the settings of a service", names.service(hash));
}

/// A port, and those who have a sample of it.
#[derive(Debug)]
pub(crate) struct Port {
    pub(crate) id: u128,
    pub(crate) role: Role,
    /// There until it is dropped.
    service: Option<Arc<ServiceHandle>>,
    pub(crate) service_id: u128,
    pub(crate) node: Arc<NodeHandle>,
    tag: PathBuf,
}

/// The system has no room, or refuses.
#[derive(Debug)]
pub(crate) struct Refused;

/// Makes a file of so many bytes.
pub(crate) fn make(door: &str, path: &std::path::Path, bytes: u64) -> Result<(), Refused> {
    system_call(door).map_err(|_| Refused)?;
    with(|world| world.files.put(path, bytes)).map_err(|_| Refused)
}

impl Port {
    /// A port with a tag in its node's folder, and nothing else.
    pub(crate) fn tagged(service: &Arc<ServiceHandle>, role: Role) -> Result<Port, Refused> {
        let node = &service.node;
        let id = with(|world| world.unique());
        let tag = node.names.port_tag(node.id, id);
        make("makes the tag of a port", &tag, 0)?;
        Ok(Port {
            id,
            role,
            service: Some(Arc::clone(service)),
            service_id: service.id,
            node: Arc::clone(node),
            tag,
        })
    }

    /// What others see of it.
    pub(crate) fn entry(&self, buffer: usize, history: usize) -> Entry {
        Entry {
            port: self.id,
            node: self.node.id,
            buffer,
            history,
        }
    }

    /// Joins the others, if there is room.
    pub(crate) fn register(&self, entry: Entry) -> bool {
        step("registers a port");
        with(|world| {
            world.files.changes += 1;
            let service = world.wires.services.get_mut(&self.service_id);
            service.is_some_and(|service| service.add(self.role, entry))
        })
    }

    /// Leaves the others.
    pub(crate) fn deregister(&self) {
        if !is_on() {
            return;
        }
        step("takes a port off its service");
        with(|world| {
            world.files.changes += 1;
            if let Some(service) = world.wires.services.get_mut(&self.service_id) {
                service.remove(self.role, self.id);
            }
        });
    }

    fn close(&self) {
        let names = &self.node.names;
        let is_sender = with(|world| {
            world.wires.segments.remove(&self.id) | world.wires.outlets.contains_key(&self.id)
        });
        if is_sender {
            connect::remove("removes a segment", names.data(self.id));
            let peers = with(|world| {
                let outlet = world.wires.outlets.get(&self.id);
                outlet.map_or(Vec::new(), |outlet| outlet.peers.keys().copied().collect())
            });
            for peer in peers {
                if let Some(connection) = with(|world| world.drop_peer(self.id, peer)) {
                    leave(connection, End::Sender);
                }
            }
            with(|world| world.wires.outlets.remove(&self.id));
        }
        let links = with(|world| {
            let inlet = world.wires.inlets.get(&self.id);
            inlet.map_or(Vec::new(), |inlet| inlet.links.keys().copied().collect())
        });
        for link in links {
            unlink(self.id, link);
        }
        with(|world| world.wires.inlets.remove(&self.id));
        if with(|world| world.wires.events.remove(&self.id)).is_some() {
            connect::remove("removes a socket", names.event(self.id));
            connect::remove(
                "removes the state of a listener",
                names.event_state(self.id),
            );
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        if is_on() {
            if matches!(self.role, Role::Client | Role::Server | Role::Notifier) {
                self.deregister();
            }
            self.close();
        }
        // the tag goes after it
        drop(self.service.take());
        if is_on() {
            connect::remove("removes the tag of a port", std::mem::take(&mut self.tag));
        }
    }
}

//! Cleaning up after dead nodes.

use std::path::Path;

use super::bag::{Role, Stage};
use super::connect::{self, detach};
use super::membership::remove_service;
use super::names::Names;
use super::node::{NodeCleanupFailure, NodeDetails, unwatch};
use super::queue::End;
use crate::world::{step, system_call, with};

const ROLES: [Role; 6] = [
    Role::Publisher,
    Role::Subscriber,
    Role::Client,
    Role::Server,
    Role::Listener,
    Role::Notifier,
];

/// One thread of a process cleans up at a time.
struct Section(u32);

impl Section {
    fn enter() -> Option<Section> {
        with(|world| {
            let process = world.process();
            let is_first = world.wires.cleaning.insert(process);
            is_first.then(|| Section(process))
        })
    }
}

impl Drop for Section {
    fn drop(&mut self) {
        if crate::world::is_on() {
            with(|world| world.wires.cleaning.remove(&self.0));
        }
    }
}

/// Removes what a dead node left; two at once are one and an error.
pub(crate) fn remove_stale_resources(
    node: u128,
    details: Option<&NodeDetails>,
) -> Result<(), NodeCleanupFailure> {
    step("cleans up after a node");
    let _section =
        Section::enter().ok_or(NodeCleanupFailure::AnotherInstanceIsCleaningUpTheNode)?;
    // without details iceoryx2 looks in its usual folder, where nothing is
    let details = details.ok_or(NodeCleanupFailure::ResourcesAlreadyCleanedUp)?;
    let names = Names::for_config(details.config());
    lock(&names, node)?;
    let cleaned = remove_all(&names, node);
    match cleaned {
        Ok(()) => unwatch(&names, node),
        Err(_) => with(|world| {
            if let Some(node) = world.wires.nodes.get_mut(&node) {
                node.cleaner = None;
            }
        }),
    }
    cleaned
}

/// Becomes the one who cleans up.
fn lock(names: &Names, node: u128) -> Result<(), NodeCleanupFailure> {
    system_call("locks a dead node").map_err(|_| NodeCleanupFailure::InternalError)?;
    let monitor = names.monitor(node);
    with(|world| {
        let is_there = |path: &Path| world.files.exists(path);
        let (context, lock, state) = (
            is_there(&monitor.context),
            is_there(&monitor.owner_lock),
            is_there(&monitor.state),
        );
        let process = world.process();
        let entry = world.wires.nodes.get_mut(&node);
        let Some(entry) = entry.filter(|_| context) else {
            return Err(NodeCleanupFailure::ResourcesAlreadyCleanedUp);
        };
        if !lock || !state || entry.lives || entry.cleaner.is_some() {
            return Err(NodeCleanupFailure::AnotherInstanceIsCleaningUpTheNode);
        }
        entry.cleaner = Some(process);
        Ok(())
    })
}

fn remove_all(names: &Names, node: u128) -> Result<(), NodeCleanupFailure> {
    let failed = |_| NodeCleanupFailure::InternalError;
    let folder = names.node(node);
    system_call("lists the services of a dead node").map_err(failed)?;
    let inside = with(|world| world.files.names(&folder));
    let tags = |suffix| {
        let tags = inside
            .iter()
            .filter_map(move |file| names.tagged(file, suffix));
        tags.map(str::to_owned).collect::<Vec<_>>()
    };
    for hash in tags(".service_tag") {
        remove_from_service(names, node, &hash);
    }
    system_call("lists the ports of a dead node").map_err(failed)?;
    let inside = with(|world| world.files.names(&folder));
    let tagged = inside
        .iter()
        .filter_map(|file| names.tagged(file, ".port_tag"));
    for port in tagged.filter_map(|tag| tag.parse().ok()) {
        remove_port(names, port);
    }
    connect::remove("removes the details of a dead node", names.details(node));
    connect::remove("removes the folder of a dead node", folder);
    Ok(())
}

fn remove_from_service(names: &Names, node: u128, hash: &str) {
    step("looks at a service of a dead node");
    let (settings, tag) = (names.service(hash), names.service_tag(node, hash));
    let service = with(|world| {
        let id = world.wires.settings.get(&settings).copied();
        id.filter(|_| world.files.exists(&settings))
    });
    if let Some(id) = service {
        let is_whole = with(|world| {
            let service = world.wires.services.get(&id);
            service.is_some_and(|service| service.stage == Stage::Whole)
                && world.files.exists(&names.dynamic(id))
        });
        if !is_whole || remove_node(names, node, id) {
            remove_service(names, id, hash);
        }
    }
    connect::remove("removes the tag of a service", tag);
}

/// Takes a node and its ports off a service; says whether it was the last node.
fn remove_node(names: &Names, node: u128, service: u128) -> bool {
    for role in ROLES {
        let ports = with(|world| {
            let service = world.wires.services.get(&service);
            let entries = service.map_or(&[][..], |service| service.entries(role));
            let of_node = entries.iter().filter(|entry| entry.node == node);
            of_node.map(|entry| entry.port).collect::<Vec<_>>()
        });
        for port in ports {
            match role {
                Role::Listener => {
                    connect::remove("removes the socket of a dead port", names.event(port));
                    connect::remove("removes the state of a dead port", names.event_state(port));
                }
                Role::Notifier => {}
                _ => remove_port(names, port),
            }
            connect::remove("removes the tag of a dead port", names.port_tag(node, port));
            step("takes a dead port off its service");
            with(|world| {
                if let Some(service) = world.wires.services.get_mut(&service) {
                    service.remove(role, port);
                }
            });
        }
    }
    step("takes a dead node off its service");
    with(|world| {
        let service = world.wires.services.get_mut(&service);
        service.is_some_and(|service| service.leave(node))
    })
}

/// Removes the connections and the segment of a port.
fn remove_port(names: &Names, port: u128) {
    step("lists connections");
    let files = with(|world| world.files.names(names.root()));
    for (sender, receiver) in files.iter().filter_map(|file| names.connected(file)) {
        if sender == port {
            detach(names.connection(sender, receiver), End::Sender);
        }
        if receiver == port {
            detach(names.connection(sender, receiver), End::Receiver);
        }
    }
    connect::remove("removes the segment of a dead port", names.data(port));
    with(|world| {
        world.wires.segments.remove(&port);
        world.wires.events.remove(&port);
    });
}

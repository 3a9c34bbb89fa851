//! Nodes: a process's membership in the transport of one daemon.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::Arc;

pub use ::iceoryx2::node::{NodeCleanupFailure, NodeCreationFailure, NodeListFailure};
use ::iceoryx2::prelude::{
    CallbackProgression, NodeName, ProcessId, ServiceName, SignalHandlingMode,
};

use super::cleanup;
use super::config::Config;
use super::connect;
use super::identifiers::UniqueNodeId;
use super::membership::make;
use super::names::Names;
use super::service::Service;
use super::service::builder::Builder;
use super::wires::NodeEntry;
use crate::iceoryx2::Types;
use crate::world::{World, is_on, step, system_call, with};

/// Bytes of the details of a node.
const DETAILS: u64 = 4096;
/// Mode of a monitor's file that is not finished.
const UNFINISHED: u32 = 0o200;

/// What a node says of itself.
#[derive(Debug, Clone)]
pub struct NodeDetails {
    name: NodeName,
    config: Config,
    process: ProcessId,
}

impl NodeDetails {
    /// Its name.
    pub fn name(&self) -> &NodeName {
        &self.name
    }

    /// Its settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Its process.
    pub fn process_id(&self) -> ProcessId {
        self.process
    }
}

/// A node, and those who have something of it.
#[derive(Debug)]
pub(crate) struct NodeHandle {
    pub(crate) id: u128,
    pub(crate) names: Names,
    details: NodeDetails,
}

/// A node.
#[derive(Debug)]
pub struct Node<S: Service> {
    handle: Arc<NodeHandle>,
    id: UniqueNodeId,
    service: Types<S>,
}

/// What can be seen of a node.
pub trait NodeView {
    /// Its number.
    fn id(&self) -> &UniqueNodeId;
    /// What it says of itself, if that can be read.
    fn details(&self) -> &Option<NodeDetails>;
}

/// A node whose process lives.
#[derive(Debug)]
pub struct AliveNodeView<S: Service> {
    id: UniqueNodeId,
    details: Option<NodeDetails>,
    service: Types<S>,
}

/// A node whose process is dead, with all that it left.
#[derive(Debug)]
pub struct DeadNodeView<S: Service>(AliveNodeView<S>);

/// A node that is listed.
#[derive(Debug)]
pub enum NodeState<S: Service> {
    /// Its process lives.
    Alive(AliveNodeView<S>),
    /// Its process is dead.
    Dead(DeadNodeView<S>),
    /// Its files cannot be read.
    Inaccessible(UniqueNodeId),
    /// Its files make no sense.
    Undefined(UniqueNodeId),
}

impl<S: Service> NodeView for AliveNodeView<S> {
    fn id(&self) -> &UniqueNodeId {
        &self.id
    }

    fn details(&self) -> &Option<NodeDetails> {
        &self.details
    }
}

impl<S: Service> NodeView for DeadNodeView<S> {
    fn id(&self) -> &UniqueNodeId {
        &self.0.id
    }

    fn details(&self) -> &Option<NodeDetails> {
        &self.0.details
    }
}

impl<S: Service> DeadNodeView<S> {
    /// Removes what it left.
    ///
    /// # Errors
    /// Another one is at it or was; no settings.
    pub fn try_remove_stale_resources(self) -> Result<(), NodeCleanupFailure> {
        cleanup::remove_stale_resources(self.0.id.0, self.0.details.as_ref())
    }
}

impl<S: Service> NodeState<S> {
    /// Its number.
    pub fn node_id(&self) -> &UniqueNodeId {
        match self {
            NodeState::Alive(node) => &node.id,
            NodeState::Dead(node) => &node.0.id,
            NodeState::Inaccessible(id) | NodeState::Undefined(id) => id,
        }
    }
}

impl<S: Service> Node<S> {
    /// Its number.
    pub fn id(&self) -> &UniqueNodeId {
        &self.id
    }

    /// Its name.
    pub fn name(&self) -> &NodeName {
        &self.handle.details.name
    }

    /// Its settings.
    pub fn config(&self) -> &Config {
        &self.handle.details.config
    }

    /// For services of a name.
    pub fn service_builder(&self, name: &ServiceName) -> Builder<S> {
        Builder::new(Arc::clone(&self.handle), *name)
    }

    /// All nodes of a daemon.
    ///
    /// # Errors
    /// Their folder cannot be read.
    pub fn list(
        config: &Config,
        mut callback: impl FnMut(NodeState<S>) -> CallbackProgression,
    ) -> Result<(), NodeListFailure> {
        let names = Names::for_config(config);
        system_call("lists the nodes").map_err(|_| NodeListFailure::InternalError)?;
        let files = with(|world| world.files.names(names.nodes()));
        for id in files.iter().filter_map(|file| names.monitored(file)) {
            let details = match system_call("reads the details of a node") {
                Ok(()) => with(|world| world.details(&names, id)),
                Err(_) => None,
            };
            let view = AliveNodeView {
                id: UniqueNodeId(id),
                details,
                service: PhantomData,
            };
            step("looks whether a node lives");
            let state = match with(|world| world.state(&names, id)) {
                State::Absent => continue,
                State::Alive => NodeState::Alive(view),
                State::Dead => NodeState::Dead(DeadNodeView(view)),
                State::Corrupted => NodeState::Undefined(view.id),
            };
            if callback(state) == CallbackProgression::Stop {
                break;
            }
        }
        Ok(())
    }
}

/// What the files of a monitor say.
enum State {
    Absent,
    Alive,
    Dead,
    Corrupted,
}

impl World {
    fn details(&self, names: &Names, node: u128) -> Option<NodeDetails> {
        let entry = self.wires.nodes.get(&node)?;
        let is_there = self.files.exists(&names.details(node));
        is_there.then(|| entry.details.clone())
    }

    fn state(&self, names: &Names, node: u128) -> State {
        let (monitor, process) = (names.monitor(node), self.process());
        let Some(entry) = self.wires.nodes.get(&node) else {
            return State::Absent;
        };
        // a process knows its own
        if entry.lives && entry.process == process {
            return State::Alive;
        }
        if entry.cleaner == Some(process) {
            return State::Dead;
        }
        if !entry.is_finished || !self.files.exists(&monitor.context) {
            return State::Absent;
        }
        let (lock, state) = (
            self.files.exists(&monitor.owner_lock),
            self.files.exists(&monitor.state),
        );
        match (lock, state) {
            (false, true) => State::Corrupted,
            (true, true) if entry.lives => State::Alive,
            _ => State::Dead,
        }
    }
}

/// Makes nodes.
#[derive(Debug, Default, Clone)]
pub struct NodeBuilder {
    name: Option<NodeName>,
    config: Config,
}

impl NodeBuilder {
    /// With the usual settings.
    pub fn new() -> NodeBuilder {
        NodeBuilder::default()
    }

    /// Names it.
    #[must_use]
    pub fn name(mut self, name: &NodeName) -> NodeBuilder {
        self.name = Some(name.clone());
        self
    }

    /// With these settings.
    #[must_use]
    pub fn config(mut self, config: &Config) -> NodeBuilder {
        self.config = config.clone();
        self
    }

    /// The machine has no signals.
    #[must_use]
    pub fn signal_handling_mode(self, _mode: SignalHandlingMode) -> NodeBuilder {
        self
    }

    /// Makes it.
    ///
    /// # Errors
    /// Those of the system.
    pub fn create<S: Service>(self) -> Result<Node<S>, NodeCreationFailure> {
        let failed = NodeCreationFailure::InternalError;
        let names = Names::for_config(&self.config);
        let name = match self.name {
            Some(name) => name,
            None => NodeName::new("").map_err(|_| failed)?,
        };
        step("counts nodes");
        let (id, process) = with(|world| (world.unique(), world.process()));
        let details = NodeDetails {
            name,
            config: self.config,
            process: ProcessId::new(process as i32),
        };
        system_call("makes the folder of a node").map_err(|_| failed)?;
        with(|world| world.files.put_folder(&names.node(id))).map_err(|_| failed)?;
        make("writes the details of a node", &names.details(id), DETAILS).map_err(|_| failed)?;
        watch(&names, id, &details, process).map_err(|()| {
            // as iceoryx2, it leaves the details behind
            with(|world| world.wires.nodes.remove(&id));
            failed
        })?;
        let handle = NodeHandle { id, names, details };
        Ok(Node {
            handle: Arc::new(handle),
            id: UniqueNodeId(id),
            service: PhantomData,
        })
    }
}

/// Makes the files of a monitor. That it is finished shows in the mode of the first one, which comes last.
fn watch(names: &Names, id: u128, details: &NodeDetails, process: u32) -> Result<(), ()> {
    let monitor = names.monitor(id);
    let files = [
        (&monitor.context, 0o400, "makes the context of a monitor"),
        (&monitor.state, 0o600, "makes the state of a monitor"),
        (&monitor.owner_lock, 0o600, "makes the lock of a monitor"),
    ];
    with(|world| {
        let entry = NodeEntry {
            details: details.clone(),
            process,
            lives: true,
            is_finished: false,
            cleaner: None,
            services: BTreeMap::new(),
        };
        world.wires.nodes.insert(id, entry);
    });
    for (made, (path, _, door)) in files.iter().enumerate() {
        let there = make(door, path, 16);
        if there.is_err() {
            files[..made].iter().for_each(|(path, ..)| {
                connect::remove("removes a file of a monitor", path.to_path_buf());
            });
            return Err(());
        }
        with(|world| world.files.set_mode(path, UNFINISHED)).map_err(drop)?;
    }
    for (path, mode, _) in files.iter().rev() {
        step("finishes a file of a monitor");
        with(|world| world.files.set_mode(path, *mode)).map_err(drop)?;
    }
    with(|world| {
        if let Some(node) = world.wires.nodes.get_mut(&id) {
            node.is_finished = true;
        }
    });
    Ok(())
}

/// Removes the files of a monitor, in the order in which a cleaner that dies meanwhile leaves enough for the next.
pub(crate) fn unwatch(names: &Names, id: u128) {
    let monitor = names.monitor(id);
    connect::remove("removes the state of a monitor", monitor.state);
    connect::remove("removes the lock of a monitor", monitor.owner_lock);
    connect::remove("removes the context of a monitor", monitor.context);
    with(|world| world.wires.nodes.remove(&id));
}

impl Drop for NodeHandle {
    fn drop(&mut self) {
        if !is_on() {
            return;
        }
        let names = &self.names;
        connect::remove("removes the details of a node", names.details(self.id));
        connect::remove("removes the folder of a node", names.node(self.id));
        unwatch(names, self.id);
    }
}

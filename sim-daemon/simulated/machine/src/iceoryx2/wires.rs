//! What is in the memory of the transport.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use super::bag::Service;
use super::degradation::Handler;
use super::node::NodeDetails;
use super::queue::{Connection, End, Inlet, Outlet};
use super::slot::Slot;
use crate::memory::mapping::Damages;
use crate::thread::ThreadId;
use crate::world::with;

/// All services of the machine.
#[derive(Debug, Default)]
pub(crate) struct Wires {
    /// Numbers given so far.
    pub(crate) last: u64,
    pub(crate) nodes: BTreeMap<u128, NodeEntry>,
    pub(crate) services: BTreeMap<u128, Service>,
    /// The service that a file has the settings of.
    pub(crate) settings: BTreeMap<PathBuf, u128>,
    pub(crate) connections: BTreeMap<u64, Connection>,
    /// The connection that a file holds.
    pub(crate) connected: BTreeMap<PathBuf, u64>,
    /// Ports whose segment somebody could open, if its file is there.
    pub(crate) segments: BTreeSet<u128>,
    /// Ports that send, and what their process knows of them.
    pub(crate) outlets: BTreeMap<u128, Outlet>,
    /// Ports that receive.
    pub(crate) inlets: BTreeMap<u128, Inlet>,
    pub(crate) events: BTreeMap<u128, Event>,
    /// Processes in which a thread cleans up.
    pub(crate) cleaning: BTreeSet<u32>,
    /// Slots that were written to while a process that lives read them.
    pub(crate) overwritten: u64,
    /// What ports that threads are about to make do where they cannot meet others.
    pub(crate) handlers: BTreeMap<(ThreadId, End), Handler>,
    /// Threads whose ports take their memory later.
    pub(crate) reserving: BTreeSet<ThreadId>,
    pub(crate) damages: Damages,
}

/// A node.
#[derive(Debug)]
pub(crate) struct NodeEntry {
    pub(crate) details: NodeDetails,
    pub(crate) process: u32,
    /// Its process lives, and holds its lock.
    pub(crate) lives: bool,
    /// Its monitor is complete.
    pub(crate) is_finished: bool,
    /// The process that cleans up after it.
    pub(crate) cleaner: Option<u32>,
    /// Services that it has open, and how often.
    pub(crate) services: BTreeMap<u128, usize>,
}

/// What a listener waits for.
#[derive(Debug, Default)]
pub(crate) struct Event {
    pub(crate) pending: u64,
    pub(crate) waiting: Vec<ThreadId>,
}

/// A sample on its way.
#[derive(Debug, Clone)]
pub(crate) struct Parcel {
    pub(crate) index: usize,
    pub(crate) slot: Arc<Slot>,
}

impl Wires {
    /// Lets go of what a dead process had open. What is in shared memory stays.
    pub(crate) fn release(&mut self, pid: u32) {
        let dead = |node: &NodeEntry| node.lives && node.process == pid;
        let nodes = self.nodes.iter_mut().filter(|(_, node)| dead(node));
        let dead: BTreeSet<u128> = nodes
            .map(|(id, node)| {
                node.lives = false;
                *id
            })
            .collect();
        for node in self.nodes.values_mut() {
            node.cleaner = node.cleaner.filter(|cleaner| *cleaner != pid);
        }
        self.cleaning.remove(&pid);
        self.outlets.retain(|_, port| !dead.contains(&port.node));
        self.inlets.retain(|_, port| !dead.contains(&port.node));
    }
}

/// How many samples were written over so far while somebody who lives read them: slots are only safe as long as the port that
/// received them is there.
pub fn overwritten() -> u64 {
    with(|world| world.wires.overwritten)
}

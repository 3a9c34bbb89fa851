//! Cleaning up after clients that were killed.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use super::orphans::{orphans, remove};
use super::worlds::S;
use crate::doors::exists;
use crate::doors::iceoryx2::config::Config;
use crate::doors::iceoryx2::node::NodeView;
use crate::doors::iceoryx2::prelude::{CallbackProgression, Node, NodeState};
use crate::doors::iceoryx2::service::Service;
use crate::memory::guard::guarded;

/// Every so many looks for dead clients, one for files without an owner.
const LOOKS: u32 = 5;

/// Finds dead clients and removes their ports, so that their slots and leases come back. May run on any thread.
#[derive(Debug, Clone)]
pub struct ClientCleanup {
    config: Config,
    /// Id of our own node.
    node: u128,
    /// Nodes that got details from us.
    completed: HashSet<u128>,
    /// Files that had no owner when they were last looked at.
    orphans: HashSet<PathBuf>,
    looks: u32,
}

impl ClientCleanup {
    pub(super) fn new(node: &Node<S>) -> ClientCleanup {
        ClientCleanup {
            config: node.config().clone(),
            node: node.id().value(),
            completed: HashSet::new(),
            orphans: HashSet::new(),
            looks: 0,
        }
    }

    /// Looks for dead clients and cleans up after them; returns how many. About 0.3 ms.
    pub fn clean(&mut self) -> usize {
        let mut cleaned = 0;
        let config = self.config.clone();
        // a list that fails is a list that changes: the next look will do
        let _ = Node::<S>::list(&config, |node| {
            if let NodeState::Dead(dead) = node {
                if dead.details().is_none() {
                    self.complete(dead.id().value());
                }
                // another thread may be at it already
                cleaned += usize::from(dead.try_remove_stale_resources().is_ok());
            }
            CallbackProgression::Continue
        });
        self.looks += 1;
        if self.looks.is_multiple_of(LOOKS) {
            self.remove_orphans();
        }
        cleaned
    }

    /// Gives a dead node the details that it had not written yet, or had removed already, when its process was killed:
    /// iceoryx2 finds the settings in them, and cleans up after no node without. The next look does.
    ///
    /// A process that is closing its node at this moment leaves the same picture. Then the details stay behind, and
    /// [`Self::remove_orphans`] removes them although the process lives.
    fn complete(&mut self, dead: u128) {
        self.completed.insert(dead);
        let file = format!("{}node.details", self.config.global.prefix);
        let nodes = self.folder().join("nodes");
        let dead_node = nodes.join(dead.to_string());
        // what fails here is tried again
        let _ = crate::doors::fs::create_dir_all(&dead_node);
        let _ = crate::doors::fs::copy(
            nodes.join(self.node.to_string()).join(&file),
            dead_node.join(&file),
        );
    }

    fn folder(&self) -> PathBuf {
        PathBuf::from(self.config.global.root_path().to_string())
    }

    /// Removes files that no node has any more, at the second look.
    ///
    /// iceoryx2 leaves a connection that its owner had made and not yet marked as its own when it was killed, a service whose
    /// last node was killed while it removed it, and a node that was killed while it made or removed the files of its monitor.
    /// A port and a service have a tag in a node's folder before they have files, and removing a file changes
    /// nothing for those who map it.
    fn remove_orphans(&mut self) {
        let services = || self.services();
        // a folder that cannot be read tells nothing of its files
        let orphans = orphans(&self.folder(), &self.completed, services).unwrap_or_default();
        let mut again: Vec<_> = orphans.intersection(&self.orphans).collect();
        remove(&mut again);
        let nodes = self.folder().join("nodes");
        self.completed
            .retain(|node| exists(&nodes.join(node.to_string())));
        self.orphans = orphans;
    }

    /// Hashes and ids of all services.
    fn services(&self) -> HashMap<String, u128> {
        let mut services = HashMap::new();
        // what is not listed is kept until the next look
        let list = || {
            S::list(&self.config, |service| {
                let (hash, id) = (
                    service.static_details.service_hash(),
                    service.static_details.unique_service_id(),
                );
                services.insert(hash.to_string(), id.value());
                CallbackProgression::Continue
            })
        };
        let _ = guarded(list);
        services
    }
}

#[cfg(all(test, unix, not(simulated)))]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::doors::iceoryx2::prelude::{NodeBuilder, PortFactory, SignalHandlingMode};
    use crate::presence::paths::DaemonPaths;

    fn files(folder: &Path, kind: &str) -> usize {
        let files = std::fs::read_dir(folder).unwrap();
        let kinds = files.map(|file| file.unwrap().path().extension().map(ToOwned::to_owned));
        kinds.flatten().filter(|other| other == kind).count()
    }

    #[test]
    fn a_service_whose_last_node_was_killed_while_it_left_is_removed_and_others_stay() {
        let locks = std::env::temp_dir().join(format!("tightloop-left-{}", std::process::id()));
        let paths = DaemonPaths::new(Some(&locks), "left").unwrap();
        let (root, config) = (paths.shared_folder(), paths.transport_config(1));
        std::fs::create_dir_all(&root).unwrap();
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<S>()
            .unwrap();
        let service = |name: &str| {
            node.service_builder(&name.try_into().unwrap())
                .event()
                .create()
                .unwrap()
        };
        let (kept, left) = (service("kept"), service("left"));
        // a node that is the last removes its tag first
        let tag = format!(
            "{}{}.service_tag",
            config.global.prefix,
            left.service_hash()
        );
        let nodes = config.global.node_dir().to_string();
        std::fs::remove_file(
            Path::new(&nodes)
                .join(node.id().value().to_string())
                .join(tag),
        )
        .unwrap();
        std::mem::forget(left);
        let mut cleanup = ClientCleanup::new(&node);
        let seen = || {
            (
                files(&root, "dynamic"),
                files(&root.join("services"), "service"),
            )
        };
        for look in 1..=2 * LOOKS {
            assert_eq!(seen(), (2, 2), "before look {look}");
            cleanup.clean();
        }
        assert_eq!(seen(), (1, 1));
        drop((kept, node));
        std::fs::remove_dir_all(&root).unwrap();
        std::fs::remove_dir_all(&locks).unwrap();
    }
}

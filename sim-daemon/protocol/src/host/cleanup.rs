//! Cleaning up after clients that were killed.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, Node, NodeState};

use super::worlds::S;

/// Every so many looks for dead clients, one for files without an owner.
const LOOKS: u32 = 5;
/// Kinds of files that belong to ports.
const OF_PORTS: [&str; 4] = ["connection", "data", "event", "event_mgmt"];

/// Finds dead clients and removes their ports, so that their slots and leases come back. May run on any thread.
#[derive(Debug, Clone)]
pub struct ClientCleanup {
    config: Config,
    /// Id of our own node.
    node: u128,
    /// Files that had no owner when they were last looked at.
    orphans: HashSet<PathBuf>,
    looks: u32,
}

impl ClientCleanup {
    pub(super) fn new(node: &Node<S>) -> ClientCleanup {
        ClientCleanup {
            config: node.config().clone(),
            node: node.id().value(),
            orphans: HashSet::new(),
            looks: 0,
        }
    }

    /// Looks for dead clients and cleans up after them; returns how many. About 0.3 ms.
    pub fn clean(&mut self) -> usize {
        let mut cleaned = 0;
        // a list that fails is a list that changes: the next look will do
        let _ = Node::<S>::list(&self.config, |node| {
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
    fn complete(&self, dead: u128) {
        let file = format!("{}node.details", self.config.global.prefix);
        let nodes = self.folder().join("nodes");
        let theirs = nodes.join(dead.to_string());
        // what fails here is tried again
        let _ = std::fs::create_dir_all(&theirs);
        let _ = std::fs::copy(
            nodes.join(self.node.to_string()).join(&file),
            theirs.join(&file),
        );
    }

    fn folder(&self) -> PathBuf {
        PathBuf::from(self.config.global.root_path().to_string())
    }

    /// Removes files of ports that no node has any more, and of nodes that died before they had a monitor, at the second
    /// look.
    ///
    /// iceoryx2 leaves a connection that its owner had made and not yet marked as its own when it was killed. A port has
    /// its tag in a node's folder before it has files, and removing a file that somebody still maps changes nothing.
    fn remove_orphans(&mut self) {
        let found = orphans(&self.folder()).unwrap_or_default();
        for file in found.intersection(&self.orphans) {
            let _ = std::fs::remove_file(file).or_else(|_| std::fs::remove_dir(file));
        }
        self.orphans = found;
    }
}

/// Files of ports without a tag, and of dead nodes without a monitor with their folders.
fn orphans(folder: &Path) -> std::io::Result<HashSet<PathBuf>> {
    let files: Vec<PathBuf> = paths(folder)?;
    let (mut tagged, mut found) = (HashSet::new(), HashSet::new());
    // nodes are listed after the files, so that the port of a file that is seen has its tag
    let nodes = paths(&folder.join("nodes"))?;
    let monitors = nodes.iter().filter(|file| file.extension().is_some());
    let monitored: HashSet<u128> = monitors.flat_map(|file| ports(file)).collect();
    for node in &nodes {
        // a node may end meanwhile, and not all are folders
        let tags = paths(node).unwrap_or_default();
        tagged.extend(tags.iter().flat_map(|tag| ports(tag)));
        let id = node.file_name().and_then(|id| id.to_str()?.parse().ok());
        if id.is_some_and(|id| !monitored.contains(&id) && !has_process(id)) {
            found.extend(tags);
            found.insert(node.clone());
        }
    }
    let is_orphan = |file: &PathBuf| {
        let kind = file.extension().and_then(|kind| kind.to_str());
        kind.is_some_and(|kind| OF_PORTS.contains(&kind))
            && ports(file).iter().any(|port| !tagged.contains(port))
    };
    found.extend(files.into_iter().filter(is_orphan));
    Ok(found)
}

/// Whether the process of a node lives; its number is in bits 64 to 95 of the id.
fn has_process(node: u128) -> bool {
    let pid = (node >> 64) as u32;
    Path::new(&format!("/proc/{pid}")).exists()
}

fn paths(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    std::fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect()
}

/// Ports in the name of a file. Their ids are longer than 64 bits, which nothing else in a name is in decimal digits.
fn ports(file: &Path) -> Vec<u128> {
    let stem = file.file_stem().and_then(|stem| stem.to_str());
    let parts = stem.unwrap_or_default().split('_');
    parts
        .filter_map(|part| part.parse().ok())
        .filter(|port| *port > u128::from(u64::MAX))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIVING: &str = "158456556240748546097084906779";
    const DEAD: &str = "237684718755018774577577737499";

    #[test]
    fn files_of_ports_without_a_tag_are_orphans() {
        let folder = std::env::temp_dir().join(format!("tightloop-orphans-{}", std::process::id()));
        let node = folder.join("nodes/79228393726480883941155814683");
        std::fs::create_dir_all(&node).unwrap();
        let touch = |path: PathBuf| std::fs::write(path, "").unwrap();
        touch(node.join(format!("32bae2b4_{LIVING}.port_tag")));
        touch(folder.join("nodes/32bae2b4_79228393726480883941155814683.node_monitor"));
        let hash = "0354a209029e7d094a819e2d4030ea331e6caaf0";
        touch(folder.join(format!("12345678_{hash}_{LIVING}.data")));
        touch(folder.join(format!("12345678_{hash}_{LIVING}_{LIVING}.connection")));
        touch(folder.join(format!("12345678_{hash}_{DEAD}.dynamic")));
        let stray = folder.join(format!("12345678_{hash}_{DEAD}_{LIVING}.connection"));
        touch(stray.clone());
        // made before its monitor, by a process that cannot be
        let unborn = folder.join(format!("nodes/{}", (u128::from(u32::MAX) << 64) + 7));
        std::fs::create_dir(&unborn).unwrap();
        let details = unborn.join("32bae2b4_node.details");
        touch(details.clone());
        let found = orphans(&folder).unwrap();
        assert_eq!(found, HashSet::from([stray, unborn, details]));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

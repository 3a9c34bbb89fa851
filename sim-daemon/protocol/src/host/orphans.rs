//! Files in a daemon's folder that no node owns any more.

use std::collections::HashSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::doors::fs::{metadata, read_dir};
use crate::doors::system::files::is_write_only;
use crate::doors::system::process;

/// Kinds of files that belong to ports.
const OF_PORTS: [&str; 5] = ["connection", "data", "event", "event_mgmt", "unreached"];
/// A monitor has this file, one that ends in `_owner_lock` and one that ends in `_context`.
const MONITOR: &str = "node_monitor";
const CONTEXT: &str = "node_monitor_context";

/// Files of ports without a tag, and all files of nodes that are no nodes to iceoryx2 any more: their monitor is not
/// complete, and their process is gone or they are among those `given` details.
///
/// # Errors
/// A folder could not be read, so that the owners of some files are unknown.
pub(super) fn orphans(folder: &Path, given: &HashSet<u128>) -> std::io::Result<HashSet<PathBuf>> {
    let files = paths(folder)?;
    let (mut tagged, mut orphans) = (HashSet::new(), HashSet::new());
    // nodes are listed after the files, so that the port of a file that is seen has its tag
    let nodes = paths(&folder.join("nodes"))?;
    let watched = watched(&nodes);
    for path in nodes {
        let inside = match paths(&path) {
            // a node may end meanwhile, and a monitor is no folder
            Err(error) if is_no_folder(error.kind()) => Vec::new(),
            inside => inside?,
        };
        tagged.extend(inside.iter().flat_map(|tag| ids(tag)));
        let gone = |id| !watched.contains(&id) && (given.contains(&id) || !has_process(id));
        if ids(&path).into_iter().any(gone) {
            orphans.extend(inside);
            orphans.insert(path);
        }
    }
    let is_orphan = |file: &PathBuf| {
        extension(file).is_some_and(|kind| OF_PORTS.contains(&kind))
            && ids(file).iter().any(|port| !tagged.contains(port))
    };
    orphans.extend(files.into_iter().filter(is_orphan));
    Ok(orphans)
}

/// Nodes whose monitor is complete: iceoryx2 tells whether they live, and cleans up after them.
fn watched(nodes: &[PathBuf]) -> HashSet<u128> {
    let with = |kind| move |file: &&PathBuf| extension(file) == Some(kind);
    // so iceoryx2 marks a context while its process still makes the monitor
    let is_finished = |file: &&PathBuf| metadata(file).is_ok_and(|is| !is_write_only(&is));
    let contexts = nodes.iter().filter(with(CONTEXT)).filter(is_finished);
    let finished: HashSet<u128> = contexts.flat_map(|file| ids(file)).collect();
    let monitors = nodes
        .iter()
        .filter(with(MONITOR))
        .flat_map(|file| ids(file));
    monitors.filter(|id| finished.contains(id)).collect()
}

fn is_no_folder(error: ErrorKind) -> bool {
    matches!(error, ErrorKind::NotFound | ErrorKind::NotADirectory)
}

/// Whether the process of a node lives; its number is in bits 64 to 95 of the id.
fn has_process(node: u128) -> bool {
    process::exists((node >> 64) as u32)
}

fn extension(file: &Path) -> Option<&str> {
    file.extension()?.to_str()
}

fn paths(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
}

/// Nodes and ports in the name of a file. Their ids are longer than 64 bits, which nothing else in a name is in decimal
/// digits.
fn ids(file: &Path) -> Vec<u128> {
    let stem = file.file_stem().and_then(|stem| stem.to_str());
    let parts = stem.unwrap_or_default().split('_');
    parts
        .filter_map(|part| part.parse().ok())
        .filter(|id| *id > u128::from(u64::MAX))
        .collect()
}

#[cfg(all(test, unix, not(simulated)))]
mod tests {
    use super::*;
    use std::fs::{
        Permissions, create_dir, create_dir_all, remove_dir_all, set_permissions, write,
    };
    use std::os::unix::fs::PermissionsExt;

    const LIVING: &str = "158456556240748546097084906779";
    const DEAD: &str = "237684718755018774577577737499";
    const HASH: &str = "0354a209029e7d094a819e2d4030ea331e6caaf0";
    /// No process has this number.
    const NOBODY: u128 = (u32::MAX as u128) << 64;

    /// A daemon's folder of a test, removed at its end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(test: &str) -> Folder {
            let path =
                std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
            create_dir_all(path.join("nodes")).unwrap();
            Folder(path)
        }

        fn touch(&self, name: &str) -> PathBuf {
            let path = self.0.join(name);
            write(&path, "").unwrap();
            path
        }

        /// A file of a monitor, with its mode.
        fn monitor(&self, node: u128, suffix: &str, mode: u32) -> PathBuf {
            let path = self.touch(&format!("nodes/32bae2b4_{node}.{MONITOR}{suffix}"));
            set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            path
        }

        /// The folder of a node with its details.
        fn details(&self, node: u128) -> [PathBuf; 2] {
            let folder = self.0.join(format!("nodes/{node}"));
            create_dir(&folder).unwrap();
            [
                self.touch(&format!("nodes/{node}/32bae2b4_node.details")),
                folder,
            ]
        }

        fn orphans(&self, given: &[u128]) -> HashSet<PathBuf> {
            orphans(&self.0, &given.iter().copied().collect()).unwrap()
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            remove_dir_all(&self.0).unwrap();
        }
    }

    #[test]
    fn files_of_ports_without_a_tag_are_orphans() {
        let folder = Folder::new("orphans");
        let node = NOBODY + 3;
        folder.details(node);
        folder.touch(&format!("nodes/{node}/32bae2b4_{LIVING}.port_tag"));
        folder.monitor(node, "", 0o600);
        folder.monitor(node, "_context", 0o600);
        folder.touch(&format!("12345678_{HASH}_{LIVING}.data"));
        folder.touch(&format!("12345678_{HASH}_{LIVING}_{LIVING}.connection"));
        folder.touch(&format!("12345678_{HASH}_{DEAD}.dynamic"));
        folder.touch(&format!("0123456789abcdef_{LIVING}.unreached"));
        let strays = [
            folder.touch(&format!("12345678_{HASH}_{DEAD}_{LIVING}.connection")),
            folder.touch(&format!("0123456789abcdef_{DEAD}.unreached")),
        ];
        assert_eq!(folder.orphans(&[]), HashSet::from(strays));
    }

    #[test]
    fn nodes_that_died_while_they_made_or_removed_their_monitor_are_orphans() {
        let folder = Folder::new("monitors");
        let mut expected = HashSet::from(folder.details(NOBODY + 1));
        // before the last of the three files was finished
        expected.extend(folder.details(NOBODY + 2));
        expected.insert(folder.monitor(NOBODY + 2, "_context", 0o200));
        expected.insert(folder.monitor(NOBODY + 2, "", 0o600));
        expected.insert(folder.monitor(NOBODY + 2, "_owner_lock", 0o600));
        // after the first of the three files was removed
        expected.insert(folder.monitor(NOBODY + 3, "_context", 0o600));
        expected.insert(folder.monitor(NOBODY + 3, "_owner_lock", 0o600));
        assert_eq!(folder.orphans(&[]), expected);
    }

    #[test]
    fn a_node_whose_process_lives_is_an_orphan_only_if_it_was_given_details() {
        let folder = Folder::new("given");
        let living = u128::from(std::process::id()) << 64;
        folder.details(living + 1);
        folder.monitor(living + 1, "_context", 0o200);
        let expected = HashSet::from(folder.details(living + 2));
        assert_eq!(folder.orphans(&[living + 2]), expected);
    }

    #[test]
    fn a_folder_that_cannot_be_read_makes_no_orphans() {
        let folder = Folder::new("unreadable");
        let name = "x".repeat(300);
        let error = paths(&folder.0.join(name)).unwrap_err();
        assert!(!is_no_folder(error.kind()), "{error}");
        // a link to itself cannot be followed, by root neither
        let node = folder.0.join(format!("nodes/{LIVING}"));
        std::os::unix::fs::symlink(&node, &node).unwrap();
        folder.touch(&format!("12345678_{HASH}_{DEAD}.data"));
        assert!(orphans(&folder.0, &HashSet::new()).is_err());
    }
}

//! Files in a daemon's folder that no node owns any more.

use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::doors::exists;
use crate::doors::fs::{metadata, read_dir, remove_dir, remove_file};
use crate::doors::system::files::is_write_only;
use crate::doors::system::process;

/// Kinds of files that belong to ports.
const OF_PORTS: [&str; 5] = ["connection", "data", "event", "event_mgmt", "unreached"];
/// Folder of the files with the settings of services.
const SERVICES: &str = "services";
/// Kind of these files.
const SETTINGS: &str = "service";
/// Kind of the files with the nodes of a service.
const DYNAMIC: &str = "dynamic";
/// Kind of the files in a node's folder that name its services.
const SERVICE_TAG: &str = "service_tag";
/// A monitor has this file, one that ends in `_owner_lock` and one that ends in `_context`.
const MONITOR: &str = "node_monitor";
const CONTEXT: &str = "node_monitor_context";

/// Files of ports and services without a tag, and all files of nodes that are no nodes to iceoryx2 any more: their monitor is
/// not complete, and their process is gone or they are among those `given` details.
///
/// `services` lists the hashes and ids of all services; it is called if one has no tag.
///
/// # Errors
/// A folder could not be read, so that the owners of some files are unknown.
pub(super) fn orphans(
    folder: &Path,
    given: &HashSet<u128>,
    services: impl FnOnce() -> HashMap<String, u128>,
) -> std::io::Result<HashSet<PathBuf>> {
    let (files, settings) = (paths(folder)?, paths(&folder.join(SERVICES))?);
    let (mut tagged, mut orphans) = (HashSet::new(), HashSet::new());
    let mut tagged_services = HashSet::new();
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
        let tags = inside.iter().filter(|tag| has_kind(tag, SERVICE_TAG));
        tagged_services.extend(tags.filter_map(|tag| hash(tag)).map(str::to_owned));
        let gone = |id| !watched.contains(&id) && (given.contains(&id) || !has_process(id));
        if ids(&path).into_iter().any(gone) {
            orphans.extend(inside);
            orphans.insert(path);
        }
    }
    // a node makes its tag before a service, and removes it before the files of one that it is the last to leave
    let is_left = |file: &PathBuf| hash(file).is_some_and(|hash| !tagged_services.contains(hash));
    let settings = settings.into_iter().filter(|file| has_kind(file, SETTINGS));
    let mut left = settings.filter(is_left).peekable();
    let services = left.peek().map(|_| services()).unwrap_or_default();
    let mut ids_left = HashSet::new();
    for file in left {
        // what cannot be read at this look can at another
        if let Some(id) = hash(&file).and_then(|hash| services.get(hash)) {
            ids_left.insert(*id);
            orphans.insert(file);
        }
    }
    let is_orphan = |file: &PathBuf| {
        let is_untagged = || ids(file).iter().any(|port| !tagged.contains(port));
        let is_left = || ids(file).iter().any(|id| ids_left.contains(id));
        match extension(file) {
            Some(DYNAMIC) => is_left(),
            kind => kind.is_some_and(|kind| OF_PORTS.contains(&kind)) && is_untagged(),
        }
    };
    orphans.extend(files.into_iter().filter(is_orphan));
    Ok(orphans)
}

/// Removes them: what a folder holds before it, and settings of a service last, since nothing else names the service's other
/// file. As long as one of these stays, settings do.
pub(super) fn remove(orphans: &mut [&PathBuf]) {
    orphans.sort_unstable_by_key(|path| (has_kind(path, SETTINGS), Reverse(*path)));
    let mut stays = false;
    for &mut path in orphans {
        if stays && has_kind(path, SETTINGS) {
            return;
        }
        let removed = remove_file(path).or_else(|_| remove_dir(path));
        stays |= has_kind(path, DYNAMIC) && removed.is_err() && exists(path);
    }
}

/// Nodes whose monitor is complete: iceoryx2 tells whether they live, and cleans up after them.
fn watched(nodes: &[PathBuf]) -> HashSet<u128> {
    let with = |kind| move |file: &&PathBuf| has_kind(file, kind);
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

fn has_kind(file: &Path, kind: &str) -> bool {
    extension(file) == Some(kind)
}

/// The hash of a service in the name of a file, after the prefix.
fn hash(file: &Path) -> Option<&str> {
    Some(file.file_stem()?.to_str()?.split_once('_')?.1)
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
            create_dir(path.join(SERVICES)).unwrap();
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
            self.orphans_with(given, &[])
        }

        fn orphans_with(&self, given: &[u128], services: &[(&str, u128)]) -> HashSet<PathBuf> {
            let services = services.iter().map(|(hash, id)| ((*hash).to_owned(), *id));
            let given = given.iter().copied().collect();
            orphans(&self.0, &given, || services.collect()).unwrap()
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
    fn services_without_a_tag_are_orphans_and_their_settings_go_last() {
        let folder = Folder::new("services");
        let node = u128::from(std::process::id()) << 64;
        folder.details(node);
        // a hash is base64 for names of files
        let (used, left) = ("kept_-hash", "left_-hash");
        folder.touch(&format!("nodes/{node}/12345678_{used}.service_tag"));
        folder.touch(&format!("services/12345678_{used}.service"));
        folder.touch(&format!("12345678_{HASH}_{LIVING}.dynamic"));
        let settings = folder.touch(&format!("services/12345678_{left}.service"));
        let dynamic = folder.touch(&format!("12345678_{HASH}_{DEAD}.dynamic"));
        let ids = [LIVING, DEAD].map(|id| id.parse().unwrap());
        let orphans = folder.orphans_with(&[], &[(used, ids[0]), (left, ids[1])]);
        assert_eq!(
            orphans,
            HashSet::from([dynamic.clone(), settings.clone()]),
            "all that is left"
        );
        // without its id the other file of a service is not known
        assert_eq!(folder.orphans(&[]), HashSet::new());
        // what cannot be removed, as an open file on Windows
        std::fs::remove_file(&dynamic).unwrap();
        std::fs::create_dir_all(dynamic.join("inside")).unwrap();
        remove(&mut orphans.iter().collect::<Vec<_>>());
        assert!(settings.exists() && dynamic.exists());
        std::fs::remove_dir(dynamic.join("inside")).unwrap();
        remove(&mut orphans.iter().collect::<Vec<_>>());
        assert!(!settings.exists() && !dynamic.exists());
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
        assert!(orphans(&folder.0, &HashSet::new(), HashMap::new).is_err());
    }
}

//! Locks of daemons that run, end, are killed, and lose their folders.

use super::*;
use std::path::PathBuf;

use crate::presence::paths::{Beacon, running};

fn root(test: &str) -> PathBuf {
    std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()))
}

#[test]
fn a_name_is_taken_once_and_leaves_nothing() {
    let root = root("place");
    let paths = DaemonPaths::new(Some(&root), "one").unwrap();
    let mut first = DaemonLock::take(&paths).unwrap();
    assert_eq!(paths.presence().unwrap(), Presence::Starting);
    first.announce(7, 1).unwrap();
    let beacon = Beacon {
        protocol: PROTOCOL_VERSION,
        pid: std::process::id(),
        session: 7,
        groups: 1,
    };
    assert_eq!(paths.presence().unwrap(), Presence::Running(beacon));
    assert_eq!(running(Some(&root)).unwrap(), ["one"]);
    let error = DaemonLock::take(&paths).unwrap_err().to_string();
    assert!(error.contains(&std::process::id().to_string()), "{error}");
    let start = Instant::now();
    assert!(!cleanup_after_death(Some(&root), "one").unwrap());
    assert!(start.elapsed() < LOOK_MAX, "it runs, and is waited for");
    drop(first);
    assert_eq!(paths.presence().unwrap(), Presence::Absent);
    assert!(!Path::new(shared_memory()).join(paths.stem()).exists());
    assert_eq!(fs::read_dir(&root).unwrap().count(), 0);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_lock_file_that_cannot_be_read_is_an_error_and_no_other_daemon() {
    let root = root("unread");
    let paths = DaemonPaths::new(Some(&root), "unread").unwrap();
    let mut held = DaemonLock::take(&paths).unwrap();
    held.announce(7, 1).unwrap();
    // the system reads nothing from what is open for writing alone
    let unread = File::options().append(true).open(paths.lock_path());
    let error = paths.presence_in(&unread.unwrap()).unwrap_err().to_string();
    let path = format!("{:?}", paths.lock_path());
    assert!(error.contains(&path), "{error}");
    drop(held);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_mark_that_cannot_be_opened_may_be_that_of_a_daemon_that_lives() {
    let root = root("unopened");
    let paths = DaemonPaths::new(Some(&root), "unopened").unwrap();
    private_folder(paths.root()).unwrap();
    // no system opens a folder to write into it
    let mark = paths.shared_folder().join(PLACE);
    fs::create_dir_all(&mark).unwrap();
    let error = cleanup_after_death(Some(&root), "unopened").unwrap_err();
    assert!(matches!(&error, ProtocolError::Root { path, .. } if *path == mark));
    assert!(mark.exists());
    assert_eq!(fs::read_dir(&root).unwrap().count(), 0);
    fs::remove_dir_all(paths.shared_folder()).unwrap();
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_daemon_that_is_ended_at_once_takes_its_files_and_the_request_with_it() {
    let root = root("at-once");
    let paths = DaemonPaths::new(Some(&root), "busy").unwrap();
    paths.ask_to_stop().unwrap();
    let held = DaemonLock::take(&paths).unwrap();
    assert!(
        !paths.is_asked_to_stop(),
        "the request was one of an earlier run"
    );
    paths.ask_to_stop().unwrap();
    assert!(paths.is_asked_to_stop());
    held.remains().remove();
    assert!(!paths.shared_folder().exists());
    assert_eq!(fs::read_dir(&root).unwrap().count(), 0);
    drop(held);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_daemon_that_has_ended_removes_no_files_of_the_next_one() {
    let root = root("next");
    let paths = DaemonPaths::new(Some(&root), "next").unwrap();
    let first = DaemonLock::take(&paths).unwrap();
    let remains = first.remains();
    drop(first);
    let second = DaemonLock::take(&paths).unwrap();
    remains.remove();
    assert!(paths.lock_path().exists() && paths.shared_folder().exists());
    drop(second);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_daemon_with_groups_is_one_name_and_what_its_groups_left_goes_with_it() {
    let root = root("grouped");
    let paths = DaemonPaths::new(Some(&root), "many").unwrap();
    let groups = [0, 1].map(|group| paths.group(group).unwrap());
    assert_eq!((groups[1].name(), groups[1].is_group()), ("many.1", true));
    assert_eq!(groups[1].daemon().unwrap(), paths);
    let mut daemon = DaemonLock::take(&paths).unwrap();
    let held = groups.each_ref().map(|group| {
        let mut daemon_lock = DaemonLock::take(group).unwrap();
        daemon_lock.announce(7, 1).unwrap();
        daemon_lock
    });
    assert!(running(Some(&root)).unwrap().is_empty());
    daemon.announce(7, 2).unwrap();
    assert_eq!(running(Some(&root)).unwrap(), ["many"]);
    assert!(
        matches!(paths.presence().unwrap(), Presence::Running(beacon) if beacon.groups == 2),
        "{:?}",
        paths.presence().unwrap()
    );
    drop((daemon, held));
    for group in &groups {
        fs::write(group.lock_path(), "tightloop 1 1 0000000000000001\n").unwrap();
    }
    assert!(cleanup_after_death(Some(&root), "many").unwrap());
    assert_eq!(fs::read_dir(&root).unwrap().count(), 0);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn what_a_killed_daemon_left_is_swept() {
    let root = root("sweep");
    let paths = DaemonPaths::new(Some(&root), "dead").unwrap();
    fs::write(paths.lock_path(), "tightloop 1 1 0000000000000001\n").unwrap();
    let shared = paths.shared_folder().join("00000001_5.data");
    private_folder(&paths.shared_folder()).unwrap();
    fs::write(&shared, "x").unwrap();
    sweep(Some(&root)).unwrap();
    assert!(!shared.exists() && !paths.lock_path().exists());
    fs::remove_dir(&root).unwrap();
}

#[test]
fn the_next_daemon_of_a_name_keeps_nothing_of_one_that_was_killed() {
    let root = root("successor");
    let paths = DaemonPaths::new(Some(&root), "next").unwrap();
    fs::write(paths.lock_path(), "tightloop 1 1 0000000000000001\n").unwrap();
    let shared = paths.shared_folder().join("00000001_5.data");
    private_folder(&paths.shared_folder()).unwrap();
    fs::write(&shared, "x").unwrap();
    let held = DaemonLock::take(&paths).unwrap();
    assert_eq!(paths.presence().unwrap(), Presence::Starting);
    assert!(!shared.exists());
    drop(held);
    fs::remove_dir(&root).unwrap();
}

#[test]
fn files_that_a_daemon_has_removed_are_not_removed_again() {
    let root = root("again");
    let paths = DaemonPaths::new(Some(&root), "again").unwrap();
    let first = DaemonLock::take(&paths).unwrap();
    let remains = first.remains();
    remains.remove();
    // while the process of the first one ends
    let second = DaemonLock::take(&paths).unwrap();
    remains.remove();
    assert!(paths.shared_folder().join(PLACE).exists());
    drop(first);
    assert!(paths.lock_path().exists() && paths.shared_folder().join(PLACE).exists());
    drop(second);
    fs::remove_dir(&root).unwrap();
}

#[cfg(unix)] // Windows keeps a folder with open files, and opens none as a file
#[test]
fn a_daemon_without_its_root_folder_keeps_its_name() {
    let root = root("logout");
    let paths = DaemonPaths::new(Some(&root), "kept").unwrap();
    let daemon_lock = DaemonLock::take(&paths).unwrap();
    fs::remove_dir_all(&root).unwrap();
    let paths = DaemonPaths::new(Some(&root), "kept").unwrap();
    let second = DaemonLock::take(&paths).map(|_| ());
    assert!(
        matches!(second, Err(ProtocolError::NameTaken { .. })),
        "{second:?}"
    );
    assert!(paths.shared_folder().join(PLACE).exists());
    drop(daemon_lock);
    assert!(!paths.shared_folder().exists());
    drop(DaemonLock::take(&paths).unwrap());
    fs::remove_dir_all(&root).unwrap();
}

#[cfg(unix)] // Windows keeps a folder with open files, and opens none as a file
#[test]
fn an_old_folder_without_a_mark_is_swept_and_a_new_one_is_spared() {
    let root = root("remains");
    let folders = ["old", "new"].map(|name| {
        let folder = DaemonPaths::new(Some(&root), name).unwrap().shared_folder();
        private_folder(&folder.join("nodes")).unwrap();
        folder
    });
    let hour = Duration::from_secs(3600);
    File::open(&folders[0])
        .and_then(|folder| folder.set_modified(std::time::SystemTime::now() - hour))
        .unwrap();
    sweep(Some(&root)).unwrap();
    assert_eq!(
        folders.each_ref().map(|folder| folder.exists()),
        [false, true]
    );
    fs::remove_dir_all(&folders[1]).unwrap();
    fs::remove_dir(&root).unwrap();
}

#[cfg(unix)] // Windows keeps a folder with open files, and opens none as a file
#[test]
fn what_is_left_of_a_root_folder_that_is_gone_is_swept_and_the_living_are_spared() {
    let (gone, living) = (root("gone"), root("living"));
    let dead = DaemonPaths::new(Some(&gone), "dead").unwrap();
    private_folder(&dead.shared_folder()).unwrap();
    let shared = dead.shared_folder().join("00000001_5.data");
    fs::write(&shared, "x").unwrap();
    fs::remove_dir(&gone).unwrap();
    // last: from here on the sweep of another test may take it, too
    fs::write(
        dead.shared_folder().join(PLACE),
        format!("{}\ndead", dead.root().display()),
    )
    .unwrap();
    let paths = DaemonPaths::new(Some(&living), "living").unwrap();
    let daemon_lock = DaemonLock::take(&paths).unwrap();
    fs::remove_dir_all(&living).unwrap();
    sweep(Some(&root("other"))).unwrap();
    assert!(!shared.exists() && !dead.shared_folder().exists() && !gone.exists());
    assert!(paths.shared_folder().exists());
    drop(daemon_lock);
    assert!(!paths.shared_folder().exists());
    fs::remove_dir(root("other")).unwrap();
}

#[test]
fn a_daemon_that_ends_after_a_logout_leaves_the_next_one_its_lock_file() {
    let root = root("next");
    let paths = DaemonPaths::new(Some(&root), "next").unwrap();
    for ends_at_once in [false, true] {
        let held = DaemonLock::take(&paths).unwrap();
        let remains = held.remains();
        // a logout removes the file, and the next daemon makes one
        fs::remove_file(paths.lock_path()).unwrap();
        fs::write(paths.lock_path(), "of another").unwrap();
        if ends_at_once {
            remains.remove();
        }
        drop(held);
        let left = fs::read(paths.lock_path()).unwrap();
        assert_eq!(left, b"of another", "at once: {ends_at_once}");
    }
    fs::remove_dir_all(&root).unwrap();
}

//! Memory that the control groups of this process leave: the group it is in, and every group around that.
//!
//! Groups are nested, and each may have a limit: the least of what is left counts. Version 2 has one hierarchy, version 1 one
//! for memory; both may be mounted. In a container only a part of the hierarchy is mounted, from the container's group on.

use std::fs;
use std::path::{Component, Path, PathBuf};

/// Names of a version's files.
struct Files {
    limit: &'static str,
    used: &'static str,
    /// In `memory.stat`: what the system takes back when memory is short.
    cached: &'static str,
}

const V1: Files = Files {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    cached: "total_inactive_file",
};
const V2: Files = Files {
    limit: "memory.max",
    used: "memory.current",
    cached: "inactive_file",
};

/// A hierarchy that is mounted.
struct Mount {
    version: &'static Files,
    /// The group that is mounted, in the hierarchy.
    group: PathBuf,
    /// Where.
    folder: PathBuf,
}

/// What the groups of this process leave [bytes]; none without a limit. `root` is `/`, but for tests.
pub(crate) fn free_memory(root: &Path) -> Option<u64> {
    let read = |path: &str| fs::read_to_string(root.join(path)).unwrap_or_default();
    let mounts = read("proc/self/mountinfo");
    let mounts: Vec<Mount> = mounts
        .lines()
        .filter_map(|line| mount(root, line))
        .collect();
    let groups = read("proc/self/cgroup");
    let left = groups.lines().filter_map(|line| {
        let (version, group) = group(line)?;
        let of_version = |mount: &&Mount| mount.version.limit == version.limit;
        free_around(mounts.iter().find(of_version)?, Path::new(group))
    });
    left.min()
}

/// A line of `/proc/self/mountinfo`, if it is of a hierarchy with memory: `36 35 0:31 GROUP FOLDER rw - TYPE SOURCE OPTIONS`.
fn mount(root: &Path, line: &str) -> Option<Mount> {
    let (place, kind) = line.split_once(" - ")?;
    let mut kind = kind.split(' ');
    let version = match (kind.next()?, kind.nth(1)) {
        ("cgroup2", _) => &V2,
        ("cgroup", Some(options)) if options.split(',').any(|option| option == "memory") => &V1,
        _ => return None,
    };
    let mut place = place.split(' ').skip(3);
    let (group, folder) = (place.next()?, place.next()?);
    Some(Mount {
        version,
        group: group.into(),
        folder: root.join(folder.trim_start_matches('/')),
    })
}

/// A line of `/proc/self/cgroup`, if it is of a hierarchy with memory: `0::GROUP` or `7:memory:GROUP`.
fn group(line: &str) -> Option<(&'static Files, &str)> {
    let mut parts = line.splitn(3, ':');
    let (number, controllers, group) = (parts.next()?, parts.next()?, parts.next()?);
    match controllers {
        "" if number == "0" => Some((&V2, group)),
        _ if controllers
            .split(',')
            .any(|controller| controller == "memory") =>
        {
            Some((&V1, group))
        }
        _ => None,
    }
}

/// The least that a group and those around it leave, as far as they are mounted.
fn free_around(mount: &Mount, group: &Path) -> Option<u64> {
    // a group outside of what is mounted, which may be `/../name`, is seen as that
    let is_inside = !group.components().any(|part| part == Component::ParentDir);
    let inside = group.strip_prefix(&mount.group).ok().filter(|_| is_inside);
    let inside = inside.unwrap_or(Path::new(""));
    let folder = mount.folder.join(inside);
    let around = folder
        .ancestors()
        .take_while(|folder| folder.starts_with(&mount.folder));
    around
        .filter_map(|folder| free_in(mount.version, folder))
        .min()
}

/// What one group leaves.
fn free_in(version: &Files, folder: &Path) -> Option<u64> {
    let number = |file: &str| {
        let text = fs::read_to_string(folder.join(file)).ok()?;
        text.trim().parse::<u64>().ok()
    };
    // "max" is no number, and no limit
    let (limit, used) = (number(version.limit)?, number(version.used)?);
    let stat = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let cached = stat.lines().find_map(|line| {
        let (name, bytes) = line.split_once(' ')?;
        (name == version.cached).then(|| bytes.trim().parse::<u64>().ok())?
    });
    let used = used.saturating_sub(cached.unwrap_or(0));
    Some(limit.saturating_sub(used))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MB: u64 = 1 << 20;

    /// A tree of files in place of the system's.
    struct Tree(PathBuf);

    impl Tree {
        fn new(test: &str, cgroup: &str, mountinfo: &str) -> Tree {
            let name = format!("tightloop-cgroup-{test}-{}", std::process::id());
            let tree = Tree(std::env::temp_dir().join(name));
            tree.write("proc/self/cgroup", cgroup);
            tree.write("proc/self/mountinfo", mountinfo);
            tree
        }

        fn write(&self, path: &str, text: &str) {
            let path = self.0.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }

        fn v2(&self, folder: &str, limit: &str, used: u64) {
            self.write(&format!("{folder}/memory.max"), &format!("{limit}\n"));
            self.write(&format!("{folder}/memory.current"), &format!("{used}\n"));
        }

        fn v1(&self, folder: &str, limit: u64, used: u64) {
            let limit_file = format!("{folder}/memory.limit_in_bytes");
            self.write(&limit_file, &format!("{limit}\n"));
            self.write(
                &format!("{folder}/memory.usage_in_bytes"),
                &format!("{used}\n"),
            );
        }

        fn free(&self) -> Option<u64> {
            free_memory(&self.0)
        }
    }

    impl Drop for Tree {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const UNIFIED: &str = "\
        24 1 0:22 / /proc rw,nosuid - proc proc rw\n\
        35 24 0:30 / /sys/fs/cgroup rw,nosuid shared:9 - cgroup2 cgroup2 rw,nsdelegate\n";

    #[test]
    fn the_least_of_all_groups_around_this_process_counts() {
        let tree = Tree::new("nested", "0::/user.slice/run.scope\n", UNIFIED);
        assert_eq!(tree.free(), None);
        tree.v2("sys/fs/cgroup/user.slice/run.scope", "max", 50 * MB);
        assert_eq!(tree.free(), None);
        tree.v2("sys/fs/cgroup/user.slice", &(200 * MB).to_string(), 60 * MB);
        assert_eq!(tree.free(), Some(140 * MB));
        // more may be used than is allowed
        tree.v2("sys/fs/cgroup", &(10 * MB).to_string(), 60 * MB);
        assert_eq!(tree.free(), Some(0));
        tree.v2("sys/fs/cgroup", "max", 60 * MB);
        tree.v2(
            "sys/fs/cgroup/user.slice/run.scope",
            &(70 * MB).to_string(),
            50 * MB,
        );
        assert_eq!(tree.free(), Some(20 * MB));
        // a group beside ours
        tree.v2("sys/fs/cgroup/user.slice/other.scope", "0", 0);
        assert_eq!(tree.free(), Some(20 * MB));
    }

    #[test]
    fn files_that_the_system_keeps_in_memory_count_as_free() {
        let tree = Tree::new("cached", "0::/job\n", UNIFIED);
        tree.v2("sys/fs/cgroup/job", &(100 * MB).to_string(), 90 * MB);
        let stat = format!("anon 5\ninactive_file {}\nactive_file 7\n", 30 * MB);
        tree.write("sys/fs/cgroup/job/memory.stat", &stat);
        assert_eq!(tree.free(), Some(40 * MB));
    }

    #[test]
    fn version_1_and_both_versions_side_by_side_are_read() {
        let mountinfo = "\
            30 24 0:26 / /sys/fs/cgroup/unified rw - cgroup2 cgroup2 rw\n\
            31 24 0:27 / /sys/fs/cgroup/cpu,cpuacct rw - cgroup cgroup rw,cpu,cpuacct\n\
            32 24 0:28 / /sys/fs/cgroup/memory rw shared:12 - cgroup cgroup rw,memory\n";
        let cgroup = "7:cpu,cpuacct:/jobs/one\n5:memory:/jobs/one\n0::/jobs/one\n";
        let tree = Tree::new("version-1", cgroup, mountinfo);
        let endless = 9_223_372_036_854_771_712;
        tree.v1("sys/fs/cgroup/memory", endless, 500 * MB);
        tree.v1("sys/fs/cgroup/memory/jobs/one", endless, 100 * MB);
        assert_eq!(tree.free(), Some(endless - 500 * MB));
        tree.v1("sys/fs/cgroup/memory/jobs", 300 * MB, 100 * MB);
        assert_eq!(tree.free(), Some(200 * MB));
        tree.write(
            "sys/fs/cgroup/memory/jobs/memory.stat",
            &format!("inactive_file 1\ntotal_inactive_file {}\n", 50 * MB),
        );
        assert_eq!(tree.free(), Some(250 * MB));
        tree.v2(
            "sys/fs/cgroup/unified/jobs",
            &(40 * MB).to_string(),
            10 * MB,
        );
        assert_eq!(tree.free(), Some(30 * MB));
    }

    #[test]
    fn in_a_container_groups_count_as_far_as_they_are_mounted() {
        // without a namespace of groups: the path is that of the machine, and the container's group is mounted
        let mountinfo =
            "32 24 0:28 /docker/abc /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n";
        let tree = Tree::new("container", "5:memory:/docker/abc/job\n", mountinfo);
        tree.v1("sys/fs/cgroup/memory", 300 * MB, 100 * MB);
        assert_eq!(tree.free(), Some(200 * MB));
        tree.v1("sys/fs/cgroup/memory/job", 30 * MB, 10 * MB);
        assert_eq!(tree.free(), Some(20 * MB));
        // with one: this process was moved out of it
        let tree = Tree::new("namespace", "0::/../elsewhere\n", UNIFIED);
        tree.v2("sys/fs/cgroup", &(30 * MB).to_string(), 10 * MB);
        tree.v2("sys/elsewhere", "0", 0);
        assert_eq!(tree.free(), Some(20 * MB));
    }

    #[test]
    fn where_there_are_no_groups_there_is_no_limit() {
        assert_eq!(Tree::new("none", "", "").free(), None);
        assert_eq!(
            Tree::new("nonsense", "0\n::\n1:memory\n", "- \n1 2 - cgroup2\n").free(),
            None
        );
        assert_eq!(free_memory(Path::new("/nonexistent")), None);
    }
}

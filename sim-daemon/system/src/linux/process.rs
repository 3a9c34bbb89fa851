//! Other processes, as `/proc` shows them.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

use rustix::io::Errno;
use rustix::param::{clock_ticks_per_second, page_size};

/// What this system lacks that the transport needs, and what to do.
pub fn missing() -> Option<&'static str> {
    // the transport names processes and files by it
    (!Path::new("/proc/self").exists())
        .then_some("/proc is missing; mount it (`mount -t proc proc /proc`)")
}

/// Whether there is a process of this number.
pub fn exists(pid: u32) -> bool {
    Path::new(&format!("/proc/{pid}")).exists()
}

/// Whether a process is gone, or has only its exit code left, as far as can be seen beside another one, `beside`: in another
/// container, processes have other numbers.
pub fn is_gone(pid: u32, beside: u32) -> bool {
    let namespace = |process: &str| fs::read_link(format!("/proc/{process}/ns/pid")).ok();
    if namespace("self") != namespace(&beside.to_string()) {
        return false;
    }
    let status = match fs::read_to_string(format!("/proc/{pid}/stat")) {
        Ok(status) => status,
        // the second one ends between open and read; without a file to open, nothing is known
        Err(error) => {
            let ended = Some(Errno::SRCH.raw_os_error());
            return error.kind() == ErrorKind::NotFound || error.raw_os_error() == ended;
        }
    };
    // the name stands in parentheses and may have any character; the state comes after it
    let state = status
        .rsplit_once(')')
        .and_then(|(_, rest)| rest.trim_start().chars().next());
    matches!(state, None | Some('Z' | 'X'))
}

/// Whether `parent`, which started this process, has ended.
pub fn is_orphan(parent: u32) -> bool {
    std::os::unix::process::parent_id() != parent
}

/// How long a process has run, as far as this process sees it.
pub fn age(pid: u32) -> Option<Duration> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let uptime = fs::read_to_string("/proc/uptime").ok()?;
    // the name before may have spaces; its start is the 22nd field
    let started: f64 = stat
        .rsplit_once(')')?
        .1
        .split_whitespace()
        .nth(19)?
        .parse()
        .ok()?;
    let now: f64 = uptime.split_whitespace().next()?.parse().ok()?;
    let ticks = clock_ticks_per_second() as f64;
    Duration::try_from_secs_f64(now - started / ticks).ok()
}

/// Memory that a process uses, the shared part included [bytes].
pub fn memory(pid: u32) -> Option<u64> {
    pages(pid, 1)
}

/// The part of its memory that a process shares with others [bytes]; none where the system does not tell.
pub fn memory_shared(pid: u32) -> Option<u64> {
    pages(pid, 2)
}

/// Bytes of a column of `statm`.
fn pages(pid: u32, column: usize) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm")).ok()?;
    let pages: u64 = text.split_whitespace().nth(column)?.parse().ok()?;
    Some(pages * page_size() as u64)
}

/// Threads of this process.
pub fn threads() -> Option<usize> {
    Some(fs::read_dir("/proc/self/task").ok()?.count())
}

/// An open file of another process that has no name: `/proc/PID/fd/N`.
pub fn is_open_file_of_another(path: &Path) -> bool {
    path.starts_with("/proc")
}

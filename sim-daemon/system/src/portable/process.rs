//! What the system tells of processes.

use std::path::Path;
use std::time::Duration;

use sysinfo::{Pid, Process, ProcessRefreshKind, ProcessesToUpdate, System};

/// What this system lacks that the transport needs, and what to do.
pub fn missing() -> Option<&'static str> {
    None
}

/// How long a process has run.
pub fn age(pid: u32) -> Option<Duration> {
    let of_process = |process: &Process| Duration::from_secs(process.run_time());
    look(pid, ProcessRefreshKind::nothing(), of_process)
}

/// Memory that a process uses, the shared part included [bytes].
pub fn memory(pid: u32) -> Option<u64> {
    let of_process = |process: &Process| process.memory();
    look(pid, ProcessRefreshKind::nothing().with_memory(), of_process)
}

/// The part of its memory that a process shares with others [bytes]; none where the system does not tell.
pub fn memory_shared(_pid: u32) -> Option<u64> {
    None
}

/// Threads of this process; none where the system does not tell.
pub fn threads() -> Option<usize> {
    None
}

/// An open file of another process that has no name; there are none here.
pub fn is_open_file_of_another(_path: &Path) -> bool {
    false
}

/// What the system knows of a process.
pub(crate) fn look<T>(
    pid: u32,
    what: ProcessRefreshKind,
    of_process: impl Fn(&Process) -> T,
) -> Option<T> {
    let (pid, mut system) = (Pid::from_u32(pid), System::new().ok()?);
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[pid]), true, what);
    system.process(pid).map(of_process)
}

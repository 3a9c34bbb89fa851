//! Other processes.

use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};
use sysinfo::{Process, ProcessRefreshKind, ProcessStatus};

use crate::portable::process::look;
pub use crate::portable::process::{
    age, is_open_file_of_another, memory, memory_shared, missing, threads,
};

/// Whether there is a process of this number.
pub fn exists(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    // one of another user may not be signalled, and is there
    pid.is_some_and(|pid| matches!(test_kill_process(pid), Ok(()) | Err(Errno::PERM)))
}

/// Whether a process is gone, or has only its exit code left. `beside` is another process, which may have other numbers for
/// processes in containers: there are none here.
pub fn is_gone(pid: u32, _beside: u32) -> bool {
    let of_process = |process: &Process| process.status();
    let status = look(pid, ProcessRefreshKind::nothing(), of_process);
    // macOS tells nothing of a process that has only its exit code left
    matches!(
        status,
        None | Some(ProcessStatus::Zombie | ProcessStatus::Dead)
    )
}

/// Whether `parent`, which started this process, has ended.
pub fn is_orphan(parent: u32) -> bool {
    std::os::unix::process::parent_id() != parent
}

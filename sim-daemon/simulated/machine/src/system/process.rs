//! Other processes.

use crate::process::{is_alive, parent};
use crate::world::{step, system_call};

/// What this system lacks that the transport needs: nothing.
pub fn missing() -> Option<&'static str> {
    None
}

/// Whether there is a process of this number.
pub fn exists(pid: u32) -> bool {
    system_call(format_args!("asks whether process {pid} exists")).is_ok() && is_alive(pid)
}

/// Whether a process is gone, as far as can be seen beside another one, `beside`, which must live.
pub fn is_gone(pid: u32, beside: u32) -> bool {
    let is_seen = system_call(format_args!("compares itself with process {beside}")).is_ok();
    if !is_seen || !is_alive(beside) {
        return false;
    }
    // of a state that cannot be read, nothing is known
    system_call(format_args!("reads the state of process {pid}")).is_ok() && !is_alive(pid)
}

/// Whether `parent`, which started this process, has ended.
pub fn is_orphan(parent: u32) -> bool {
    step("asks for its parent");
    self::parent() != parent
}

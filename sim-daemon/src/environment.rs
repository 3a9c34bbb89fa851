//! What a process must have in its environment before it loads Vulkan.
//!
//! Mesa's device-select layer asks for a Wayland display, and libwayland prints an error where `XDG_RUNTIME_DIR` is unset. A
//! process whose environment names a folder without a display is quiet. The daemon names its own root folder, which is
//! private to the user; where clients look for daemons does not change by that ([`sim_protocol::paths::default_root`]).

use std::path::Path;

use sim_protocol::paths::{RUNTIME_FOLDER, stand_in_runtime_folder};
use sim_system::process;

/// The variable that is missing and its value; `None` if nothing is.
pub fn missing() -> Option<(&'static str, &'static Path)> {
    stand_in_runtime_folder().map(|folder| (RUNTIME_FOLDER, folder))
}

/// Completes the environment. Call it first in `main`: it leaves a process with several threads as it is.
pub fn complete() {
    if process::threads() != Some(1) {
        return;
    }
    if let Some((name, value)) = missing() {
        // SAFETY: this process has one thread, this one, so nobody else reads the environment, or starts a thread, meanwhile.
        unsafe { std::env::set_var(name, value) };
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_process_with_several_threads_keeps_its_environment() {
        let before = std::env::var_os(RUNTIME_FOLDER);
        std::thread::scope(|scope| {
            let (done, wait) = std::sync::mpsc::channel::<()>();
            scope.spawn(move || wait.recv());
            assert!(process::threads() > Some(1));
            complete();
            drop(done);
        });
        assert_eq!(std::env::var_os(RUNTIME_FOLDER), before);
    }
}

//! Runs all tests of a program under Vulkan's validation layer: any message of it ends the program as a failure.
//!
//! The layer is asked for by the environment, before `main`, while there is one thread. It begins a file of messages anew with each
//! instance of Vulkan, so they go into a pipe, which is read when the program ends. Under nextest a program is one test.

use rustix::fs::{MemfdFlags, OFlags, fcntl_setfl, memfd_create};
use std::fs::File;
use std::io::{PipeReader, PipeWriter, Read, Write};
use std::os::fd::AsRawFd;
use std::sync::OnceLock;

/// The layer, as the loader knows it.
const LAYER: &str = "VK_LAYER_KHRONOS_validation";

/// Errors, warnings and hazards between commands; few of a kind, since nobody empties the pipe meanwhile.
const SETTINGS: &str = "\
    khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n\
    khronos_validation.report_flags = error,warn\n\
    khronos_validation.duplicate_message_limit = 3\n\
    khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT\n";

/// Where the layer's words come out, what keeps that open, and what the layer reads.
static WATCH: OnceLock<(PipeReader, PipeWriter, File)> = OnceLock::new();

#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE: extern "C" fn() = begin;

#[used]
#[unsafe(link_section = ".fini_array")]
static AFTER: extern "C" fn() = end;

extern "C" fn begin() {
    let (words, room) = std::io::pipe().expect("a pipe");
    fcntl_setfl(&words, OFlags::NONBLOCK).expect("a pipe need not block");
    let path = |fd: i32| format!("/proc/self/fd/{fd}");
    let settings = memfd_create("layer", MemfdFlags::CLOEXEC).expect("memory for settings");
    let mut settings = File::from(settings);
    let to = path(room.as_raw_fd());
    let written = writeln!(settings, "{SETTINGS}khronos_validation.log_filename = {to}");
    written.expect("settings are few");
    let place = path(settings.as_raw_fd());
    // SAFETY: before `main` there is one thread.
    unsafe {
        std::env::set_var("VK_INSTANCE_LAYERS", LAYER);
        std::env::set_var("VK_LAYER_SETTINGS_PATH", place);
    }
    WATCH.set((words, room, settings)).expect("one beginning");
}

extern "C" fn end() {
    let Some((words, ..)) = WATCH.get() else {
        return;
    };
    let mut said = Vec::new();
    // it ends with what would block: nobody has closed the other end
    let _ = { words }.read_to_end(&mut said);
    if !said.is_empty() {
        let said = String::from_utf8_lossy(&said);
        eprintln!("Vulkan's validation layer is not silent:\n{said}");
        std::process::abort();
    }
}

/// Fails where the layer is not there. An instance of Vulkan must be.
#[track_caller]
pub fn assert_watched() {
    let loaded = std::fs::read_to_string("/proc/self/maps").expect("Linux tells");
    assert!(
        loaded.contains("khronos_validation"),
        "Vulkan's validation layer is needed: `apt-get install vulkan-validationlayers`"
    );
}

//! Requests to stop as flags, and the priority of a thread.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register;
use thread_priority::{ThreadPriority, set_thread_priority, thread_native_id};

/// What Ctrl-Break raises, which alone reaches a process of a group of its own.
const SIGBREAK: i32 = 21;

/// Sets the flag when somebody asks this process to stop, by Ctrl-C or Ctrl-Break.
///
/// # Errors
/// Those of the system.
pub fn on_stop(flag: &Arc<AtomicBool>) -> io::Result<()> {
    for signal in [SIGTERM, SIGINT, SIGBREAK] {
        register(signal, Arc::clone(flag))?;
    }
    Ok(())
}

/// Makes a file that may not grow an error to report, which it is here.
pub fn survive_full_files() {}

/// Lets this thread write to a terminal whose foreground is another job, which it may here.
pub fn keep_writing_in_the_background() {}

/// Gives this thread a priority from 1 to 99.
///
/// # Errors
/// Why it was not granted, and what to do.
pub fn set_priority(priority: u8) -> Result<(), String> {
    let value = priority
        .try_into()
        .map_err(|_| "(it is above 99)".to_owned())?;
    set_thread_priority(thread_native_id(), ThreadPriority::Crossplatform(value))
        .map_err(|error| format!("({error:?})"))
}

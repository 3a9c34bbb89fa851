//! Signals as flags, and the priority of a thread.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nix::sys::signal::{SigSet, Signal};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag::register;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Sets the flag when somebody asks this process to stop: from the terminal, or by another program.
///
/// # Errors
/// Those of the system.
pub fn on_stop(flag: &Arc<AtomicBool>) -> io::Result<()> {
    for signal in [SIGTERM, SIGINT, SIGHUP] {
        register(signal, Arc::clone(flag))?;
    }
    Ok(())
}

/// Makes a file that may not grow an error to report, no reason to be killed.
pub fn survive_full_files() {
    let _ = register(SIGXFSZ, Arc::default());
}

/// Lets this thread write to a terminal whose foreground is another job. Under `stty tostop` the terminal stops whole
/// processes that write from the background, unless the writer blocks the signal.
pub fn keep_writing_in_the_background() {
    // a thread that keeps its mask is no worse than before
    let _ = SigSet::from(Signal::SIGTTOU).thread_block();
}

/// Gives this thread, and those that it starts, a real-time priority from 1 to 99.
///
/// # Errors
/// Why it was not granted, and what to do.
pub fn set_priority(priority: u8) -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let value = priority
        .try_into()
        .map_err(|_| "(it is above 99)".to_owned())?;
    let value = ThreadPriority::Crossplatform(value);
    set_thread_priority_and_policy(thread_native_id(), value, policy).map_err(|error| {
        format!(
            "({error:?}): run as root, or allow `rtprio {priority}` in /etc/security/limits.conf"
        )
    })
}

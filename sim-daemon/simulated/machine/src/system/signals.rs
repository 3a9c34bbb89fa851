//! Signals as flags.

use std::io;

use crate::process::kill;
use crate::sync::Arc;
use crate::sync::atomic::{AtomicBool, Ordering};
use crate::world::{step, system_call, with};

/// Sets the flag when somebody asks this process to stop.
///
/// # Errors
/// Those of the system.
pub fn on_stop(flag: &Arc<AtomicBool>) -> io::Result<()> {
    system_call("handles signals")?;
    with(|world| {
        let process = world.process();
        let flags = world.system.flags.entry(process).or_default();
        flags.push(Arc::clone(flag));
    });
    Ok(())
}

/// Gives this thread a priority, which changes nothing here.
///
/// # Errors
/// None.
pub fn set_priority(_priority: u8) -> Result<(), String> {
    Ok(())
}

/// For a scenario: asks a process to stop. One that handles no signals is killed.
pub fn send(pid: u32) {
    step(format_args!("asks process {pid} to stop"));
    // flags are doors, too
    match with(|world| world.system.flags.get(&pid).cloned()) {
        Some(flags) => flags
            .iter()
            .for_each(|flag| flag.store(true, Ordering::Relaxed)),
        None => kill(pid),
    }
}

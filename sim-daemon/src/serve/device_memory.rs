//! Frames and commands that stay on the card: between the memory of a GPU and the client that maps it.

use std::time::{Duration, Instant};

use sim_engine::backend::sharing::Sharing;
use sim_engine::simulation::Simulation;
use sim_protocol::host::Host;
use sim_protocol::{Delivery, Op, RefusalKind};

use crate::export;
use crate::export::refusal::{Refusal, refusal};

/// How long a client's card is waited for before control requests are looked at.
const SLICE: Duration = Duration::from_millis(20);
/// A client waits as long for its frame.
const WAIT_MAX: Duration = Duration::from_secs(120);

/// Commands of a step that are in device memory and may be taken there.
pub(crate) type Left = Vec<usize>;

/// Makes the memory of a lease.
pub(crate) fn share(simulation: &mut Simulation, slots: usize) -> Result<Delivery, String> {
    let Some(sharing) = simulation.sharing() else {
        return Err("the worlds are on the CPU; launch with device=\"gpu\"".to_owned());
    };
    let memory = sharing.share(slots).map_err(|error| error.to_string())?;
    Ok(export::device_memory(memory, simulation.layout()))
}

/// Waits for what a step takes from device memory. What the host must see, a recorder or an error message, is brought here.
pub(crate) fn receive(simulation: &mut Simulation, host: &mut Host) -> Result<Left, Refusal> {
    let Some(on_device) = host.inbox().on_device() else {
        return Ok(Vec::new());
    };
    let malformed = |reason: &str| Err(refusal(RefusalKind::Malformed, reason.to_owned()));
    if host.inbox().op() != Op::Step {
        return malformed("on_device: only a step takes commands from device memory");
    }
    let Some(sharing) = simulation.sharing() else {
        return malformed("on_device: the worlds are on the CPU");
    };
    let names = sharing.names();
    let is_left = |command: &usize| *command < 64 && on_device.commands >> command & 1 == 1;
    let left: Left = (0..names.len()).filter(is_left).collect();
    if left.len() != on_device.commands.count_ones() as usize {
        return malformed(
            "this lease has no such memory on the card; ask for it again (`sim.keep_on_gpu()`)",
        );
    }
    if names.is_empty() {
        // of a lease that has no memory there is nothing to wait for
        return Ok(Vec::new());
    }
    wait(sharing, host, on_device.ready)?;
    let is_twice = |row: &str| left.iter().any(|&command| names[command] == row);
    if let Some(row) = host.inbox().arrays().find(|row| is_twice(&row.name)) {
        return malformed(&format!("`{}` is given twice", row.name));
    }
    if left.is_empty() || !host.is_recorded() && sharing.accepts(&left, on_device.ready)? {
        return Ok(left);
    }
    let mut brought = Vec::new();
    for command in left {
        brought.push((names[command].to_owned(), sharing.read_shared(command)?));
    }
    host.bring_here(&brought)
        .map_err(|reason| refusal(RefusalKind::Malformed, reason))?;
    Ok(Vec::new())
}

/// Waits until the client's card has done what it was given before this command.
fn wait(sharing: &mut dyn Sharing, host: &mut Host, ready: u64) -> Result<(), Refusal> {
    let started = Instant::now();
    while !sharing.await_client(ready, SLICE)? {
        let reason = if !host.is_waited_for() {
            "on_device: the client has gone, or the daemon ends".to_owned()
        } else if started.elapsed() > WAIT_MAX {
            let limit = WAIT_MAX.as_secs();
            format!("on_device: the client's card has not reached {ready} after {limit} s")
        } else {
            continue;
        };
        return Err(refusal(RefusalKind::Stale, reason));
    }
    Ok(())
}

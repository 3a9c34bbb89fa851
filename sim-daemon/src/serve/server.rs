//! The loop of a daemon: one command in, one frame out.

use std::time::Instant;

use sim_engine::simulation::Simulation;
use sim_protocol::host::{Host, Next};
use sim_protocol::{Op, RefusalKind};

use crate::error::DaemonError;
use crate::export::refusal::{Refusal, refusal};
use crate::export::{self, Advance};
use crate::eyes::Eyes;
use crate::serve::device_memory;
use crate::serve::fault_log::FaultLog;
use crate::serve::ik::Ik;
use crate::serve::log::Log;
use crate::serve::rollout::Rollouts;
use crate::serve::shown::Shown;

#[cfg(test)]
mod tests;

/// Serves until somebody asks to end.
pub(crate) fn run(
    mut simulation: Simulation,
    mut eyes: Eyes,
    host: &mut Host,
    log: &Log,
) -> Result<(), DaemonError> {
    let mut faults = FaultLog::default();
    let result = serve(&mut simulation, &mut eyes, host, log, &mut faults);
    faults.end(&mut simulation, log);
    result
}

fn serve(
    simulation: &mut Simulation,
    eyes: &mut Eyes,
    host: &mut Host,
    log: &Log,
    faults: &mut FaultLog,
) -> Result<(), DaemonError> {
    let mut mask = Vec::with_capacity(simulation.worlds());
    let (mut scratch, mut ik) = (Vec::new(), Ik::default());
    let mut rollouts = Rollouts::default();
    let mut lease = 0;
    let mut is_reported = false;
    let watched = host.description().watch_worlds;
    loop {
        let next = host.wait()?;
        // of a lease that has ended, nothing is kept
        if host.lease() != lease {
            simulation.forget();
            lease = host.lease();
        }
        match next {
            Next::Command => {
                let started = Instant::now();
                let mut applied = match lost(simulation) {
                    Some(refusal) => Err(refusal),
                    None if host.inbox().op() == Op::Rollout => {
                        rollouts.answer(simulation, eyes, host, watched)
                    }
                    None => apply(simulation, host, &mut mask, &mut ik),
                };
                if applied.is_ok() && host.inbox().op() == Op::Restore {
                    eyes.forget();
                    // its file may be gone when the recording is replayed
                    if host.is_recorded() {
                        record_state(simulation, host, true);
                    }
                }
                if let (Ok(_), Some(refusal)) = (&applied, lost(simulation)) {
                    applied = Err(refusal);
                }
                match applied {
                    Ok(advance) => {
                        let mut shown = Shown {
                            simulation,
                            eyes,
                            advance,
                            keeps: true,
                            watched,
                        };
                        match host.inbox().op() {
                            Op::Rollout => host.answer(started, &mut rollouts.end(shown)),
                            _ => host.answer(started, &mut shown),
                        }
                    }
                    Err(refusal) => host.refuse(refusal.kind, &refusal.reason),
                }
                faults.report(simulation, log, started);
            }
            Next::Late => {
                host.give_up();
                rollouts.forget();
                let started = Instant::now();
                // a lost device has no worlds to advance; the next command gets the error
                if lost(simulation).is_none() && apply(simulation, host, &mut mask, &mut ik).is_ok()
                {
                    scratch.resize(eyes.images().arena_bytes().div_ceil(8), 0);
                    let mut shown = Shown {
                        simulation,
                        eyes,
                        advance: Advance::Step,
                        keeps: true,
                        watched,
                    };
                    host.advance(&mut scratch, &mut shown);
                } else {
                    host.stand_still();
                }
                faults.report(simulation, log, started);
            }
            Next::Observe => {
                // nobody steps now, so there is time to evaluate what observers have not seen
                scratch.resize(eyes.images().arena_bytes().div_ceil(8), 0);
                let mut shown = Shown {
                    simulation,
                    eyes,
                    advance: Advance::Forward,
                    keeps: false,
                    watched,
                };
                host.show(&mut scratch, &mut shown);
                faults.report(simulation, log, Instant::now());
            }
            Next::DeviceMemory => {
                host.deliver(|host| device_memory::share(simulation, host.frame_slots()));
            }
            // handled above
            Next::LeaseEnded => {}
            Next::Record => {
                // a replay has the state, and no images that came before; other recordings must forget them, too
                eyes.forget();
                record_state(simulation, host, eyes.images().repeat());
            }
            Next::End => return Ok(()),
        }
        // the client has its frame, and need not wait for this
        if !is_reported && let Some(lost) = simulation.lost() {
            log.write(&format!(
                "all worlds are lost, and commands are refused from now on: {lost}"
            ));
            host.end_records(&format!("all worlds are lost: {lost}"));
            is_reported = true;
        }
    }
}

/// Sets the inputs of a command, wherever they are, all of them or none.
fn apply(
    simulation: &mut Simulation,
    host: &mut Host,
    mask: &mut Vec<bool>,
    ik: &mut Ik,
) -> Result<Advance, Refusal> {
    if host.inbox().op() == Op::Ik {
        ik.answer(simulation, host.inbox(), host.stop_flag())?;
    }
    let left = device_memory::receive(simulation, host)?;
    let advance = export::apply(simulation, host.inbox(), mask)?;
    if let Some(sharing) = simulation.sharing() {
        sharing.stage_shared(&left);
    }
    Ok(advance)
}

/// Gives recorders the state of all worlds, as long as there is one: `all` of them, or those who wait for it.
fn record_state(simulation: &Simulation, host: &mut Host, all: bool) {
    let state = simulation.snapshot();
    if simulation.lost().is_none() {
        host.record_state(&state, all);
    }
}

/// Why every command is refused, if it is.
fn lost(simulation: &Simulation) -> Option<Refusal> {
    let reason = simulation.lost()?.to_string();
    Some(refusal(RefusalKind::Backend, reason))
}

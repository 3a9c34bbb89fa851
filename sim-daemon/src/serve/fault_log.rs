//! Log lines about faulted worlds: a count now and then, not a line each.

use std::time::{Duration, Instant};

use sim_engine::simulation::{Frozen, Simulation};

use crate::serve::log::Log;

/// Time between two lines, at least.
const PERIOD: Duration = Duration::from_secs(1);

/// Reports faulted worlds.
#[derive(Debug, Default)]
pub(crate) struct FaultLog {
    reported: Option<Instant>,
}

impl FaultLog {
    /// Reports the worlds that were frozen since the last line, unless a line was just written: then the next command or the
    /// end reports them.
    pub(crate) fn report(&mut self, simulation: &mut Simulation, log: &Log, now: Instant) {
        if self
            .reported
            .is_some_and(|reported| now.duration_since(reported) < PERIOD)
        {
            return;
        }
        if let Some(line) = line(&simulation.take_frozen(), simulation.worlds()) {
            log.write(&line);
            self.reported = Some(now);
        }
    }

    /// Reports what is left.
    pub(crate) fn end(mut self, simulation: &mut Simulation, log: &Log) {
        self.reported = None;
        self.report(simulation, log, Instant::now());
    }
}

/// The line, if there is anything to report.
fn line(frozen: &Frozen, worlds: usize) -> Option<String> {
    let first = frozen.first?;
    let count = frozen.not_finite + frozen.out_of_bounds;
    let causes = [
        (frozen.not_finite, "no longer finite"),
        (frozen.out_of_bounds, "beyond the bounds"),
    ];
    let causes = causes.iter().filter(|(count, _)| *count > 0);
    let causes: Vec<String> = causes
        .map(|(count, cause)| format!("{count} {cause}"))
        .collect();
    let cause = if first.is_finite {
        "beyond the bounds"
    } else {
        "no longer finite"
    };
    let what = match count {
        1 => "1 world".to_owned(),
        // where worlds are reset by themselves, some are frozen again
        _ if count > worlds as u64 => format!("worlds {count} times"),
        _ => format!("{count} worlds"),
    };
    Some(format!(
        "frozen: {what} ({}), the first of them world {}, {cause} after its step {}; frozen now: {} of {worlds}",
        causes.join(", "),
        first.world,
        first.steps,
        frozen.now,
    ))
}

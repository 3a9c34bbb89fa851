//! News of worlds that were frozen: a count now and then, not a line each.

use std::time::{Duration, Instant};

use sim_engine::simulation::{Frozen, Simulation};

use crate::news::News;

/// Time between two lines, at least.
const PERIOD: Duration = Duration::from_secs(1);

/// Tells of frozen worlds.
#[derive(Debug, Default)]
pub(crate) struct FaultNews {
    told: Option<Instant>,
}

impl FaultNews {
    /// Tells of the worlds that were frozen since the last line, unless that was just said: then the next command or the end
    /// tells them.
    pub(crate) fn tell(&mut self, simulation: &mut Simulation, news: &mut News, now: Instant) {
        if self
            .told
            .is_some_and(|told| now.duration_since(told) < PERIOD)
        {
            return;
        }
        if let Some(line) = line(&simulation.take_frozen(), simulation.worlds()) {
            news.tell(&line);
            self.told = Some(now);
        }
    }

    /// Tells what is left to tell.
    pub(crate) fn end(mut self, simulation: &mut Simulation, news: &mut News) {
        self.told = None;
        self.tell(simulation, news, Instant::now());
    }
}

/// What there is to say, if anything.
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

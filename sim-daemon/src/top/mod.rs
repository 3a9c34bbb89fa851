//! `tightloop top`: what a daemon does now, on a terminal, as JSON, or for Prometheus.

mod http;
mod look;
mod metrics;
mod page;

use std::io::{IsTerminal, stdout};
use std::time::Duration;

use sim_protocol::keep_waiting;

use self::look::Watched;
use crate::cli::Top;
use crate::error::DaemonError;
use crate::output;

/// Moves the cursor to the upper left corner, and erases what is below it.
const CLEAR: &str = "\x1b[H\x1b[J";
/// Longest time between two looks [s].
const LONGEST: f64 = 3600.0;

/// Shows a daemon until it ends, Ctrl-C, or as many looks as asked for.
pub(crate) fn run(top: &Top) -> Result<(), DaemonError> {
    if top.interval.is_nan() || !(0.1..=LONGEST).contains(&top.interval) {
        return Err(DaemonError::Argument {
            argument: "interval",
            value: top.interval.to_string(),
            problem: format!("give 0.1 to {LONGEST} seconds"),
        });
    }
    let mut watched = Watched::attach(&top.name)?;
    if let Some(address) = &top.metrics {
        return http::serve(address, watched);
    }
    let is_live = stdout().is_terminal() && !top.json && top.count != Some(1);
    let mut shown = 0;
    while top.count.is_none_or(|count| shown < count) {
        std::thread::sleep(Duration::from_secs_f64(top.interval));
        let look = watched.look(&mut keep_waiting())?;
        let text = match (top.json, is_live) {
            (true, _) => format!("{}\n", page::json(&look)),
            (false, true) => format!("{CLEAR}{}", page::text(&look)),
            (false, false) => page::text(&look),
        };
        output::print(text.as_bytes()).map_err(DaemonError::stdout)?;
        shown += 1;
    }
    Ok(())
}

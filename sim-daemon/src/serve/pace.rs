//! What a run needs to keep to real time: the pace of its frames, and what it asks of the system.

use std::time::Duration;

use sim_protocol::{Late, Pace};
use sim_system::{cores, memory, signals};

use crate::cli::Serve;
use crate::error::DaemonError;

/// Longest time from frame to frame, and without a command [s].
const LONGEST: f64 = 3600.0;
/// Shortest time from frame to frame [s].
const SHORTEST: f64 = 1e-6;
/// Priorities of the system's real-time threads.
const PRIORITIES: std::ops::RangeInclusive<u8> = 1..=99;

/// The pace that the arguments ask for, if any; a frame simulates so many seconds.
///
/// # Errors
/// An argument that makes no sense, with what would.
pub(crate) fn pace(serve: &Serve, frame: f64) -> Result<Option<Pace>, DaemonError> {
    let Some(late) = Late::named(&serve.late) else {
        let problem = "unknown; use pause, hold or stop".to_owned();
        return Err(wrong("late", &serve.late, problem));
    };
    let Some(realtime) = serve.realtime else {
        return Ok(None);
    };
    let period = frame / realtime;
    if realtime.is_nan() || realtime <= 0.0 || !(SHORTEST..=LONGEST).contains(&period) {
        let problem = format!(
            "a frame of {frame} s would take {period} s; give a factor between {:.1e} and {:.1e}",
            frame / LONGEST,
            frame / SHORTEST
        );
        return Err(wrong("realtime", &realtime, problem));
    }
    if let Some(timeout) = serve.command_timeout {
        if late != Late::Hold {
            let problem = format!("goes with late hold, and late is {}", serve.late);
            return Err(wrong("command-timeout", &timeout, problem));
        }
        if timeout.is_nan() || !(0.0..=LONGEST).contains(&timeout) {
            let problem = format!("give seconds between 0 and {LONGEST}");
            return Err(wrong("command-timeout", &timeout, problem));
        }
    }
    let nanoseconds = |seconds: f64| Duration::from_secs_f64(seconds).as_nanos() as u64;
    Ok(Some(Pace {
        realtime,
        period_ns: nanoseconds(period),
        late,
        command_timeout_ns: serve.command_timeout.map(nanoseconds),
    }))
}

/// Asks the system for the cores and the priority of the arguments, for this thread and those that it starts. Returns a
/// sentence about each wish that was not granted.
///
/// # Errors
/// An argument that makes no sense, with what would.
pub(crate) fn ask_system(serve: &Serve) -> Result<Vec<String>, DaemonError> {
    let mut notes = Vec::new();
    if !serve.cores.is_empty() {
        cores::keep_to(&serve.cores).map_err(|problem| {
            let given: Vec<String> = serve.cores.iter().map(usize::to_string).collect();
            wrong("cores", &given.join(","), problem)
        })?;
    }
    if let Some(priority) = serve.priority {
        let Some(value) = Some(priority).filter(|priority| PRIORITIES.contains(priority)) else {
            let problem = "give 1 to 99; 99 is the most urgent".to_owned();
            return Err(wrong("priority", &priority, problem));
        };
        if let Err(problem) = signals::set_priority(value) {
            notes.push(format!("priority {value} was not granted {problem}"));
        }
    }
    Ok(notes)
}

/// Keeps the pages that are in use now in memory, if the arguments ask for it. Returns a sentence if that was not granted.
pub(crate) fn lock_memory(serve: &Serve) -> Option<String> {
    if !serve.lock_memory {
        return None;
    }
    let problem = memory::lock().err()?;
    Some(format!("memory was not locked {problem}"))
}

fn wrong(argument: &'static str, value: &dyn ToString, problem: String) -> DaemonError {
    let value = value.to_string();
    DaemonError::Argument {
        argument,
        value,
        problem,
    }
}

//! When frames are due, and how well they kept to it.

use hdrhistogram::Histogram;

use crate::doors::time::Instant;
use crate::waiting::clock::{self, Alarm};
use crate::wire::description::{Description, Late, Pace};
use crate::wire::timing::{Percentiles, Timing};

/// A frame that leaves later than due by this share of the period has missed its deadline.
const TOLERANCE: u64 = 10;
/// Longest duration that is counted apart from longer ones [ns].
const LONGEST: u64 = 60_000_000_000;
/// Digits that are kept of a duration.
const DIGITS: u8 = 2;

/// The pace of a run, and what was measured of it. Without a pace it only measures.
#[derive(Debug)]
pub(super) struct Pacer {
    pace: Option<Pace>,
    /// When the next frame is due, once a first step came [ns].
    due: Option<u64>,
    alarm: Alarm,
    /// When the last step was received [ns].
    received: u64,
    /// When the last frame left, if another may follow it.
    left: Option<Instant>,
    /// The command of the frame that is made now was late.
    is_late: bool,
    /// Zeros were sent since the last command.
    has_stopped: bool,
    /// What stops the worlds: commands, and zeros for all worlds.
    zeros: Vec<(String, Vec<f32>)>,
    frames: u64,
    missed: u64,
    late: u64,
    skipped: u64,
    period: Histogram<u64>,
    lateness: Histogram<u64>,
    latency: Histogram<u64>,
    busy: Histogram<u64>,
}

impl Pacer {
    /// `stops` names the commands that are 0 when worlds stop.
    pub(super) fn new(description: &Description, stops: &[&str]) -> Pacer {
        let pace = description.pace;
        let may_stop = pace.is_some_and(|pace| {
            pace.late == Late::Stop || pace.late == Late::Hold && pace.command_timeout_ns.is_some()
        });
        let commands = description.commands.iter();
        let stopped =
            commands.filter(|input| may_stop && input.columns > 0 && stops.contains(&&*input.name));
        let zeros = stopped.map(|input| {
            let zeros = vec![0.0; description.worlds * input.columns];
            (input.name.clone(), zeros)
        });
        let empty = || Histogram::new_with_max(LONGEST, DIGITS).expect("bounds in order");
        Pacer {
            pace,
            due: None,
            alarm: Alarm::new(),
            received: 0,
            left: None,
            is_late: false,
            has_stopped: false,
            zeros: zeros.collect(),
            frames: 0,
            missed: 0,
            late: 0,
            skipped: 0,
            period: empty(),
            lateness: empty(),
            latency: empty(),
            busy: empty(),
        }
    }

    /// A step was received.
    pub(super) fn receive(&mut self) {
        let Some(pace) = self.pace else { return };
        self.received = clock::now();
        self.has_stopped = false;
        self.is_late = self.due.is_some_and(|due| self.received > due);
        match self.due {
            None => self.due = Some(self.received + pace.period_ns),
            // the worlds stood still: their frame leaves at once, and the next one is due a period later
            Some(_) if self.is_late && pace.late == Late::Pause => self.due = Some(self.received),
            Some(_) => {}
        }
    }

    /// Something else than a step came, or the client went: worlds that stand still without a step begin anew with the next one.
    pub(super) fn rest(&mut self) {
        if self.pace.is_none_or(|pace| pace.late == Late::Pause) {
            self.stand_still();
        }
    }

    /// No frame is due until the next step comes.
    pub(super) fn stand_still(&mut self) {
        (self.due, self.left) = (None, None);
    }

    /// When worlds go on without a command, if they do [ns].
    pub(super) fn deadline(&self) -> Option<u64> {
        self.due
            .filter(|_| self.pace.is_some_and(|pace| pace.late != Late::Pause))
    }

    /// No command came until the deadline. Returns commands of zero if these are to go to the worlds now.
    pub(super) fn give_up(&mut self) -> &[(String, Vec<f32>)] {
        self.is_late = true;
        let timeout = self.pace.and_then(|pace| pace.command_timeout_ns);
        let waited = clock::now().saturating_sub(self.received);
        let stops = self.pace.is_some_and(|pace| pace.late == Late::Stop)
            || timeout.is_some_and(|timeout| waited > timeout);
        if !stops || self.has_stopped {
            return &[];
        }
        self.has_stopped = true;
        &self.zeros
    }

    /// Whether frames keep a pace.
    pub(super) fn is_paced(&self) -> bool {
        self.pace.is_some()
    }

    /// When the frame that is made now is due, if it is.
    pub(super) fn due(&self) -> Option<u64> {
        self.due
    }

    /// When the frame after it is due; 0 if that is not known [ns].
    pub(super) fn due_next(&self) -> u64 {
        match (self.due, self.pace) {
            (Some(due), Some(pace)) => due + pace.period_ns,
            _ => 0,
        }
    }

    /// A frame is made: waits until it is due.
    pub(super) fn hold(&mut self) {
        if let Some(due) = self.due {
            self.alarm.wait_until(due);
        }
    }

    /// The frame left at `now`. `busy_ns` is the time that it took to make; `is_answer` where a client waited for it.
    pub(super) fn leave(&mut self, now: Instant, busy_ns: u64, is_answer: bool) {
        self.frames += 1;
        self.busy.saturating_record(busy_ns);
        if let Some(left) = self.left.replace(now) {
            let period = now.saturating_duration_since(left).as_nanos() as u64;
            self.period.saturating_record(period);
        }
        let (Some(pace), Some(due)) = (self.pace, self.due) else {
            return;
        };
        let now = clock::now();
        if is_answer {
            let since = due.max(self.received);
            self.latency.saturating_record(now.saturating_sub(since));
        }
        let lateness = now.saturating_sub(due);
        self.lateness.saturating_record(lateness);
        self.late += u64::from(self.is_late);
        self.missed += u64::from(self.is_late || lateness > pace.period_ns / TOLERANCE);
        let next = due + pace.period_ns;
        // what cannot be made good is left out
        let skipped = now.saturating_sub(next) / pace.period_ns;
        self.skipped += skipped;
        self.due = Some(next + skipped * pace.period_ns);
        self.is_late = false;
    }

    /// What was measured so far.
    pub(super) fn timing(&self) -> Timing {
        Timing {
            frames: self.frames,
            missed: self.missed,
            late: self.late,
            skipped: self.skipped,
            period: percentiles(&self.period),
            lateness: percentiles(&self.lateness),
            // without a pace the daemon answers as soon as it has computed
            latency: percentiles(match self.pace {
                Some(_) => &self.latency,
                None => &self.busy,
            }),
            busy: percentiles(&self.busy),
        }
    }

    /// Forgets what was measured.
    pub(super) fn clear(&mut self) {
        (self.frames, self.missed, self.late, self.skipped) = (0, 0, 0, 0);
        self.left = None;
        for measured in [
            &mut self.period,
            &mut self.lateness,
            &mut self.latency,
            &mut self.busy,
        ] {
            measured.reset();
        }
    }
}

fn percentiles(measured: &Histogram<u64>) -> Percentiles {
    if measured.is_empty() {
        return Percentiles::default();
    }
    let micros = |nanoseconds: u64| nanoseconds as f64 / 1e3;
    Percentiles {
        mean: measured.mean() / 1e3,
        p50: micros(measured.value_at_quantile(0.5)),
        p99: micros(measured.value_at_quantile(0.99)),
        p999: micros(measured.value_at_quantile(0.999)),
        worst: micros(measured.max()),
    }
}

//! How well frames keep their pace, as clients see it.

use serde::{Deserialize, Serialize};

/// Percentiles of a duration, rounded up to 1 % [µs]; all 0 where nothing was measured.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// Of 100 values, 99 are at most this.
    pub p99: f64,
    /// Of 1000 values, 999 are at most this.
    pub p999: f64,
    /// The largest.
    pub worst: f64,
}

/// How frames came since the daemon started, or since somebody asked to count anew.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Frames that a step made.
    pub frames: u64,
    /// Frames that left later than due by more than a tenth of the period, or whose command was late.
    pub missed: u64,
    /// Frames whose command had not come when they were due.
    pub late: u64,
    /// Periods without a frame, since the one before took too long.
    pub skipped: u64,
    /// Time between two frames that follow each other.
    pub period: Percentiles,
    /// From the time at which a frame was due until it left.
    pub lateness: Percentiles,
    /// From a command, or the time at which its frame was due if that is later, until its frame left.
    pub latency: Percentiles,
    /// Time that the daemon computed.
    pub busy: Percentiles,
}

//! How frames keep their pace, as C reads it.

use sim_protocol::{Percentiles, Timing};

use crate::client::ClientHandle;
use crate::pointers::{Output, handle};
use crate::status::{Status, call};

/// Percentiles of a duration, rounded up by at most 1 %; all 0 if nothing was measured [us].
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Durations {
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

/// How frames came, measured by the daemon.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct FrameTiming {
    /// Frames that steps made.
    pub frames: u64,
    /// Frames that left more than a tenth of the period after they were due, or whose command was late.
    pub missed: u64,
    /// Frames whose command had not come when they were due.
    pub late: u64,
    /// Periods without a frame, because the one before took too long.
    pub skipped: u64,
    /// Time between two frames that follow each other.
    pub period: Durations,
    /// From the time at which a frame was due until it left.
    pub lateness: Durations,
    /// From a command, or from the time at which its frame was due if that is later, until its frame left.
    pub latency: Durations,
    /// Time that the daemon computed for a frame.
    pub busy: Durations,
}

impl From<Percentiles> for Durations {
    fn from(said: Percentiles) -> Durations {
        Durations {
            mean: said.mean,
            p50: said.p50,
            p99: said.p99,
            p999: said.p999,
            worst: said.worst,
        }
    }
}

impl From<Timing> for FrameTiming {
    fn from(said: Timing) -> FrameTiming {
        FrameTiming {
            frames: said.frames,
            missed: said.missed,
            late: said.late,
            skipped: said.skipped,
            period: said.period.into(),
            lateness: said.lateness.into(),
            latency: said.latency.into(),
            busy: said.busy.into(),
        }
    }
}

/// How frames came since the daemon started, or since a call had it `restart` the count, which this call does if
/// `restart` is not 0. Without `tightloop serve --realtime`, missed, late and skipped are 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_read_timing(
    client: *mut ClientHandle,
    restart: u8,
    timing: *mut FrameTiming,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let (output, client) = unsafe {
            let output = Output::new(timing, Timing::default().into(), "timing")?;
            (output, handle(client, "client")?)
        };
        let state = client.state()?;
        let said = state.client.timing(restart != 0, &mut || client.poll())?;
        output.set(said.into());
        Ok(())
    })
}

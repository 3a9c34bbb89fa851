//! A loop of 1 kHz: the bare one of two threads, or a client of a daemon that keeps to real time.
//!
//! ```text
//! realtime bare SECONDS          two threads, each of which sleeps until shortly before a frame is due, and spins
//! realtime client NAME SECONDS   a client that steps the daemon NAME
//! ```
//!
//! Prints one line of JSON: frames, missed deadlines, and percentiles of the time from when a frame was due until the
//! controller had it [µs]. A deadline is missed where the frame left more than a tenth of the period after it was due, or where
//! its command was late. `benches/daemon/realtime.py` runs both in turns.

use std::num::NonZeroU64;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rustix::thread::{ClockId, clock_nanosleep_absolute, set_current_timer_slack};
use rustix::time::{Timespec, clock_gettime};
use sim_protocol::{AttachOptions, Client, Command, Values, keep_waiting};

const PERIOD: u64 = 1_000_000;
/// As the client and the daemon do it [ns].
const WAKE_MARGIN: u64 = 100_000;
const SECOND: u64 = 1_000_000_000;
/// Frames before the count begins.
const WARM_UP: u64 = 200;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let said = match words[..] {
        ["bare", seconds] => bare(frames(seconds)),
        ["client", name, seconds] => client(name, frames(seconds)),
        // what `cargo bench` alone asks for
        _ => bare(frames("2")),
    };
    println!("{said}");
}

fn frames(seconds: &str) -> u64 {
    let seconds: u64 = seconds.parse().expect("SECONDS is a whole number");
    seconds * SECOND / PERIOD
}

/// A plant that only counts, on a thread of its own, and a controller that answers at once.
fn bare(frames: u64) -> String {
    let (frame, command) = (AtomicU64::new(0), AtomicU64::new(0));
    let start = now() + SECOND / 10;
    let due = |count: u64| start + count * PERIOD;
    let (mut missed, mut late) = (0, 0);
    let mut latencies = Vec::with_capacity(frames as usize);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            precise();
            for count in 1..=WARM_UP + frames {
                sleep_until(due(count) - WAKE_MARGIN);
                while frame.load(Ordering::Acquire) < count {
                    std::hint::spin_loop();
                }
                let latency = now().saturating_sub(due(count));
                command.store(count + 1, Ordering::Release);
                if count > WARM_UP {
                    latencies.push(latency);
                }
            }
        });
        precise();
        command.store(1, Ordering::Release);
        for count in 1..=WARM_UP + frames {
            sleep_until(due(count) - WAKE_MARGIN);
            while now() < due(count) {
                std::hint::spin_loop();
            }
            let is_late = command.load(Ordering::Acquire) < count;
            let lateness = now() - due(count);
            frame.store(count, Ordering::Release);
            if count > WARM_UP {
                late += u64::from(is_late);
                missed += u64::from(is_late || lateness > PERIOD / 10);
            }
        }
    });
    report(frames, missed, late, &mut latencies)
}

/// A controller that answers at once.
fn client(name: &str, frames: u64) -> String {
    let hook = &mut keep_waiting();
    let client = Client::attach(name, &AttachOptions::default(), hook).expect("the daemon runs");
    let first = client.forward(hook).expect("the daemon answers");
    let positions: Vec<f32> = {
        let view = first.field("joint_q").expect("it is a field");
        view.as_slice::<f32>().expect("the run is in f32").to_vec()
    };
    drop(first);
    let command = Command {
        field: "joint_target_q",
        columns: 0..positions.len(),
        values: Values::F32(&positions),
    };
    let mut latencies = Vec::with_capacity(frames as usize);
    let mut due = 0;
    for count in 0..WARM_UP + frames {
        if count == WARM_UP {
            client.timing(true, hook).expect("the daemon answers");
        }
        let frame = client
            .step(std::slice::from_ref(&command), hook)
            .expect("the daemon answers");
        if count >= WARM_UP {
            latencies.push(now().saturating_sub(due));
        }
        due = frame.header().due_next;
    }
    let timing = client.timing(false, hook).expect("the daemon answers");
    report(timing.frames, timing.missed, timing.late, &mut latencies)
}

fn report(frames: u64, missed: u64, late: u64, latencies: &mut [u64]) -> String {
    latencies.sort_unstable();
    let at = |share: f64| {
        let place = (share * (latencies.len() - 1) as f64).ceil() as usize;
        latencies[place] as f64 / 1e3
    };
    format!(
        "{{\"frames\": {frames}, \"missed\": {missed}, \"late\": {late}, \"p50\": {:.1}, \"p99\": {:.1}, \"p999\": {:.1}, \"worst\": {:.1}}}",
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    )
}

/// Wakes this thread when it asked for it, not up to 50 µs later.
fn precise() {
    set_current_timer_slack(NonZeroU64::new(1)).expect("a thread may choose its slack");
}

fn now() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32).as_nanos() as u64
}

fn sleep_until(at: u64) {
    let time = Timespec {
        tv_sec: (at / SECOND) as i64,
        tv_nsec: (at % SECOND) as i64,
    };
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
}

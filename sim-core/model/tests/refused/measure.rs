//! Time and memory that reading a description takes.

use sim_model::{ModelError, Robot, UrdfOptions};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::{Duration, Instant};

/// Counts the bytes that a thread holds; other threads of the harness do as they please.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    HELD.with(|held| {
        held.set(held.get() + bytes);
        PEAK.with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: all work is the system's allocator's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: by the caller's contract.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: by the caller's contract.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Most memory that reading any file takes [bytes]: a few times the largest file with the most tags and attributes.
pub const MEMORY_MAX: usize = 256 << 20;

/// What came of reading a description, and what it took.
pub struct Reading {
    pub result: Result<Robot, ModelError>,
    /// Time that this thread ran, so that a busy machine does not count.
    pub time: Duration,
    /// Most memory held at a time, over what was held before [bytes].
    pub memory: usize,
}

/// Time that this thread has run, where the system says (Linux).
pub fn time_run() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split(' ').next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// Reads a description and measures.
pub fn measure(read: impl FnOnce() -> Result<Robot, ModelError>) -> Reading {
    let before = HELD.with(Cell::get);
    PEAK.with(|peak| peak.set(before));
    let (start, ran) = (Instant::now(), time_run());
    let result = read();
    let time = match (ran, time_run()) {
        (Some(before), Some(after)) => after - before,
        _ => start.elapsed(),
    };
    // what waits does not run: a pipe would
    assert!(
        start.elapsed() < Duration::from_secs(20),
        "{:?}",
        start.elapsed()
    );
    Reading {
        result,
        time,
        memory: PEAK.with(Cell::get).saturating_sub(before) as usize,
    }
}

/// Reads a text as if from `robot.urdf`; asserts that it took less than a second and the memory of a large file.
#[track_caller]
pub fn read_in_bounds(text: &str) -> Result<Robot, ModelError> {
    let reading = measure(|| Robot::from_urdf_text(text, "robot.urdf", UrdfOptions::default()));
    assert!(reading.time < Duration::from_secs(1), "{:?}", reading.time);
    assert!(reading.memory < MEMORY_MAX, "{} bytes", reading.memory);
    reading.result
}

#[test]
fn the_peak_is_counted() {
    let reading = measure(|| {
        drop(vec![0_u8; 1 << 20]);
        drop(vec![0_u8; 1 << 19]);
        Robot::from_urdf_text("", "robot.urdf", UrdfOptions::default())
    });
    assert!(
        (1 << 20..(1 << 20) + 4096).contains(&reading.memory),
        "{}",
        reading.memory
    );
}

#[test]
fn the_time_is_counted() {
    let reading = measure(|| {
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(200) {}
        Robot::from_urdf_text("", "robot.urdf", UrdfOptions::default())
    });
    // a busy machine leaves a thread less than all of it, but not a twentieth
    assert!(
        reading.time > Duration::from_millis(10),
        "{:?}",
        reading.time
    );
    assert!(
        reading.time < Duration::from_millis(400),
        "{:?}",
        reading.time
    );
}

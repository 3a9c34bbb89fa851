//! The state of the machine, and what every door does first.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Display;
use std::io;

use shuttle::current::try_get_current_task;

use crate::fs::Files;
use crate::iceoryx2::Wires;
use crate::process::Process;
use crate::system::System;

/// Lines of the trace that are kept.
const LINES: usize = 4000;
/// Shorter losses of a core are not noted [ns].
const LOSS_MIN: u64 = 1_000_000;
/// Longest time that passes at a door [ns].
const DOOR_MAX: u64 = 2_000;

thread_local! {
    static WORLD: RefCell<Option<World>> = const { RefCell::new(None) };
}

/// Everything outside of the code under test.
pub(crate) struct World {
    pub(crate) rng: fastrand::Rng,
    /// Of the monotonic clock [ns].
    pub(crate) now: u64,
    /// By the number of their task.
    pub(crate) tasks: Vec<Task>,
    /// By their number.
    pub(crate) processes: BTreeMap<u32, Process>,
    /// Processes so far.
    pub(crate) serials: u64,
    pub(crate) files: Files,
    pub(crate) wires: Wires,
    pub(crate) system: System,
    /// Calls in a million that fail, each.
    pub(crate) failing: u32,
    /// Notifications in a million that are lost.
    pub(crate) dropping: u32,
    /// Doors in a million behind which a thread loses its core for a while.
    pub(crate) preempting: u32,
    /// How long at most, as a power of two [µs].
    pub(crate) longest: u32,
    /// When threads had lost their core for longer than a millisecond: begin and end [ns], and their process.
    pub(crate) losses: Vec<(u64, u64, u32)>,
    /// When processes were stopped at a change: begin and end [ns], and their number.
    pub(crate) halts: Vec<(u64, u64, u32)>,
    /// How far the clock of the calendar is ahead of the monotonic one [ns].
    pub(crate) calendar: i64,
    /// Cores that processes see.
    pub(crate) cores: usize,
    /// Sleepers wake this much later, at most, once in sixteen times [ns].
    pub(crate) lateness: u64,
    pub(crate) steps: u64,
    /// Most steps of a run.
    pub(crate) steps_max: u64,
    /// None unless a trace is wanted.
    pub(crate) trace: Option<VecDeque<String>>,
}

/// A thread.
#[derive(Debug, Clone, Default)]
pub(crate) struct Task {
    /// Its process.
    pub(crate) process: u32,
    /// When it goes on [ns].
    pub(crate) wake: u64,
    /// It was woken before that.
    pub(crate) woken: bool,
}

/// Uses the world. Nothing inside may pass a door.
pub(crate) fn with<R>(call: impl FnOnce(&mut World) -> R) -> R {
    WORLD.with_borrow_mut(|world| {
        let world = world.as_mut().expect("a run is on");
        world.files.clock = world.calendar();
        let before = world.files.changes;
        let result = call(world);
        world.count_changes(world.files.changes - before);
        result
    })
}

/// Uses the world if there is one.
pub(crate) fn try_with(call: impl FnOnce(&mut World)) {
    WORLD.with(|world| {
        if let Ok(mut world) = world.try_borrow_mut()
            && let Some(world) = world.as_mut()
        {
            call(world);
        }
    });
}

/// Begins with another world, and returns the last one.
pub(crate) fn exchange(world: Option<World>) -> Option<World> {
    WORLD.replace(world)
}

/// Whether the caller is a thread of a run that is not being taken down.
pub(crate) fn is_on() -> bool {
    !std::thread::panicking() && try_get_current_task().is_some()
}

/// The number of the calling thread.
pub(crate) fn me() -> usize {
    try_get_current_task().map_or(0, usize::from)
}

/// A door: time passes, and other threads may go on before the caller does.
pub fn step(door: impl Display) {
    if !is_on() {
        return;
    }
    let (is_last, waits) = with(|world| {
        world.steps += 1;
        world.now += world.rng.u64(20..DOOR_MAX);
        world.line(|| door.to_string());
        (world.is_last_door(), world.lose_core())
    });
    if is_last {
        crate::process::exit();
    }
    shuttle::thread::yield_now();
    if waits {
        with(|world| world.task(me()).wake = 0);
    }
}

/// A door whose call may fail as system calls do: out of room or of open files, a signal, a broken disk, no right.
///
/// # Errors
/// One of them, at random.
pub(crate) fn system_call(door: impl Display) -> io::Result<()> {
    step(&door);
    if !is_on() {
        return Ok(());
    }
    with(|world| {
        if world.failing == 0 || world.rng.u32(0..1_000_000) >= world.failing {
            return Ok(());
        }
        // ENOSPC, EMFILE, EIO, EACCES
        let code = [28, 24, 5, 13][world.rng.usize(0..4)];
        world.line(|| format!("{door} fails with {code}"));
        Err(io::Error::from_raw_os_error(code))
    })
}

/// Writes a line into the trace.
pub fn note(line: impl FnOnce() -> String) {
    if try_get_current_task().is_some() && with(|world| world.trace.is_some()) {
        let line = line();
        with(|world| world.line(|| line));
    }
}

/// A random number of the run.
pub fn random() -> u64 {
    with(|world| world.rng.u64(..))
}

impl World {
    pub(crate) fn new(seed: u64) -> World {
        let mut rng = fastrand::Rng::with_seed(seed);
        let (cores, order) = (rng.usize(1..=4), rng.u64(..));
        World {
            rng,
            now: 1_000_000_000,
            tasks: Vec::new(),
            processes: BTreeMap::new(),
            serials: 0,
            files: Files::new(order),
            wires: Wires::default(),
            system: System::new(),
            failing: 0,
            dropping: 0,
            preempting: 0,
            longest: 14,
            losses: Vec::new(),
            halts: Vec::new(),
            calendar: 0,
            cores,
            lateness: 1_000_000,
            steps: 0,
            steps_max: u64::MAX,
            trace: None,
        }
    }

    /// The clock of the calendar [ns].
    pub(crate) fn calendar(&self) -> i64 {
        (self.now as i64).saturating_add(self.calendar)
    }

    pub(crate) fn line(&mut self, line: impl FnOnce() -> String) {
        let task = me();
        let process = self.tasks.get(task).map_or(0, |task| task.process);
        if let Some(trace) = &mut self.trace {
            if trace.len() == LINES {
                trace.pop_front();
            }
            let millis = self.now as f64 / 1e6;
            trace.push_back(format!(
                "{millis:12.3} ms  process {process} thread {task}: {}",
                line()
            ));
        }
    }

    /// Takes the core of the calling thread away for a while, from microseconds on; whether it did.
    fn lose_core(&mut self) -> bool {
        if self.preempting == 0 || self.rng.u32(0..1_000_000) >= self.preempting {
            return false;
        }
        let time = 1000 << self.rng.u32(0..self.longest);
        let until = self.now + self.rng.u64(time..2 * time);
        if time >= LOSS_MIN {
            self.losses.push((self.now, until, self.process()));
        }
        self.task(me()).wake = until;
        true
    }

    pub(crate) fn task(&mut self, task: usize) -> &mut Task {
        if self.tasks.len() <= task {
            self.tasks.resize(task + 1, Task::default());
        }
        &mut self.tasks[task]
    }

    /// When a thread wakes that wants to at that time.
    pub(crate) fn wakes(&mut self, at: u64) -> u64 {
        let late = match self.rng.u32(0..16) {
            0 => self.lateness.max(1),
            _ => 60_000,
        };
        at.saturating_add(self.rng.u64(0..late))
    }
}

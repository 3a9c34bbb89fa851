//! Processes: threads that live and die together.

use std::time::Duration;

use crate::world::{self, World, is_on, me, with};

/// A process, dead ones included until another gets their number.
#[derive(Debug, Clone)]
pub(crate) struct Process {
    /// No other process has it, ever.
    pub(crate) serial: u64,
    pub(crate) parent: u32,
    pub(crate) state: State,
    /// When it came to that [ns].
    pub(crate) since: u64,
    /// Doors that it passes yet.
    pub(crate) doors: u64,
    /// Changes that it makes yet.
    pub(crate) changes: u64,
    /// It is stopped behind them for so long, and not killed [ns].
    pub(crate) halt: Option<u64>,
    /// When it goes on, if it is stopped for a time [ns].
    pub(crate) until: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    Running,
    Stopped,
    Dead,
}

/// The number of the first process that a run makes.
const FIRST: u32 = 100;

impl World {
    /// When a thread may go on; never if its process does not [ns].
    pub(crate) fn wake(&self, task: usize) -> Option<u64> {
        let (process, wake) =
            (self.tasks.get(task)).map_or((0, 0), |task| (task.process, task.wake));
        match self.processes.get(&process) {
            Some(process) if process.state == State::Running => Some(wake),
            Some(process) if process.state == State::Stopped && process.until < u64::MAX => {
                Some(wake.max(process.until))
            }
            Some(_) => None,
            None => Some(wake),
        }
    }

    /// A thread goes on, and its process with it.
    pub(crate) fn goes_on(&mut self, task: usize) {
        let process = self.tasks.get(task).map_or(0, |task| task.process);
        if let Some(process) = self.processes.get_mut(&process)
            && process.state == State::Stopped
        {
            (process.state, process.since) = (State::Running, self.now);
            process.until = u64::MAX;
        }
    }

    pub(crate) fn is_alive(&self, pid: u32) -> bool {
        pid == 0
            || self
                .processes
                .get(&pid)
                .is_some_and(|process| process.state != State::Dead)
    }

    /// The process of the calling thread; 0 is the test's own.
    pub(crate) fn process(&self) -> u32 {
        self.tasks.get(me()).map_or(0, |task| task.process)
    }

    /// Counts a door of the calling process; whether it is killed there.
    pub(crate) fn is_last_door(&mut self) -> bool {
        let pid = self.process();
        self.processes.get_mut(&pid).is_some_and(|process| {
            process.doors -= 1;
            process.doors == 0
        })
    }

    /// Counts changes of the calling process. Behind the last one it is stopped, or killed at the next door.
    pub(crate) fn count_changes(&mut self, changes: u64) {
        if changes == 0 {
            return;
        }
        let pid = self.process();
        if let Some(process) = self.processes.get_mut(&pid) {
            process.changes = process.changes.saturating_sub(changes);
            if process.changes == 0 {
                process.changes = u64::MAX;
                match process.halt.take() {
                    None => process.doors = process.doors.min(1),
                    Some(time) if process.state == State::Running => {
                        (process.state, process.since) = (State::Stopped, self.now);
                        process.until = self.now + time;
                        self.halts.push((self.now, self.now + time, pid));
                    }
                    Some(_) => {}
                }
            }
        }
    }

    fn serial(&self, pid: u32) -> u64 {
        self.processes.get(&pid).map_or(0, |process| process.serial)
    }

    fn number(&mut self) -> u32 {
        let dead: Vec<u32> = self
            .processes
            .iter()
            .filter(|(_, process)| process.state == State::Dead)
            .map(|(pid, _)| *pid)
            .collect();
        // a number may be used again at once
        if !dead.is_empty() && self.rng.bool() {
            return dead[self.rng.usize(0..dead.len())];
        }
        self.processes
            .last_key_value()
            .map_or(FIRST, |(pid, _)| pid + 1)
    }
}

/// The number of the calling process.
pub fn id() -> u32 {
    match is_on() {
        true => with(|world| world.process()),
        false => 0,
    }
}

/// A process, also once another one has its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Handle {
    /// Its number.
    pub pid: u32,
    serial: u64,
}

impl Handle {
    /// The calling process.
    pub fn this() -> Handle {
        let pid = id();
        Handle::with_number(pid)
    }

    fn with_number(pid: u32) -> Handle {
        let serial = with(|world| world.serial(pid));
        Handle { pid, serial }
    }

    /// Whether it lives, stopped or not.
    pub fn is_alive(self) -> bool {
        with(|world| world.is_alive(self.pid) && world.serial(self.pid) == self.serial)
    }

    /// Kills it.
    pub fn kill(self) {
        if self.is_alive() {
            kill(self.pid);
        }
    }

    /// Kills it at the door that it passes after so many others, one or more.
    pub fn kill_at_door(self, doors: u64) {
        self.doom(doors, u64::MAX);
    }

    /// Kills it right after so many changes that others can see, one or more: of files, or of who is at the transport.
    pub fn kill_at_change(self, changes: u64) {
        self.doom(u64::MAX, changes);
    }

    /// Stops it right after so many of them, for a time.
    pub fn stop_at_change(self, changes: u64, time: Duration) {
        self.doom(u64::MAX, changes);
        self.change(|process| process.halt = Some(time.as_nanos() as u64));
    }

    fn doom(self, doors: u64, changes: u64) {
        self.change(|process| {
            (process.doors, process.changes, process.halt) = (doors, changes, None);
        });
    }

    fn change(self, call: impl FnOnce(&mut Process)) {
        if self.is_alive() {
            with(|world| world.processes.get_mut(&self.pid).map(call));
        }
    }

    /// Stops it until [`Handle::resume`].
    pub fn stop(self) {
        if self.is_alive() {
            stop(self.pid);
        }
    }

    /// Lets it go on.
    pub fn resume(self) {
        if self.is_alive() {
            resume(self.pid);
        }
    }
}

/// As [`start`], and returns the number alone.
pub fn spawn(main: impl FnOnce() + Send + 'static) -> u32 {
    start(main).pid
}

/// Starts a process, a child of the calling one, whose first thread calls `main`; it exits when that returns.
pub fn start(main: impl FnOnce() + Send + 'static) -> Handle {
    let handle = with(|world| {
        let (pid, parent) = (world.number(), world.process());
        world.serials += 1;
        let (serial, state) = (world.serials, State::Running);
        let (since, doors, changes) = (world.now, u64::MAX, u64::MAX);
        world.processes.insert(
            pid,
            Process {
                serial,
                parent,
                state,
                since,
                doors,
                changes,
                halt: None,
                until: u64::MAX,
            },
        );
        world.line(|| format!("starts process {pid}"));
        Handle { pid, serial }
    });
    crate::thread::begin(handle, move || {
        main();
        exit();
    });
    handle
}

/// Ends the calling process, whatever its other threads do.
pub fn exit() -> ! {
    kill(id());
    loop {
        crate::thread::block(u64::MAX);
    }
}

/// Kills a process: no thread of it goes on, and what the system keeps for it is let go of.
pub fn kill(pid: u32) {
    with(|world| {
        let Some(process) = world.processes.get_mut(&pid) else {
            return;
        };
        if process.state == State::Dead {
            return;
        }
        (process.state, process.since) = (State::Dead, world.now);
        // threads stay where they are; one with the same number must not bring them back
        for task in &mut world.tasks {
            if task.process == pid {
                (task.process, task.wake) = (u32::MAX, u64::MAX);
            }
        }
        world.files.release(pid);
        world.wires.release(pid);
        world.system.release(pid);
        world.line(|| format!("process {pid} is dead"));
    });
    if is_on() && id() == u32::MAX {
        crate::thread::block(u64::MAX);
    }
}

/// Stops a process until [`resume`].
pub fn stop(pid: u32) {
    change(pid, State::Running, State::Stopped);
    world::step("stops a process");
}

/// Lets a stopped process go on.
pub fn resume(pid: u32) {
    change(pid, State::Stopped, State::Running);
}

fn change(pid: u32, from: State, to: State) {
    with(|world| {
        if let Some(process) = world.processes.get_mut(&pid)
            && process.state == from
        {
            (process.state, process.since) = (to, world.now);
            process.until = u64::MAX;
            world.line(|| format!("process {pid} is {to:?}"));
        }
    });
}

/// Whether a process lives, stopped ones included.
pub fn is_alive(pid: u32) -> bool {
    with(|world| world.is_alive(pid))
}

/// When processes were stopped at a change: begin, end and number.
pub fn halts() -> Vec<(u64, u64, u32)> {
    with(|world| world.halts.clone())
}

/// When threads had lost their core: begin and end [ns], and their process.
pub fn losses() -> Vec<(u64, u64, u32)> {
    with(|world| world.losses.clone())
}

/// Since when the process of this number has been dead [ns].
pub fn dead_since(pid: u32) -> Option<u64> {
    since(pid, State::Dead)
}

/// Since when the process of this number has been stopped [ns].
pub fn stopped_since(pid: u32) -> Option<u64> {
    since(pid, State::Stopped)
}

fn since(pid: u32, state: State) -> Option<u64> {
    with(|world| {
        let process = world.processes.get(&pid);
        process
            .filter(|process| process.state == state)
            .map(|process| process.since)
    })
}

/// The processes that live.
pub fn living() -> Vec<u32> {
    with(|world| {
        world
            .processes
            .keys()
            .copied()
            .filter(|pid| world.is_alive(*pid))
            .collect()
    })
}

/// The parent of the calling process; 1 once that is dead.
pub fn parent() -> u32 {
    with(|world| {
        let parent = world
            .processes
            .get(&world.process())
            .map_or(0, |process| process.parent);
        if parent == 0 || world.is_alive(parent) {
            parent
        } else {
            1
        }
    })
}

//! A machine that exists in a test: its processes, threads, clock, files and transport follow a seed.
//!
//! Code under test reaches all of these by doors that have the names of the standard library, of `sim_system` and of iceoryx2.
//! Here the same names are a simulator: one thread of a process runs at a time, and at every door another one may go on. The
//! seed decides which, how late a sleeper wakes, and which call fails. So a run with the same seed is the same run.
//!
//! Threads are tasks of shuttle, scheduled by [`scheduler`]: it knows who sleeps until when, and moves the clock when nobody
//! else can go on.

mod run;
mod scheduler;
mod world;

pub mod fs;
pub mod iceoryx2;
pub mod memory;
pub mod process;
pub mod sync;
pub mod system;
pub mod thread;
pub mod time;

pub use shuttle::thread_local;

pub use iceoryx2::overwritten;
pub use run::{Outcome, Run, at, calm};
pub use world::{note, random, step};

//! The process that keeps the worlds: it reads a scene, builds a simulation, and serves it to clients until stopped. It also tells what a
//! robot file means.
//!
//! [`serve`] is the whole command line as one function, so that a Python wheel can carry it.

mod cli;
pub mod config;
mod devices;
mod error;
mod export;
mod faults;
mod groups;
mod inspect;
pub mod look;
mod news;
mod recording;
mod server;
mod session;
mod snapshot;
mod watchdog;

use std::ffi::OsString;

pub use error::DaemonError;

/// Runs the command line `args` (the program's name first) and returns its exit code: 0 done, 1 failed, 2 misused.
///
/// Where a driver was given up and compiles yet, it ends the process with that code itself.
pub fn serve(args: impl IntoIterator<Item = OsString>) -> i32 {
    let code = cli::run(args);
    sim_engine::options::leave(code);
    code
}

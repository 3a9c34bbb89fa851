//! The process that keeps the worlds: it reads a scene, builds a simulation, and serves it to clients until stopped. It also reports
//! what a robot file means.
//!
//! [`serve`] is the whole command line as one function, so that a Python wheel can carry it.

mod advice;
mod bench;
mod cli;
mod commands;
pub mod config;
mod devices;
pub mod environment;
mod error;
mod export;
mod inspect;
mod list;
pub mod observe;
mod output;
mod printer;
mod recording;
mod serve;
mod terminal;
mod top;

use std::ffi::OsString;

use sim_physics::arrays::Field;
use sim_physics::constants::params::Param;

pub use error::DaemonError;

/// Runs the command line `args` (the program's name first) and returns its exit code: 0 done, 1 failed, 2 misused.
///
/// If a driver thread is still compiling then, it ends the process with that code itself.
pub fn serve(args: impl IntoIterator<Item = OsString>) -> i32 {
    keep_meshes();
    let code = commands::run(args);
    sim_engine::options::leave(code);
    code
}

/// Keeps compiled meshes in the user's cache folder from now on; a process needs it once.
pub fn keep_meshes() {
    sim_model::geometry::keep_meshes(sim_engine::options::cache_folder);
}

/// Names of all fields that frames may carry.
pub fn field_names() -> Vec<&'static str> {
    Field::ALL.iter().map(|field| field.row().name).collect()
}

/// Names of all parameters that may vary between worlds.
pub fn param_names() -> Vec<&'static str> {
    Param::ALL.iter().map(|param| param.row().name).collect()
}

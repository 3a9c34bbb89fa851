//! The process that keeps the worlds: it reads a scene, builds a simulation, and serves it to clients until stopped. It also reports
//! what a robot file means.
//!
//! [`serve`] is the whole command line as one function, so that a Python wheel can carry it.

mod advice;
mod bench;
mod cli;
mod commands;
mod compile;
pub mod config;
mod devices;
pub mod environment;
mod error;
mod export;
mod eyes;
mod inspect;
mod list;
pub mod observe;
mod output;
#[doc(hidden)] // for tests, which give it any bytes
pub mod outside;
mod perf_map;
mod printer;
mod recording;
mod serve;
mod terminal;
mod top;

use std::ffi::OsString;

use sim_engine::backend::Input;
use sim_physics::arrays::{Field, Takes};
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

/// A command, as a client of any scene knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandRow {
    /// Its name.
    pub name: &'static str,
    /// What its columns are of, such as "dofs".
    pub axis: String,
    /// Columns of each entry of that axis.
    pub parts: usize,
    /// Unit; "–" for none.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Whether it takes 0 and 1 alone.
    pub is_switch: bool,
    /// Whether `write` sets it, too.
    pub is_written: bool,
    /// Whether it is a parameter, which acts where the launch names it.
    pub is_param: bool,
}

/// Every command of a step, in the order of their table.
pub fn command_rows() -> Vec<CommandRow> {
    let rows = Input::commands().map(|input| {
        let (axis, parts) = input.axis();
        let (unit, doc) = match input {
            Input::Field(field) => (field.row().unit, field.row().doc),
            Input::Param(param) => (param.row().unit, param.row().doc),
        };
        CommandRow {
            name: input.name(),
            axis: axis.name(),
            parts,
            unit,
            doc,
            is_switch: input.kept().map(|command| command.takes) == Some(Takes::Switches),
            is_written: matches!(input, Input::Field(field) if field.is_written()),
            is_param: matches!(input, Input::Param(_)),
        }
    });
    rows.collect()
}

/// What the columns of an input are of, such as "dofs", and how many each entry of that axis has; none of an output.
pub fn input_axis(name: &str) -> Option<(String, usize)> {
    let input = Input::named(name)?;
    let is_output = |field: Field| !field.is_written() && field.row().command.is_none();
    if matches!(input, Input::Field(field) if is_output(field)) {
        return None;
    }
    let (axis, parts) = input.axis();
    Some((axis.name(), parts))
}

/// Names of all parameters that may vary between worlds.
pub fn param_names() -> Vec<&'static str> {
    Param::ALL.iter().map(|param| param.row().name).collect()
}

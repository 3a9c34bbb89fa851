//! Runs a command line: each command is in a module of its own.

use std::ffi::OsString;
use std::io::Write;

use sim_protocol::{AttachOptions, keep_waiting};
use sim_system::signals;

use crate::cli::{self, CliCommand};
use crate::error::DaemonError;
use crate::terminal::printable;
use crate::{bench, compile, devices, inspect, list, recording, serve, top};

/// Runs a command line; the exit code is 0 done, 1 failed, 2 misused.
pub(crate) fn run(args: impl IntoIterator<Item = OsString>) -> i32 {
    let command = match cli::parse(args) {
        Ok(command) => command,
        Err(code) => return code,
    };
    signals::survive_full_files();
    let result = match &command {
        CliCommand::Serve(args) => serve::run(args),
        CliCommand::Inspect(args) => inspect::run(args),
        CliCommand::Bench(args) => bench::run(args),
        CliCommand::Compile(args) => compile::run(args),
        CliCommand::Record(args) => recording::record(args),
        CliCommand::Replay(args) => recording::replay(args),
        CliCommand::Devices => devices::run(),
        CliCommand::List { names, json } => list::run(*names, *json),
        CliCommand::Top(args) => top::run(args),
        CliCommand::Stop { name } => stop(name),
        CliCommand::Python(command) => command.run(),
        CliCommand::Completions { shell } => cli::completions(*shell),
        CliCommand::Man { folder } => cli::man(folder.as_deref()),
    };
    match result {
        Ok(()) => 0,
        Err(error) => {
            // a daemon has written it, without waiting for its reader
            if !matches!(&command, CliCommand::Serve(_)) {
                let said = format!("tightloop: {error}");
                let _ = writeln!(std::io::stderr(), "{}", printable(&said));
            }
            error.exit_code()
        }
    }
}

fn stop(name: &str) -> Result<(), DaemonError> {
    sim_protocol::stop(name, &AttachOptions::default(), &mut keep_waiting())?;
    Ok(())
}

//! What the command line says of itself to shells and to `man`.

use std::io::Write;
use std::path::Path;

use clap::{Command, ValueEnum};

use crate::error::DaemonError;

/// A shell that completes command lines.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Shell {
    Bash,
    Zsh,
    Fish,
}

/// Prints the completions of a shell.
pub(super) fn completions(mut command: Command, shell: Shell) -> Result<(), DaemonError> {
    let shell = match shell {
        Shell::Bash => clap_complete::Shell::Bash,
        Shell::Zsh => clap_complete::Shell::Zsh,
        Shell::Fish => clap_complete::Shell::Fish,
    };
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "tightloop", &mut script);
    // whoever reads it may stop reading
    let _ = std::io::stdout().write_all(&script);
    Ok(())
}

/// Prints the manual page of the program, or writes it and those of its commands into a folder.
///
/// # Errors
/// A folder that cannot be made or written.
pub(super) fn man(command: Command, folder: Option<&Path>) -> Result<(), DaemonError> {
    // `help` explains the others, and has no page of its own
    let command = command.disable_help_subcommand(true);
    let Some(folder) = folder else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command)
            .render(&mut page)
            .expect("memory takes every page");
        let _ = std::io::stdout().write_all(&page);
        return Ok(());
    };
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(command, folder))
        .map_err(|error| DaemonError::Pages {
            folder: folder.to_owned(),
            problem: error.to_string(),
        })
}

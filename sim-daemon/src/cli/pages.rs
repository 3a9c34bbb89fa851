//! What the command line says of itself to shells and to `man`.

use std::fs;
use std::path::Path;

use clap::{Command, ValueEnum};

use crate::error::DaemonError;
use crate::output;

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
    output::print(&script).map_err(DaemonError::stdout)
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
        return output::print(&page).map_err(DaemonError::stdout);
    };
    write_pages(command, folder).map_err(|error| DaemonError::Pages {
        folder: folder.to_owned(),
        problem: error.to_string(),
    })
}

/// Writes all pages beside their places, and renames them once all are complete.
fn write_pages(command: Command, folder: &Path) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let part = output::beside(&folder.join("pages"));
    fs::create_dir(&part)?;
    let rename = |entry: fs::DirEntry| fs::rename(entry.path(), folder.join(entry.file_name()));
    let written = clap_mangen::generate_to(command, &part)
        .and_then(|()| fs::read_dir(&part)?.try_for_each(|entry| rename(entry?)));
    let _ = fs::remove_dir_all(&part);
    written
}

//! News for people: to a log file, or to stderr. Results go to stdout, and only there.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use crate::error::DaemonError;

/// Where news go.
#[derive(Debug)]
pub(crate) enum News {
    /// Nobody reads them.
    Nowhere,
    /// The terminal.
    Stderr,
    /// A log file.
    Log(File),
}

impl News {
    /// A log file if one is given; else stderr, unless another program launched us and did not ask.
    pub(crate) fn open(log: Option<&Path>, launched: bool) -> Result<News, DaemonError> {
        match log {
            None if launched => Ok(News::Nowhere),
            None => Ok(News::Stderr),
            Some(path) => OpenOptions::new()
                .append(true)
                .create(true)
                .mode(0o600)
                .open(path)
                .map(News::Log)
                .map_err(|error| DaemonError::Log {
                    path: path.to_owned(),
                    problem: error.to_string(),
                }),
        }
    }

    /// Tells one line. A line that cannot be written is not worth an error.
    pub(crate) fn tell(&mut self, line: &str) {
        let _ = match self {
            News::Nowhere => Ok(()),
            News::Stderr => writeln!(std::io::stderr(), "tightloop: {line}"),
            News::Log(file) => writeln!(file, "{line}"),
        };
    }
}

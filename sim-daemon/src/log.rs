//! Messages for people: to a log file, or to stderr. Results go to stdout, and only there.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;

use crate::error::DaemonError;

/// Where messages go, and what stands before them. Several threads may write: a line is written at once.
#[derive(Debug, Clone)]
pub(crate) struct Log {
    target: Target,
    /// Before each line.
    prefix: String,
}

#[derive(Debug, Clone)]
enum Target {
    /// Nobody reads them.
    Discard,
    /// The terminal.
    Stderr,
    /// A log file.
    File(Arc<File>),
}

impl Log {
    /// A log file if one is given; else stderr, unless another program launched us and did not ask.
    pub(crate) fn open(log: Option<&Path>, launched: bool) -> Result<Log, DaemonError> {
        let target = match log {
            None if launched => Target::Discard,
            None => Target::Stderr,
            Some(path) => {
                let opened = OpenOptions::new()
                    .append(true)
                    .create(true)
                    .mode(0o600)
                    .open(path);
                Target::File(Arc::new(opened.map_err(|error| DaemonError::Log {
                    path: path.to_owned(),
                    problem: error.to_string(),
                })?))
            }
        };
        let prefix = String::new();
        Ok(Log { target, prefix })
    }

    /// The same for a group of worlds.
    pub(crate) fn for_group(&self, group: usize) -> Log {
        Log {
            target: self.target.clone(),
            prefix: format!("group {group}: "),
        }
    }

    /// Writes one line. A line that cannot be written is not worth an error.
    pub(crate) fn write(&mut self, line: &str) {
        let line = format!("{}{line}\n", self.prefix);
        let _ = match &self.target {
            Target::Discard => Ok(()),
            Target::Stderr => std::io::stderr().write_all(format!("tightloop: {line}").as_bytes()),
            Target::File(file) => (&**file).write_all(line.as_bytes()),
        };
    }
}

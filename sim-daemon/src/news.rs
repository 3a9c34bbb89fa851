//! News for people: to a log file, or to stderr. Results go to stdout, and only there.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;

use crate::error::DaemonError;

/// Where news go, and what they are of. Several threads may tell: a line is written at once.
#[derive(Debug, Clone)]
pub(crate) struct News {
    to: To,
    /// Before each line.
    of: String,
}

#[derive(Debug, Clone)]
enum To {
    /// Nobody reads them.
    Nowhere,
    /// The terminal.
    Stderr,
    /// A log file.
    Log(Arc<File>),
}

impl News {
    /// A log file if one is given; else stderr, unless another program launched us and did not ask.
    pub(crate) fn open(log: Option<&Path>, launched: bool) -> Result<News, DaemonError> {
        let to = match log {
            None if launched => To::Nowhere,
            None => To::Stderr,
            Some(path) => {
                let opened = OpenOptions::new()
                    .append(true)
                    .create(true)
                    .mode(0o600)
                    .open(path);
                To::Log(Arc::new(opened.map_err(|error| DaemonError::Log {
                    path: path.to_owned(),
                    problem: error.to_string(),
                })?))
            }
        };
        let of = String::new();
        Ok(News { to, of })
    }

    /// The same, of a group of worlds.
    pub(crate) fn of_group(&self, group: usize) -> News {
        News {
            to: self.to.clone(),
            of: format!("group {group}: "),
        }
    }

    /// Tells one line. A line that cannot be written is not worth an error.
    pub(crate) fn tell(&mut self, line: &str) {
        let line = format!("{}{line}\n", self.of);
        let _ = match &self.to {
            To::Nowhere => Ok(()),
            To::Stderr => std::io::stderr().write_all(format!("tightloop: {line}").as_bytes()),
            To::Log(file) => (&**file).write_all(line.as_bytes()),
        };
    }
}

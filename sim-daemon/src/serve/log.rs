//! Messages for people: to a log file, or to stderr. Results go to stdout, and only there.
//!
//! A thread of their own writes them all ([`Printer`]): a step never waits for a reader.

use std::fs::OpenOptions;
use std::path::Path;

use sim_system::files::make_private;

use crate::error::DaemonError;
use crate::output;
use crate::printer::{self, Printer};

/// The standard streams of a daemon. Dropping them waits, for a limited time, until all is written.
#[derive(Debug)]
pub(crate) struct Streams {
    pub(crate) stdout: Printer,
    pub(crate) stderr: Printer,
}

impl Streams {
    /// Starts writing to both. From here on, panics are reported through the same threads.
    pub(crate) fn open() -> Result<Streams, DaemonError> {
        let streams = Streams {
            stdout: Printer::stdout()?,
            stderr: Printer::stderr()?,
        };
        let stderr = streams.stderr.clone();
        std::panic::set_hook(Box::new(move |info| {
            let thread = std::thread::current();
            let name = thread.name().unwrap_or("unnamed");
            let backtrace = std::backtrace::Backtrace::capture();
            stderr.print(format!("thread '{name}' {info}\n{backtrace}\n"));
        }));
        Ok(streams)
    }

    /// Says on stderr why the daemon ends.
    pub(crate) fn complain(&self, error: &DaemonError) {
        self.stderr.print(format!("tightloop: {error}\n"));
    }
}

impl Drop for Streams {
    fn drop(&mut self) {
        printer::flush([&self.stdout, &self.stderr]);
    }
}

/// Where messages go, and what stands before them. Several threads may write: a line is written at once.
#[derive(Debug, Clone)]
pub(crate) struct Log {
    /// None: nobody reads them.
    printer: Option<Printer>,
    /// Before each line.
    prefix: String,
}

impl Log {
    /// A log file if one is given; else stderr, unless another program launched us and did not ask.
    pub(crate) fn open(
        log: Option<&Path>,
        launched: bool,
        stderr: &Printer,
    ) -> Result<Log, DaemonError> {
        let (printer, prefix) = match log {
            None if launched => (None, ""),
            None => (Some(stderr.clone()), "tightloop: "),
            Some(path) => {
                let mut options = OpenOptions::new();
                make_private(options.append(true).create(true));
                let file = output::open(path, &mut options).map_err(|error| DaemonError::Log {
                    path: path.to_owned(),
                    problem: error.to_string(),
                })?;
                (Some(Printer::start(file)?), "")
            }
        };
        let prefix = prefix.to_owned();
        Ok(Log { printer, prefix })
    }

    /// The same for a group of worlds.
    pub(crate) fn for_group(&self, group: usize) -> Log {
        Log {
            printer: self.printer.clone(),
            prefix: format!("{}group {group}: ", self.prefix),
        }
    }

    /// Hands one line over. A line that cannot be written is not worth an error.
    pub(crate) fn write(&self, line: &str) {
        if let Some(printer) = &self.printer {
            printer.print(format!("{}{line}\n", self.prefix));
        }
    }

    /// Waits, for a limited time, until all is written.
    pub(crate) fn flush(&self) {
        printer::flush(&self.printer);
    }
}

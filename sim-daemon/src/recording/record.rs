//! `tightloop record`: what a daemon does, from its journal into a file.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, IsTerminal, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use sim_protocol::{
    AttachOptions, Client, Description, Journal, JournalEntry, ProtocolError, keep_waiting,
};

use super::blocks::BLOCK_MAX;
use super::failure::failed;
use super::records::{Record, RecordedCommand};
use super::writer::{Stopped, Writer};
use crate::cli;
use crate::error::DaemonError;

/// Entries are waited for so long before anything else is looked at.
const LOOK: Duration = Duration::from_millis(20);
/// At the end, the last entry may be under way for so long.
const LATE: Duration = Duration::from_millis(20);
/// A terminal shows the progress this often.
const PROGRESS_PERIOD: Duration = Duration::from_millis(500);

/// What became of a recording.
#[derive(Debug, Default)]
struct Tally {
    frames: u64,
    gaps: u64,
    /// Frames before the first of them.
    whole: u64,
    lost: u64,
}

/// Why a recording ends.
enum End {
    /// As asked, or with the daemon: one sentence.
    Done(String),
    /// The file can no longer be written.
    Stopped,
    /// What comes cannot be recorded.
    Failed(DaemonError),
}

impl From<Stopped> for End {
    fn from(_: Stopped) -> End {
        End::Stopped
    }
}

/// Runs the command. Prints one line to stdout at the end.
pub(crate) fn run(args: &cli::Record) -> Result<(), DaemonError> {
    check(args)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT, SIGHUP] {
        catch(signal, &stop)?;
    }
    // a file that may not grow is an error to report, no reason to be killed
    catch(SIGXFSZ, &Arc::new(AtomicBool::new(false)))?;
    let mut hook = || match stop.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let client = Client::attach(&args.name, &AttachOptions::default(), &mut hook)?;
    follow(&client, args, &stop)
}

/// Records what the daemon of a client does, until something ends it.
pub(crate) fn follow(
    client: &Client,
    args: &cli::Record,
    stop: &AtomicBool,
) -> Result<(), DaemonError> {
    let mut hook = || match stop.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let fields: Vec<String> = args
        .fields
        .iter()
        .map(|name| name.trim().to_owned())
        .filter(|name| !name.is_empty())
        .collect();
    let journal = client.journal(&fields, &mut hook)?;
    let file = create(args)?;
    let description = client.description();
    let writer = Writer::start(file, frame_bytes(description)).map_err(|error| {
        let problem = error.to_string();
        DaemonError::System {
            action: "start a thread",
            problem,
        }
    })?;
    let mut recorder = Recorder {
        args,
        stop,
        journal,
        writer,
        state: Vec::new(),
        tally: Tally::default(),
        has_begun: false,
        started: Instant::now(),
        reported: Instant::now(),
    };
    let end = recorder.run(description, &fields);
    recorder.close(end)
}

fn check(args: &cli::Record) -> Result<(), DaemonError> {
    let wrong = |argument, value: String, problem: &str| {
        Err(DaemonError::Argument {
            argument,
            value,
            problem: problem.to_owned(),
        })
    };
    if args.frames == Some(0) {
        return wrong(
            "frames",
            "0".to_owned(),
            "ask for at least 1, or leave it out",
        );
    }
    if let Some(seconds) = args.seconds
        && !(seconds > 0.0 && seconds.is_finite())
    {
        return wrong(
            "seconds",
            seconds.to_string(),
            "ask for more than 0, or leave it out",
        );
    }
    // before anything is asked of the daemon
    if !args.force && args.out.exists() {
        return Err(is_there(&args.out));
    }
    Ok(())
}

fn is_there(path: &Path) -> DaemonError {
    failed(
        path,
        "is there already; choose another name, or overwrite it with --force",
    )
}

fn catch(signal: i32, flag: &Arc<AtomicBool>) -> Result<(), DaemonError> {
    match signal_hook::flag::register(signal, Arc::clone(flag)) {
        Ok(_) => Ok(()),
        Err(error) => Err(DaemonError::System {
            action: "handle signals",
            problem: error.to_string(),
        }),
    }
}

fn create(args: &cli::Record) -> Result<File, DaemonError> {
    let mut options = OpenOptions::new();
    options.write(true);
    match args.force {
        true => options.create(true).truncate(true),
        false => options.create_new(true),
    };
    options.open(&args.out).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => is_there(&args.out),
        ErrorKind::NotFound => failed(&args.out, "its folder is not there; make it first"),
        _ => failed(&args.out, format!("cannot be made: {error}")),
    })
}

/// Bytes of a frame's arrays: no entry is much larger.
fn frame_bytes(description: &Description) -> usize {
    let arrays = description.fields.iter();
    arrays
        .map(|field| field.shape.iter().product::<usize>() * field.dtype.size())
        .sum()
}

/// A recording at work.
struct Recorder<'a> {
    args: &'a cli::Record,
    stop: &'a AtomicBool,
    journal: Journal,
    writer: Writer,
    /// The part of a state that has come.
    state: Vec<u8>,
    tally: Tally,
    has_begun: bool,
    started: Instant,
    reported: Instant,
}

impl Recorder<'_> {
    /// Records until something ends it.
    fn run(&mut self, description: &Description, fields: &[String]) -> End {
        match self.go(description, fields) {
            Err(end) => end,
            Ok(never) => match never {},
        }
    }

    fn go(
        &mut self,
        description: &Description,
        fields: &[String],
    ) -> Result<std::convert::Infallible, End> {
        let head = serde_json::json!({ "daemon": description, "observed": fields }).to_string();
        self.writer.put(&Record::Head(head.as_bytes()))?;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                self.take_what_waits()?;
                return Err(End::Done("stopped by a signal".to_owned()));
            }
            if self.args.frames == Some(self.tally.frames) {
                return Err(End::Done("as many frames as asked".to_owned()));
            }
            let seconds = self.args.seconds;
            if seconds.is_some_and(|seconds| self.started.elapsed().as_secs_f64() >= seconds) {
                self.take_what_waits()?;
                return Err(End::Done("as many seconds as asked".to_owned()));
            }
            match self.journal.next(LOOK, &mut keep_waiting()) {
                Ok(Some(entry)) => self.take(&entry)?,
                Ok(None) => {}
                Err(
                    error @ (ProtocolError::DaemonLost { .. }
                    | ProtocolError::DaemonRestarted { .. }),
                ) if self.has_begun => {
                    return Err(End::Done(error.to_string()));
                }
                Err(error) => return Err(End::Failed(error.into())),
            }
            self.writer.flush_old()?;
            self.report_progress();
        }
    }

    /// What was done before the end is recorded, though it may still wait in the journal: no more than fits there.
    fn take_what_waits(&mut self) -> Result<(), End> {
        for _ in 0..self.journal.depth() {
            if self.args.frames == Some(self.tally.frames) {
                break;
            }
            let Ok(Some(entry)) = self.journal.next(LATE, &mut keep_waiting()) else {
                break; // nothing waits any more; that the daemon has ended, too, changes nothing
            };
            self.take(&entry)?;
        }
        Ok(())
    }

    fn take(&mut self, entry: &JournalEntry) -> Result<(), End> {
        let header = entry.header();
        if entry.lost > 0 {
            self.state.clear();
            if self.tally.gaps == 0 {
                self.tally.whole = self.tally.frames;
            }
            self.tally.gaps += 1;
            self.tally.lost += entry.lost;
            self.log(&format!(
                "after frame {} a gap: {} entries were lost, the recorder was too slow",
                self.tally.frames, entry.lost
            ));
            self.writer.put(&Record::Gap(entry.lost))?;
        }
        if header.is_state() {
            return self.take_state(entry);
        }
        if header.is_end() {
            let reason = entry.reason();
            return Err(match self.has_begun {
                true => End::Done(reason),
                false => End::Failed(failed(&self.args.out, reason)),
            });
        }
        self.writer.put(&Record::Command(RecordedCommand {
            op: header.op,
            rows: header.rows,
            words: entry.command(),
            digests: entry.digests(),
            observed: entry.observed(),
        }))?;
        self.tally.frames += u64::from(header.digests > 0);
        Ok(())
    }

    /// Puts the pieces of a state together.
    fn take_state(&mut self, entry: &JournalEntry) -> Result<(), End> {
        let header = entry.header();
        if header.bytes as usize > BLOCK_MAX / 2 {
            let problem = format!(
                "a state of all worlds has {} MB, a recording takes {}; use fewer worlds",
                header.bytes >> 20,
                BLOCK_MAX >> 21
            );
            return Err(End::Failed(failed(&self.args.out, problem)));
        }
        // the rest of one that began in a gap is of no use
        if header.first != self.state.len() as u64 {
            return Ok(());
        }
        self.state.extend(entry.piece());
        if self.state.len() as u64 == header.bytes {
            self.writer.put(&Record::State(&self.state))?;
            self.state.clear();
            if !self.has_begun {
                self.has_begun = true;
                self.log(&format!(
                    "recording {} into {}",
                    self.args.name,
                    self.args.out.display()
                ));
            }
        }
        Ok(())
    }

    /// Ends the file, and reports what is in it.
    fn close(mut self, end: End) -> Result<(), DaemonError> {
        let why = match &end {
            End::Done(why) => why.clone(),
            End::Failed(error) => error.to_string(),
            End::Stopped => String::new(),
        };
        // what stops it meanwhile is what `close` reports
        let _ = self
            .writer
            .put(&Record::End(&why))
            .and_then(|()| self.writer.flush());
        let Tally {
            frames,
            gaps,
            lost,
            whole,
        } = self.tally;
        let out = &self.args.out;
        let bytes = self.writer.close().map_err(|error| {
            let problem = format!(
                "cannot be written: {error}; what is there can be replayed, for more make room and record again"
            );
            failed(out, problem)
        })?;
        if let End::Failed(error) = end {
            return Err(error);
        }
        let gaps = match gaps {
            0 => "no gaps".to_owned(),
            1 => format!(
                "1 gap of {lost} lost entries, before which a replay stops: after {whole} frames"
            ),
            _ => format!(
                "{gaps} gaps of {lost} lost entries, at the first of which a replay stops: after {whole} frames"
            ),
        };
        let megabytes = bytes as f64 / 1e6;
        // whoever reads us may have stopped reading
        let _ = writeln!(
            std::io::stdout(),
            "{}: {frames} frames, {megabytes:.1} MB, {gaps}; {why}",
            out.display()
        );
        Ok(())
    }

    fn log(&self, line: &str) {
        let _ = writeln!(std::io::stderr(), "tightloop: {line}");
    }

    /// On a terminal, how far it is.
    fn report_progress(&mut self) {
        if self.reported.elapsed() > PROGRESS_PERIOD && std::io::stderr().is_terminal() {
            self.reported = Instant::now();
            let _ = write!(std::io::stderr(), "\r{} frames ", self.tally.frames);
        }
    }
}

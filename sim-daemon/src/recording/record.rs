//! `tightloop record`: what a daemon does, from its journal into a file.
//!
//! A recorder that is too slow loses entries: a gap. It then takes a new journal, which begins with the state of all worlds,
//! so that a replay goes on behind the gap.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, IsTerminal};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use sim_protocol::{
    AttachOptions, Client, Description, Journal, JournalEntry, ProtocolError, keep_waiting,
};
use sim_system::{process, signals};

use super::blocks::{BLOCK_MAX, HEAD};
use super::failure::failed;
use super::records::{Record, RecordedCommand};
use super::writer::{Stopped, Writer};
use crate::cli;
use crate::error::DaemonError;
use crate::output::{self, Part};
use crate::printer::{self, Printer};

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
    /// Entries that are known to be lost; more may be.
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
    signals::on_stop(&stop).map_err(|error| DaemonError::System {
        action: "handle signals",
        problem: error.to_string(),
    })?;
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
    let news = Printer::stderr()?;
    let (file, part) = create(args)?;
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
        client,
        fields: &fields,
        journal: Some(journal),
        writer,
        part,
        news: news.clone(),
        state: Vec::new(),
        tally: Tally::default(),
        has_begun: false,
        gap: None,
        started: Instant::now(),
        reported: Instant::now(),
    };
    let end = recorder.run();
    let result = recorder.close(end);
    printer::flush([&news]);
    result
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

/// The file to write, and its place if it is to replace another one, which stays until the recording is whole.
fn create(args: &cli::Record) -> Result<(File, Option<Part>), DaemonError> {
    let out = &args.out;
    let not_made = |error: io::Error| match error.kind() {
        ErrorKind::AlreadyExists => is_there(out),
        ErrorKind::ResourceBusy => failed(out, "another recorder replaces it; end that one first"),
        ErrorKind::NotFound => failed(out, "its folder is not there; make it first"),
        _ => failed(out, format!("cannot be made: {error}")),
    };
    // where the system cannot tell, nothing is cut
    let there = output::there(out).map_err(not_made)?;
    if args.force && there.is_some_and(|there| there.is_file()) {
        // a user who may not write it may not replace it either
        output::open(out, OpenOptions::new().write(true)).map_err(not_made)?;
        let part = Part::named(out).map_err(not_made)?;
        return Ok((part.file().map_err(not_made)?, Some(part)));
    }
    let mut options = OpenOptions::new();
    options.write(true);
    match args.force {
        // a device or a pipe is written to, and so is what a link names that is not there yet
        true => options.create(true).truncate(true),
        false => options.create_new(true),
    };
    let file = output::open(out, &mut options).map_err(not_made)?;
    Ok((file, None))
}

/// Removes a file without a block, which cannot be replayed, and says whether it did.
fn remove_empty(out: &Path) -> bool {
    let is_empty = |there: &Metadata| there.is_file() && there.len() <= HEAD as u64;
    matches!(output::there(out), Ok(Some(there)) if is_empty(&there))
        && fs::remove_file(out).is_ok()
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
    client: &'a Client,
    /// Fields whose arrays are recorded whole.
    fields: &'a [String],
    /// None only while it is replaced.
    journal: Option<Journal>,
    writer: Writer,
    /// Where the file goes when it is whole, if it replaces another one.
    part: Option<Part>,
    /// Lines for people; a terminal that stands must not make a gap.
    news: Printer,
    /// The part of a state that has come.
    state: Vec<u8>,
    tally: Tally,
    has_begun: bool,
    /// Entries lost since the last record of the file, while the state behind them has not come.
    gap: Option<u64>,
    started: Instant,
    reported: Instant,
}

impl Recorder<'_> {
    /// Records until something ends it.
    fn run(&mut self) -> End {
        match self.go() {
            Err(end) => end,
            Ok(never) => match never {},
        }
    }

    fn go(&mut self) -> Result<std::convert::Infallible, End> {
        let (daemon, observed): (&Description, _) = (self.client.description(), self.fields);
        let head = serde_json::json!({ "daemon": daemon, "observed": observed }).to_string();
        self.writer.put(&Record::Head(head.as_bytes()))?;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                self.take_what_waits()?;
                return Err(End::Done("stopped by a signal".to_owned()));
            }
            if self.args.parent.is_some_and(process::is_orphan) {
                self.take_what_waits()?;
                return Err(End::Done("its owner ended".to_owned()));
            }
            if self.args.frames == Some(self.tally.frames) {
                return Err(End::Done("as many frames as asked".to_owned()));
            }
            let seconds = self.args.seconds;
            if seconds.is_some_and(|seconds| self.started.elapsed().as_secs_f64() >= seconds) {
                self.take_what_waits()?;
                return Err(End::Done("as many seconds as asked".to_owned()));
            }
            match self.journal().next(LOOK, &mut keep_waiting()) {
                Ok(Some(entry)) => self.take(entry)?,
                Ok(None) => {}
                Err(
                    error @ (ProtocolError::DaemonLost { .. }
                    | ProtocolError::DaemonRestarted { .. }),
                ) if self.has_begun => {
                    return Err(End::Done(error.to_string()));
                }
                Err(error) => return Err(End::Failed(error.into())),
            }
            // the first block has a state, so that what stays of a file can be replayed
            if self.has_begun {
                self.writer.flush_old()?;
            }
            self.report_progress();
        }
    }

    /// What was done before the end is recorded, though it may still wait in the journal: no more than fits there.
    fn take_what_waits(&mut self) -> Result<(), End> {
        for _ in 0..self.journal().depth() {
            if self.args.frames == Some(self.tally.frames) {
                break;
            }
            let Ok(Some(entry)) = self.journal().next(LATE, &mut keep_waiting()) else {
                break; // nothing waits any more; that the daemon has ended, too, changes nothing
            };
            self.take(entry)?;
        }
        Ok(())
    }

    fn journal(&mut self) -> &mut Journal {
        self.journal.as_mut().expect("it is replaced at once")
    }

    fn take(&mut self, entry: JournalEntry) -> Result<(), End> {
        if entry.lost > 0 {
            return self.begin_again(entry);
        }
        let entry = &entry;
        let header = entry.header();
        if header.is_state() {
            return self.take_state(entry);
        }
        if header.is_end() {
            return Err(self.end_of_daemon(entry.reason()));
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

    /// Entries were lost: what follows them is of no use without the state behind them, with which a new journal begins.
    fn begin_again(&mut self, first: JournalEntry) -> Result<(), End> {
        self.state.clear();
        let mut lost = first.lost;
        let mut next = Some(first);
        // no more than fits in the journal, since a daemon at work fills it again
        for _ in 0..self.journal().depth() {
            let Some(entry) = next.take() else {
                break;
            };
            if entry.header().is_end() {
                self.gap = Some(self.gap.unwrap_or(0) + lost);
                return Err(self.end_of_daemon(entry.reason()));
            }
            lost += u64::from(!entry.header().is_state());
            drop(entry);
            // a daemon that is gone is seen when the new journal is asked for
            next = self
                .journal()
                .next(Duration::ZERO, &mut keep_waiting())
                .unwrap_or(None);
            lost += next.as_ref().map_or(0, |entry| entry.lost);
        }
        drop(next);
        self.gap = Some(self.gap.unwrap_or(0) + lost);
        // as much room as there can be, or the next gap would come at once
        self.writer.catch_up()?;
        // it is one of a few places, and its memory is shared
        self.journal = None;
        let stop = self.stop;
        let mut hook = || match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        match self.client.journal(self.fields, &mut hook) {
            Ok(journal) => self.journal = Some(journal),
            Err(ProtocolError::Interrupted) => {
                return Err(End::Done("stopped by a signal".to_owned()));
            }
            Err(
                error @ (ProtocolError::DaemonLost { .. } | ProtocolError::DaemonRestarted { .. }),
            ) => return Err(self.end_of_daemon(error.to_string())),
            Err(error) => return Err(End::Failed(error.into())),
        }
        Ok(())
    }

    /// The daemon said or showed that nothing comes any more.
    fn end_of_daemon(&self, reason: String) -> End {
        match self.has_begun {
            true => End::Done(reason),
            false => End::Failed(failed(&self.args.out, reason)),
        }
    }

    /// Records that entries were lost, if any were.
    fn put_gap(&mut self) -> Result<(), Stopped> {
        // before the first state nothing is missing
        let Some(lost) = self.gap.take().filter(|_| self.has_begun) else {
            return Ok(());
        };
        self.tally.gaps += 1;
        self.tally.lost += lost;
        self.log(&format!(
            "after frame {} a gap: {lost} or more entries were lost, the recorder was too slow",
            self.tally.frames
        ));
        self.writer.put(&Record::Gap(lost))
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
        // no daemon sends pieces out of order
        if header.first != self.state.len() as u64 {
            return Ok(());
        }
        self.state.extend(entry.piece());
        if self.state.len() as u64 == header.bytes {
            self.put_gap()?;
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
            .put_gap()
            .and_then(|()| self.writer.put(&Record::End(&why)))
            .and_then(|()| self.writer.flush());
        let Tally { frames, gaps, lost } = self.tally;
        let out = &self.args.out;
        let bytes = self.writer.close().map_err(|error| {
            let cure = match self.part {
                Some(_) => "the old recording stays; make room and record again",
                None if remove_empty(out) => "nothing was recorded; make room and record again",
                None => "what is there can be replayed, for more make room and record again",
            };
            failed(out, format!("cannot be written: {error}; {cure}"))
        })?;
        // one that has begun can be replayed, whatever ended it
        let begun = self.has_begun;
        let replaces = self.part.is_some();
        if let Some(part) = self.part.filter(|_| begun) {
            let stays = |error| {
                let problem = format!("cannot be replaced: {error}; the old recording stays");
                failed(out, problem)
            };
            part.keep().map_err(stays)?;
        }
        if let End::Failed(error) = end {
            return Err(error);
        }
        if replaces && !begun {
            let problem = format!("{why}, before a first state came; the old recording stays");
            return Err(failed(out, problem));
        }
        let gaps = match gaps {
            0 => "no gaps".to_owned(),
            1 => format!("1 gap of {lost} or more lost entries"),
            _ => format!("{gaps} gaps of {lost} or more lost entries"),
        };
        let megabytes = bytes as f64 / 1e6;
        let line = format!(
            "{}: {frames} frames, {megabytes:.1} MB, {gaps}; {why}\n",
            out.display()
        );
        output::print(line.as_bytes()).map_err(DaemonError::stdout)
    }

    fn log(&self, line: &str) {
        self.news.print(format!("tightloop: {line}\n"));
    }

    /// On a terminal, how far it is.
    fn report_progress(&mut self) {
        if self.reported.elapsed() > PROGRESS_PERIOD && std::io::stderr().is_terminal() {
            self.reported = Instant::now();
            self.news.print(format!("\r{} frames ", self.tally.frames));
        }
    }
}

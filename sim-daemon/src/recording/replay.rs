//! `tightloop replay`: a recording, run again and compared bit for bit. No daemon and no shared memory.

use std::fmt;
use std::fs::File;
use std::io::{BufReader, IsTerminal, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use sim_protocol::digest::{digest, digests_of};
use sim_protocol::{Row, Table};

use super::compare::{Seen, first_difference};
use super::entries::{Entries, Entry};
use super::failure::unreadable;
use super::records::{Record, RecordedCommand};
use super::run::{Head, Run, device_of};
use crate::cli;
use crate::error::DaemonError;
use crate::export::{self, Advance};
use crate::output;

/// A terminal shows the progress this often.
const PROGRESS_PERIOD: Duration = Duration::from_millis(500);

/// Gaps that an error lists.
const GAPS_LISTED: usize = 8;

/// Why a replay ends before anything differs.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The recording does: why it was ended, if that is known.
    Recording(Option<String>),
    /// As many frames as asked.
    Asked,
    /// In the middle of a block.
    Cut,
    /// A block is not as it was written.
    Damaged,
}

/// Entries that are missing.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Gap {
    /// Frames before it.
    pub(super) frames: u64,
    /// Entries that the recorder knows to be lost.
    pub(super) lost: u64,
    /// Steps that world 0 had done since its reset, before it.
    pub(super) from: u64,
    /// As `from`, behind it; none while the recording has no state there.
    pub(super) to: Option<u64>,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Gap {
            frames, lost, from, ..
        } = self;
        write!(
            f,
            "a gap after frame {frames}: {lost} or more entries are missing, "
        )?;
        match self.to {
            None => write!(f, "and no state behind them, so nothing more was compared"),
            Some(to) if to > *from => {
                write!(f, "of world 0 the steps {} to {to}", from + 1)
            }
            Some(to) => write!(
                f,
                "among them a reset of world 0, which goes on at step {to}"
            ),
        }
    }
}

/// Runs the command. Prints one line to stdout when all frames are equal.
pub(crate) fn run(args: &cli::Replay) -> Result<(), DaemonError> {
    let mut replay = open(args)?;
    let end = replay.go()?;
    replay.tell_end(end)
}

/// Replays so many frames of a file, and says nothing; returns how many were equal.
pub(crate) fn first_frames(file: &Path, frames: u64) -> Result<u64, DaemonError> {
    let args = cli::Replay {
        file: file.to_owned(),
        threads: Some(1),
        frames: Some(frames),
    };
    let mut replay = open(&args)?;
    replay.go()?;
    Ok(replay.frames)
}

/// Opens the file.
pub(super) fn open(args: &cli::Replay) -> Result<Replay<'_, BufReader<File>>, DaemonError> {
    let path = args.file.as_path();
    if args
        .threads
        .is_some_and(|threads| !(1..=1024).contains(&threads))
    {
        return Err(DaemonError::Argument {
            argument: "threads",
            value: args.threads.unwrap_or(0).to_string(),
            problem: "ask for 1 to 1024, or leave it out".to_owned(),
        });
    }
    if args.frames == Some(0) {
        return Err(DaemonError::Argument {
            argument: "frames",
            value: "0".to_owned(),
            problem: "ask for at least 1, or leave it out for all".to_owned(),
        });
    }
    Ok(Replay {
        args,
        entries: Entries::open(path)?,
        compared: None,
        frames: 0,
        gaps: Vec::new(),
        reported: Instant::now(),
    })
}

/// A replay at work.
pub(super) struct Replay<'a, R> {
    args: &'a cli::Replay,
    entries: Entries<R>,
    compared: Option<Compared>,
    /// Frames that were equal.
    pub(super) frames: u64,
    pub(super) gaps: Vec<Gap>,
    reported: Instant,
}

impl<R: Read> Replay<'_, R> {
    /// Does the recording again, to its end or to the first frame that differs.
    pub(super) fn go(&mut self) -> Result<End, DaemonError> {
        let (path, bytes) = (self.args.file.as_path(), self.entries.bytes);
        let mut ended = None;
        loop {
            // what follows belongs to no frame that was asked for, but for the end
            let is_enough = self.args.frames == Some(self.frames);
            let record = match self.entries.next()? {
                Entry::End => return Ok(End::Recording(ended)),
                Entry::Cut => return Ok(End::Cut),
                Entry::Damaged => return Ok(End::Damaged),
                Entry::Record(_) if is_enough => return Ok(End::Asked),
                Entry::Record(record) => record,
            };
            match (record, &mut self.compared) {
                (Record::Head(json), run @ None) => {
                    *run = Some(Compared::open(path, bytes, json, self.args.threads)?);
                }
                (Record::End(why), _) => ended = Some(why.to_owned()),
                (Record::Gap(lost), Some(compared)) => {
                    let is_new = compared.run.has_state;
                    match self.gaps.last_mut().filter(|_| !is_new) {
                        Some(gap) => gap.lost = gap.lost.saturating_add(lost),
                        None => self.gaps.push(Gap {
                            frames: self.frames,
                            lost,
                            from: compared.steps(),
                            to: None,
                        }),
                    }
                    compared.run.has_state = false;
                }
                (Record::State(state), Some(compared)) => {
                    let is_behind_gap = !compared.run.has_state;
                    compared.run.restore(path, state)?;
                    if let Some(gap) = self.gaps.last_mut().filter(|_| is_behind_gap) {
                        gap.to = Some(compared.steps());
                    }
                }
                (Record::Command(command), Some(compared)) if compared.run.has_state => {
                    if compared.command(path, &command, self.frames)? {
                        self.frames += 1;
                    }
                }
                // older releases wrote what came behind a gap without the state there
                (Record::Command(_), Some(_)) if !self.gaps.is_empty() => {}
                _ => return Err(self.entries.damaged("its records are out of order")),
            }
            self.report_progress();
        }
    }

    /// All worlds as they are now.
    #[cfg(test)]
    pub(super) fn snapshot(&self) -> Vec<u8> {
        let compared = self.compared.as_ref().expect("it has begun");
        compared.run.simulation.snapshot()
    }

    /// Says what was compared, and how it ended.
    pub(super) fn tell_end(&self, end: End) -> Result<(), DaemonError> {
        let (path, frames) = (self.args.file.as_path(), self.frames);
        let has_begun = |compared: &&Compared| compared.run.has_state || !self.gaps.is_empty();
        let Some(Compared { run, .. }) = self.compared.as_ref().filter(has_begun) else {
            return Err(unreadable(
                path,
                "ends before the state of its worlds; its recorder was killed at once, or it was cut",
            ));
        };
        let good = self.entries.good();
        let end = match end {
            End::Damaged => {
                return Err(unreadable(
                    path,
                    format!(
                        "is damaged behind its first {good} bytes; the {frames} frames in these are equal, bit for bit"
                    ),
                ));
            }
            End::Asked => "more were not asked for".to_owned(),
            End::Recording(Some(why)) => format!("it ended: {why}"),
            End::Recording(None) => {
                "it ends without an end: its recorder was killed, or it was cut".to_owned()
            }
            End::Cut => format!(
                "it ends within a block, behind its first {good} bytes: its recorder was killed, or it was cut"
            ),
        };
        if !self.gaps.is_empty() {
            return Err(DaemonError::Gap {
                path: path.to_owned(),
                frames,
                gaps: listed(&self.gaps),
            });
        }
        let line = format!(
            "{}: {frames} frames of {} worlds are equal, bit for bit; {end}\n",
            path.display(),
            run.simulation.worlds()
        );
        output::print(line.as_bytes()).map_err(DaemonError::stdout)
    }

    /// On a terminal, how far it is.
    fn report_progress(&mut self) {
        if self.reported.elapsed() > PROGRESS_PERIOD {
            self.reported = Instant::now();
            if std::io::stderr().is_terminal() {
                let _ = write!(std::io::stderr(), "\r{} frames ", self.frames);
            }
        }
    }
}

/// The first gaps, and how many more there are.
fn listed(gaps: &[Gap]) -> String {
    let mut all: Vec<String> = gaps.iter().take(GAPS_LISTED).map(Gap::to_string).collect();
    if gaps.len() > GAPS_LISTED {
        all.push(format!("{} more gaps", gaps.len() - GAPS_LISTED));
    }
    all.join("; ")
}

/// The worlds that do it again, and what they are compared with.
struct Compared {
    run: Run,
    /// Where the arrays of a frame lie.
    table: Table,
    /// Those of them that were recorded whole.
    observed: Vec<Row>,
    arena: Vec<u64>,
    digests: Vec<u32>,
}

impl Compared {
    /// Builds the simulation that the head describes.
    fn open(
        path: &Path,
        bytes: u64,
        json: &[u8],
        threads: Option<usize>,
    ) -> Result<Compared, DaemonError> {
        let head = Head::read(path, json)?;
        let device = device_of(&head.daemon);
        let run = Run::open(path, bytes, &head, &head.fields(path)?, device, threads)?;
        let table = export::frame_table(run.simulation.layout(), run.eyes.images());
        let is_observed = |row: &&Row| head.observed.contains(&row.name);
        Ok(Compared {
            observed: table.rows().iter().filter(is_observed).cloned().collect(),
            arena: vec![0; run.eyes.images().arena_bytes().div_ceil(8)],
            digests: vec![0; digests_of(&table)],
            table,
            run,
        })
    }

    /// Steps that world 0 has done since its reset.
    fn steps(&mut self) -> u64 {
        // a frame of what is there; it changes nothing
        self.run.advance(Advance::Forward, &mut self.arena);
        let row = self.table.row("step").expect("it is in every frame");
        let first = row.offset - Table::head_bytes(self.table.rows().len());
        let bytes: &[u8] = bytemuck::cast_slice(&self.arena);
        bytemuck::pod_read_unaligned(&bytes[first..first + row.dtype.size()])
    }

    /// Does a command again; returns whether it made a frame, which then is equal.
    fn command(
        &mut self,
        path: &Path,
        command: &RecordedCommand<'_>,
        frame: u64,
    ) -> Result<bool, DaemonError> {
        let Some(advance) = self.run.command(path, command, frame)? else {
            return Ok(false);
        };
        self.run.advance(advance, &mut self.arena);
        digest(&self.table, &self.arena, &mut self.digests);
        let seen = Seen {
            table: &self.table,
            arena: &self.arena,
            digests: &self.digests,
            observed: &self.observed,
        };
        match first_difference(&seen, command) {
            Ok(None) => Ok(true),
            Ok(Some(difference)) => Err(DaemonError::Differs {
                path: path.to_owned(),
                frame,
                op: format!("{:?}", self.run.op()).to_lowercase(),
                difference: difference.to_string(),
            }),
            Err(problem) => Err(unreadable(path, format!("frame {frame}: {problem}"))),
        }
    }
}

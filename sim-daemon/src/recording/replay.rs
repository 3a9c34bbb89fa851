//! `tightloop replay`: a recording, run again and compared bit for bit. No daemon and no shared memory.

use std::fs::File;
use std::io::{BufReader, IsTerminal, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use sim_engine::options::{Adapter, cache_folder};
use sim_engine::simulation::Device;
use sim_protocol::digest::{digest, digests_of};
use sim_protocol::{Row, Table};

use super::compare::{Seen, first_difference};
use super::entries::{Entries, Entry};
use super::failure::unreadable;
use super::records::{Record, RecordedCommand};
use super::run::{Head, Run};
use crate::cli;
use crate::error::DaemonError;
use crate::export;

/// A terminal shows the progress this often.
const PROGRESS_PERIOD: Duration = Duration::from_millis(500);

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
    /// Entries are missing.
    Gap(u64),
}

/// Runs the command. Prints one line to stdout when all frames are equal.
pub(crate) fn run(args: &cli::Replay) -> Result<(), DaemonError> {
    let mut replay = open(args)?;
    let end = replay.go()?;
    replay.tell_end(end)
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
    reported: Instant,
}

impl<R: Read> Replay<'_, R> {
    /// Does the recording again, to its end or to the first frame that differs.
    pub(super) fn go(&mut self) -> Result<End, DaemonError> {
        let path = self.args.file.as_path();
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
                    *run = Some(Compared::open(path, json, self.args.threads)?);
                }
                (Record::End(why), _) => ended = Some(why.to_owned()),
                (Record::Gap(lost), Some(_)) => return Ok(End::Gap(lost)),
                (Record::State(state), Some(compared)) => compared.run.restore(path, state)?,
                (Record::Command(command), Some(compared)) if compared.run.has_state => {
                    if compared.command(path, &command, self.frames)? {
                        self.frames += 1;
                    }
                }
                _ => return Err(self.entries.damaged("its records are out of order")),
            }
            self.report_progress();
        }
    }

    /// Says what was compared, and how it ended.
    pub(super) fn tell_end(&self, end: End) -> Result<(), DaemonError> {
        let (path, frames) = (self.args.file.as_path(), self.frames);
        let has_state = |compared: &&Compared| compared.run.has_state;
        let Some(Compared { run, .. }) = self.compared.as_ref().filter(has_state) else {
            return Err(unreadable(
                path,
                "ends before the state of its worlds; its recorder was killed at once, or it was cut",
            ));
        };
        let good = self.entries.good();
        let end = match end {
            End::Gap(lost) => {
                return Err(DaemonError::Gap {
                    path: path.to_owned(),
                    frames,
                    lost,
                });
            }
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
        // whoever reads us may have stopped reading
        let _ = writeln!(
            std::io::stdout(),
            "{}: {frames} frames of {} worlds are equal, bit for bit; {end}",
            path.display(),
            run.simulation.worlds()
        );
        Ok(())
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
    fn open(path: &Path, json: &[u8], threads: Option<usize>) -> Result<Compared, DaemonError> {
        let head = Head::read(path, json)?;
        // the bits of a GPU are its own
        let device = match head.daemon.adapter.as_str() {
            "" => Device::Cpu,
            name => Device::Gpu {
                adapter: Adapter::Name(name.to_owned()),
                cache: cache_folder(),
            },
        };
        let run = Run::open(path, &head, head.fields(path)?, device, threads)?;
        let table = export::frame_table(run.simulation.layout());
        let is_observed = |row: &&Row| head.observed.contains(&row.name);
        Ok(Compared {
            observed: table.rows().iter().filter(is_observed).cloned().collect(),
            arena: vec![0; run.simulation.layout().bytes.div_ceil(8)],
            digests: vec![0; digests_of(&table)],
            table,
            run,
        })
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

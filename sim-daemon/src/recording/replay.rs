//! `tightloop replay`: a recording, run again and compared bit for bit. No daemon and no shared memory.

use std::fs::File;
use std::io::{BufReader, IsTerminal, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Deserialize;
use sim_core::batch::Field;
use sim_engine::options::{Adapter, cache_folder};
use sim_engine::simulation::{Device, Draws, Faults, Lanes, Options, Precision, Simulation};
use sim_protocol::digest::{digest, digests_of};
use sim_protocol::host::{Inbox, free_memory};
use sim_protocol::{CommandHeader, Description, Op, Row, Table};

use super::blocks::{Blocks, Next};
use super::compare::{Seen, first_difference};
use super::records::{self, Command, Record};
use super::unreadable;
use crate::error::DaemonError;
use crate::export::{self, Advance};
use crate::{cli, config};

/// Counts above this are damage; below it, sizes in bytes do not overflow.
const WORLDS_MAX: usize = u32::MAX as usize;
/// A terminal is told this often how far it is.
const TELL_PERIOD: Duration = Duration::from_millis(500);

/// The head of a recording.
#[derive(Debug, Deserialize)]
struct Head {
    daemon: Description,
    observed: Vec<String>,
}

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
    let failed = |error: std::io::Error| unreadable(path, format!("cannot be read: {error}"));
    let file = File::open(path).map_err(failed)?;
    if file.metadata().map_err(failed)?.is_dir() {
        return Err(unreadable(
            path,
            "is a folder; give the file of a recording",
        ));
    }
    let blocks = Blocks::open(BufReader::new(file)).map_err(|problem| unreadable(path, problem))?;
    Ok(Replay {
        args,
        blocks,
        run: None,
        frames: 0,
        told: Instant::now(),
    })
}

/// A replay at work.
pub(super) struct Replay<'a, R> {
    args: &'a cli::Replay,
    blocks: Blocks<R>,
    run: Option<Run>,
    /// Frames that were equal.
    pub(super) frames: u64,
    told: Instant,
}

impl<R: Read> Replay<'_, R> {
    /// Does the recording again, to its end or to the first frame that differs.
    pub(super) fn go(&mut self) -> Result<End, DaemonError> {
        let path = self.args.file.as_path();
        let damaged = |what: &str| unreadable(path, format!("is damaged: {what}; copy it again"));
        let mut block = Vec::new();
        let mut ended = None;
        loop {
            match self.blocks.next(&mut block) {
                Err(error) => return Err(unreadable(path, format!("cannot be read: {error}"))),
                Ok(Next::End) => return Ok(End::Recording(ended)),
                Ok(Next::Cut) => return Ok(End::Cut),
                Ok(Next::Damaged) => return Ok(End::Damaged),
                Ok(Next::Block) => {}
            }
            let mut words = block.as_slice();
            while !words.is_empty() {
                if self.args.frames == Some(self.frames) {
                    return Ok(End::Asked);
                }
                let record =
                    records::read(&mut words).ok_or_else(|| damaged("a record makes no sense"))?;
                match (record, &mut self.run) {
                    (Record::Head(json), run @ None) => {
                        *run = Some(Run::open(path, json, self.args.threads)?);
                    }
                    (Record::End(why), _) => ended = Some(why.to_owned()),
                    (Record::Gap(lost), Some(_)) => return Ok(End::Gap(lost)),
                    (Record::State(state), Some(run)) => run.restore(path, state)?,
                    (Record::Command(command), Some(run)) if run.has_state => {
                        if run.command(path, &command, self.frames)? {
                            self.frames += 1;
                        }
                    }
                    _ => return Err(damaged("its records are out of order")),
                }
                self.tell();
            }
        }
    }

    /// Says what was compared, and how it ended.
    pub(super) fn tell_end(&self, end: End) -> Result<(), DaemonError> {
        let (path, frames) = (self.args.file.as_path(), self.frames);
        let Some(run) = self.run.as_ref().filter(|run| run.has_state) else {
            return Err(unreadable(
                path,
                "ends before the state of its worlds; its recorder was killed at once, or it was cut",
            ));
        };
        let good = self.blocks.good;
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
    fn tell(&mut self) {
        if self.told.elapsed() > TELL_PERIOD {
            self.told = Instant::now();
            if std::io::stderr().is_terminal() {
                let _ = write!(std::io::stderr(), "\r{} frames ", self.frames);
            }
        }
    }
}

/// The simulation that does again what was recorded.
struct Run {
    simulation: Simulation,
    /// Where the arrays of a frame lie.
    table: Table,
    /// Those of them that were recorded whole.
    observed: Vec<Row>,
    inbox: Inbox,
    mask: Vec<bool>,
    arena: Vec<u64>,
    digests: Vec<u32>,
    has_state: bool,
}

impl Run {
    /// Builds the simulation that the head describes.
    fn open(path: &Path, json: &[u8], threads: Option<usize>) -> Result<Run, DaemonError> {
        let failed = |problem: String| unreadable(path, problem);
        let head: Head = serde_json::from_slice(json).map_err(|error| {
            failed(format!(
                "its head cannot be read: {error}; replay it with the release that recorded it"
            ))
        })?;
        let told = head.daemon;
        if !(1..=WORLDS_MAX).contains(&told.worlds) {
            return Err(failed(format!("has {} worlds in its head", told.worlds)));
        }
        let scene = config::parse(&told.scene, "of the recording");
        let scene = scene.map_err(|error| failed(error.to_string()))?;
        let description = scene.describe(Path::new(&told.scene_folder));
        let model = description
            .map_err(|error| {
                failed(format!(
                    "needs the scene's robots and meshes where they were: {error}"
                ))
            })?
            .compile()
            .map_err(|error| failed(error.to_string()))?;
        if model.hash() != told.model_hash {
            let (then, now) = (told.model_hash, model.hash());
            let ours = env!("CARGO_PKG_VERSION");
            let cause = match told.release == ours {
                true => {
                    "a robot file or a mesh of its scene has changed since; put back what it was"
                        .to_owned()
                }
                false => format!(
                    "a robot file or a mesh of its scene has changed since, or release {} makes another of it than \
                     ours, {ours}; replay it with that one",
                    told.release
                ),
            };
            return Err(failed(format!(
                "is of another model ({then:016x}, here {now:016x}): {cause}"
            )));
        }
        let fields = told.fields.iter().map(|field| {
            Field::named(&field.name)
                .ok_or_else(|| failed(format!("has a field `{}`, unknown here", field.name)))
        });
        let options = Options {
            // the bits of a GPU are its own
            device: match told.adapter.as_str() {
                "" => Device::Cpu,
                name => Device::Gpu {
                    adapter: Adapter::Name(name.to_owned()),
                    cache: cache_folder(),
                },
            },
            worlds: told.worlds,
            first_world: told.first_world,
            precision: match told.precision.as_str() {
                "f64" => Precision::F64,
                _ => Precision::F32,
            },
            threads,
            lanes: Lanes::Auto,
            fields: fields.collect::<Result<_, _>>()?,
            faults: Faults {
                joint_q_max: told.joint_q_max.unwrap_or(f64::INFINITY),
                joint_qd_max: told.joint_qd_max.unwrap_or(f64::INFINITY),
                resets: told.on_fault == "reset",
                freezes_nan: told.on_nan == "freeze",
            },
            draws: Draws::named(&told.draws)
                .ok_or_else(|| failed(format!("draws by `{}`, unknown here", told.draws)))?,
            ..Options::default()
        };
        let simulation =
            Simulation::new(model, &options).map_err(|error| failed(error.to_string()))?;
        let table = export::frame_table(simulation.layout());
        let (needed, free) = (simulation.layout().bytes as u64, free_memory());
        if needed > free {
            return Err(failed(format!(
                "has frames of {needed} bytes and {free} bytes of memory are free; end other programs"
            )));
        }
        let observed = table
            .rows()
            .iter()
            .filter(|row| head.observed.contains(&row.name));
        Ok(Run {
            observed: observed.cloned().collect(),
            arena: vec![0; simulation.layout().bytes.div_ceil(8)],
            digests: vec![0; digests_of(&table)],
            inbox: Inbox::for_commands_of(&told),
            mask: Vec::with_capacity(told.worlds),
            table,
            simulation,
            has_state: false,
        })
    }

    fn restore(&mut self, path: &Path, state: &[u8]) -> Result<(), DaemonError> {
        let restored = self.simulation.restore(state, None, None);
        restored.map_err(|error| unreadable(path, error.to_string()))?;
        self.has_state = true;
        Ok(())
    }

    /// Does a command again; returns whether it made a frame, which then is equal.
    fn command(
        &mut self,
        path: &Path,
        command: &Command<'_>,
        frame: u64,
    ) -> Result<bool, DaemonError> {
        let refused = |problem: String| {
            unreadable(
                path,
                format!("frame {frame}: a command that was carried out is refused: {problem}"),
            )
        };
        let header = CommandHeader {
            op: command.op,
            rows: command.rows,
            ..CommandHeader::default()
        };
        self.inbox.take(header, command.words).map_err(refused)?;
        let op = self.inbox.op();
        let advance = match op {
            // the state that came before is what the restore has left; a snapshot changes nothing
            Op::Restore | Op::Snapshot => Advance::Forward,
            _ => export::apply(&mut self.simulation, &self.inbox, &mut self.mask)
                .map_err(|refusal| refused(refusal.reason))?,
        };
        if command.digests.is_empty() {
            return Ok(false);
        }
        match advance {
            Advance::Step => self.simulation.step(&mut self.arena),
            Advance::Forward => self.simulation.forward(&mut self.arena),
        }
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
                op: format!("{op:?}").to_lowercase(),
                difference: difference.to_string(),
            }),
            Err(problem) => Err(unreadable(path, format!("frame {frame}: {problem}"))),
        }
    }
}

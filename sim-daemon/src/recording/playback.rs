//! A recording for observers: frames of any fields, one after the other.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use sim_engine::simulation::Device;
use sim_protocol::{Description, Op};

use super::entries::{Entries, Entry};
use super::failure::unreadable;
use super::records::Record;
use super::run::{Head, Run, device_of};
use crate::error::DaemonError;
use crate::export::Advance;
use crate::export::arrays::Arrays;
use crate::eyes::FrameFields;

/// What a frame of a playback shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// The state at the beginning of the recording, or behind a gap.
    Start,
    /// All worlds one control frame later.
    Step,
    /// Worlds at the same time, or put elsewhere: by a reset, a write, a restore.
    Still,
}

/// A recording that is run again, frame after frame, without comparing them.
pub struct Playback {
    entries: Entries<BufReader<File>>,
    description: Description,
    run: Run,
    arrays: Arrays,
    frames: u64,
    note: Option<String>,
    end: Option<String>,
    /// Entries that are missing here; none where frames follow one another.
    gap: Option<u64>,
    /// Whether a state without a command is a frame, too.
    has_starts: bool,
    shows: Shows,
    /// Arrays of the commands that led to the last frame.
    sent: Vec<String>,
}

impl Playback {
    /// Opens a file, with frames of `fields` on so many threads (all cores without a number).
    ///
    /// # Errors
    /// A file that cannot be read or is no recording; a scene whose robots and meshes are not where they were.
    pub fn open(
        path: &Path,
        fields: &FrameFields,
        threads: Option<usize>,
    ) -> Result<Playback, DaemonError> {
        let mut entries = Entries::open(path)?;
        let head = match entries.next()? {
            Entry::Record(Record::Head(json)) => Head::read(path, json)?,
            _ => return Err(unreadable(path, "ends before its head; copy it again")),
        };
        let bytes = entries.bytes;
        let fields = FrameFields {
            of_every_world: true,
            ..fields.clone()
        };
        let open = |device| Run::open(path, bytes, &head, &fields, device, threads);
        let (run, note) = match device_of(&head.daemon) {
            Device::Cpu => (open(Device::Cpu)?, None),
            gpu => match open(gpu) {
                Ok(run) => (run, None),
                Err(error) => {
                    let note = format!(
                        "played on the CPU, whose bits are others than those of the GPU it was recorded on: {error}"
                    );
                    (open(Device::Cpu)?, Some(note))
                }
            },
        };
        Ok(Playback {
            entries,
            arrays: Arrays::new(&run.simulation, run.eyes.images()),
            description: head.daemon,
            run,
            frames: 0,
            note,
            end: None,
            gap: None,
            has_starts: false,
            shows: Shows::Start,
            sent: Vec::new(),
        })
    }

    /// Also shows the states at the beginning and behind gaps, which no command made.
    pub fn with_starts(mut self) -> Playback {
        self.has_starts = true;
        self
    }

    /// What the last frame shows.
    pub fn shows(&self) -> Shows {
        self.shows
    }

    /// Names of the arrays that clients sent for the last frame, if it is a step.
    pub fn sent(&self) -> &[String] {
        &self.sent
    }

    /// The daemon's description.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// What a viewer should know, if anything.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Why there are no more frames, once there are none.
    pub fn end(&self) -> Option<&str> {
        self.end.as_deref()
    }

    /// The next frame, also behind a gap; none at the end of the recording, or where it is damaged.
    ///
    /// # Errors
    /// A file that cannot be read, or whose records no recorder writes.
    pub fn advance(&mut self) -> Result<Option<&Arrays>, DaemonError> {
        if self.end.is_some() {
            return Ok(None);
        }
        let path = self.entries.path.clone();
        self.sent.clear();
        loop {
            let record = match self.entries.next()? {
                Entry::Record(record) => record,
                Entry::End | Entry::Cut => return Ok(self.ended("it ends here".to_owned())),
                Entry::Damaged => return Ok(self.ended("it is damaged from here on".to_owned())),
            };
            match record {
                Record::End(why) => {
                    let why = why.to_owned();
                    return Ok(self.ended(why));
                }
                Record::Gap(lost) => {
                    self.gap = Some(self.gap.unwrap_or(0).saturating_add(lost));
                    self.run.has_state = false;
                }
                Record::State(state) => {
                    let starts = !self.run.has_state;
                    self.run.restore(&path, state)?;
                    self.gap = None;
                    if starts && self.has_starts {
                        self.shows = Shows::Start;
                        self.run.advance(Advance::Forward, self.arrays.arena());
                        return Ok(Some(&self.arrays));
                    }
                }
                Record::Command(command) if self.run.has_state => {
                    let advance = self.run.command(&path, &command, self.frames)?;
                    if self.run.op() == Op::Step {
                        self.sent.extend(self.run.names());
                    }
                    if let Some(advance) = advance {
                        self.frames += 1;
                        self.shows = match advance {
                            Advance::Step => Shows::Step,
                            Advance::Forward => Shows::Still,
                        };
                        self.run.advance(advance, self.arrays.arena());
                        return Ok(Some(&self.arrays));
                    }
                }
                // older releases wrote what came behind a gap without the state there
                Record::Command(_) if self.gap.is_some() => {}
                Record::Head(_) | Record::Command(_) => {
                    return Err(self.entries.damaged("its records are out of order"));
                }
            }
        }
    }

    fn ended(&mut self, why: String) -> Option<&Arrays> {
        self.end = Some(match self.gap {
            None => why,
            Some(lost) => format!("{lost} or more frames are missing from here on"),
        });
        None
    }
}

//! What the daemon reads of bytes from outside, for tests that give it any bytes: the fuzz targets of `tests/fuzz/simulation`.
//! Scene files are not here: [`crate::config`] is public anyway.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;
use sim_protocol::host::{self, Inbox};
use sim_protocol::{Command, CommandHeader, Description, Op};

use crate::config;
use crate::error::DaemonError;
use crate::export::{self, Advance, RunInfo, snapshot};
use crate::eyes::{Eyes, FrameFields};
use crate::recording;
use crate::serve::{Exchange, Ik, Rollouts, Steps};

/// Worlds of a scene, on which commands and files act. Whatever acts finds them in the same state.
pub struct Worlds {
    simulation: Simulation,
    eyes: Eyes,
    description: Description,
    inbox: Inbox,
    mask: Vec<bool>,
    arena: Vec<u64>,
    state: Vec<u8>,
}

impl Worlds {
    /// Two worlds of a scene file's text, whose paths are relative to `folder`.
    ///
    /// # Panics
    /// When the scene is wrong.
    pub fn new(text: &str, folder: &Path) -> Worlds {
        let scene = config::parse(text, "of the test").expect("the scene is right");
        let described = scene.describe(folder).expect("the scene is right");
        let options = Options {
            worlds: 2,
            threads: Some(1),
            fields: vec![Field::JointQ, Field::JointQd, Field::BodyQ],
            ..Options::default()
        };
        let model = described.compile().expect("the scene is right");
        let simulation = Simulation::new(model, &options).expect("the scene runs");
        let eyes = Eyes::none(&simulation);
        let info = RunInfo {
            scene: &described,
            scene_text: text.to_owned(),
            scene_folder: folder.display().to_string(),
            device: String::new(),
            threads: 1,
            frames_held: 1,
            watch_worlds: 1,
            images: eyes.images(),
        };
        let description =
            export::description(simulation.model(), &options, simulation.layout(), info);
        Worlds {
            inbox: Inbox::for_commands_of(&description),
            mask: Vec::new(),
            arena: vec![0; simulation.layout().bytes.div_ceil(8)],
            state: simulation.snapshot(),
            description,
            simulation,
            eyes,
        }
    }

    fn begin_anew(&mut self) {
        let restored = self.simulation.restore(&self.state, None, None);
        restored.expect("the state is theirs");
    }

    /// Carries out a command of an operation, so many rows and a payload, unless it names a file.
    ///
    /// # Errors
    /// What the daemon answers.
    pub fn command(&mut self, op: u32, rows: u32, payload: &[u64]) -> Result<(), String> {
        self.begin_anew();
        let header = CommandHeader {
            op,
            rows,
            ..CommandHeader::default()
        };
        self.inbox.take(header, payload)?;
        if let Op::Snapshot | Op::Restore | Op::Ik | Op::Rollout = self.inbox.op() {
            return Ok(());
        }
        let applied = export::apply(&mut self.simulation, &self.inbox, &mut self.mask);
        match applied.map_err(|refusal| refusal.reason)? {
            Advance::Step => self.simulation.step(&mut self.arena),
            Advance::Forward => self.simulation.forward(&mut self.arena),
        }
        Ok(())
    }

    /// What a daemon with these worlds announces.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The bytes of a snapshot of these worlds.
    pub fn snapshot(&self) -> &[u8] {
        &self.state
    }

    /// Restores a snapshot, and advances the worlds.
    ///
    /// # Errors
    /// What the daemon answers.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.begin_anew();
        let restored = self.simulation.restore(bytes, None, None);
        restored.map_err(|error| error.to_string())?;
        self.simulation.step(&mut self.arena);
        Ok(())
    }

    /// Answers a question of inverse kinematics, unless that takes long; returns the length of the answer.
    ///
    /// # Errors
    /// What the daemon answers.
    pub fn ik(&mut self, question: &Path) -> Result<usize, String> {
        self.begin_anew();
        let question = Exchange::read(question, 3)?;
        let asked = AtomicUsize::new(0);
        let stop = || asked.fetch_add(1, Ordering::Relaxed) >= STOPS_AFTER;
        let answer = Ik::default().solve(&self.simulation, &question, &stop)?;
        Ok(answer.len())
    }

    /// Carries out the first frames of a rollout; returns the length of the answer if these are all.
    ///
    /// # Errors
    /// What the daemon answers; it takes a client to have gone after [`FRAMES_MAX`] frames.
    pub fn rollout(&mut self, question: &Path) -> Result<usize, String> {
        self.begin_anew();
        let question = Exchange::read(question, 4)?;
        let mut steps = Alone {
            description: &self.description,
            inbox: &mut self.inbox,
            frames: 0,
        };
        let worlds = (&mut self.simulation, &mut self.eyes);
        let answer = Rollouts::default().carry_out(&question, false, worlds, &mut steps, 0);
        match answer {
            Ok(answer) => Ok(answer.len()),
            Err(refusal) => Err(refusal.reason),
        }
    }
}

/// Frames of a rollout or a recording that are made here.
pub const FRAMES_MAX: usize = 4;
/// How often a solver may ask whether it is to go on: each time after some milliseconds.
const STOPS_AFTER: usize = 16;
/// Bytes of an answer for which there is room.
const ANSWER_MAX: u64 = 1 << 24;

/// Steps of a rollout without a host.
struct Alone<'a> {
    description: &'a Description,
    inbox: &'a mut Inbox,
    frames: usize,
}

impl Steps for Alone<'_> {
    fn description(&self) -> &Description {
        self.description
    }

    fn inbox(&self) -> &Inbox {
        self.inbox
    }

    fn put_aside(&mut self) {}

    fn put_step(&mut self, commands: &[Command<'_>]) -> Result<(), String> {
        let header = CommandHeader::default();
        self.inbox.put(self.description, header, Op::Step, commands)
    }

    fn carry_out(&mut self, arena: &mut [u64], worlds: &mut impl host::Worlds) -> bool {
        self.frames += 1;
        worlds.frame(arena, None);
        self.frames <= FRAMES_MAX
    }

    fn take_back(&mut self) {}

    fn check_room(&self, needed: u64) -> Result<(), String> {
        snapshot::check_room(needed)?;
        match needed > ANSWER_MAX {
            true => Err(format!("needs {needed} bytes, more than a test has")),
            false => Ok(()),
        }
    }
}

/// Reads all records of a recording; returns how many there are, up to what is damaged.
///
/// # Errors
/// What a replay reports.
pub fn recording(bytes: &[u8]) -> Result<u64, String> {
    recording::count_records(bytes)
}

/// Replays the first [`FRAMES_MAX`] frames of a recording on its scene; returns how many are equal.
///
/// # Errors
/// What a replay reports.
pub fn replay(file: &Path) -> Result<u64, String> {
    let equal = recording::first_frames(file, FRAMES_MAX as u64);
    equal.map_err(|error| error.to_string())
}

/// Plays the first [`FRAMES_MAX`] frames of a recording; returns how many there are.
///
/// # Errors
/// What an observer reports.
pub fn playback(file: &Path) -> Result<usize, String> {
    let fields = FrameFields::from(&[Field::JointQ, Field::BodyQ][..]);
    let said = |error: DaemonError| error.to_string();
    let mut played = recording::Playback::open(file, &fields, Some(1)).map_err(said)?;
    let mut frames = 0;
    while frames < FRAMES_MAX && played.advance().map_err(said)?.is_some() {
        frames += 1;
    }
    Ok(frames)
}

/// A recording with one block of these records, whose checksums are right.
pub fn recording_of(records: &[u64]) -> Vec<u8> {
    recording::file_of(records)
}

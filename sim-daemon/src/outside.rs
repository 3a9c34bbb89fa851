//! What the daemon reads of bytes from outside, for tests that give it any bytes: the fuzz targets of `tests/fuzz/simulation`.
//! Scene files are not here: [`crate::config`] is public anyway.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;
use sim_protocol::host::Inbox;
use sim_protocol::{CommandHeader, Description, Op};

use crate::config;
use crate::export::{self, Advance, RunInfo};
use crate::recording;
use crate::serve::{Exchange, Ik, check_rollout};

/// Worlds of a scene, on which commands and files act. Whatever acts finds them in the same state.
pub struct Worlds {
    simulation: Simulation,
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
        let info = RunInfo {
            scene: &described,
            scene_text: text.to_owned(),
            scene_folder: String::new(),
            device: String::new(),
            threads: 1,
            frames_held: 1,
            watch_worlds: 1,
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

    /// Answers a question of inverse kinematics; returns the length of the answer.
    ///
    /// # Errors
    /// What the daemon answers.
    pub fn ik(&mut self, question: &Path) -> Result<usize, String> {
        self.begin_anew();
        let question = Exchange::read(question, 3)?;
        let stop = AtomicBool::new(false);
        let answer = Ik::default().solve(&self.simulation, &question, &stop)?;
        Ok(answer.len())
    }

    /// Checks the question of a rollout, up to its first step.
    ///
    /// # Errors
    /// What the daemon answers.
    pub fn rollout(&self, question: &Path) -> Result<(), String> {
        let question = Exchange::read(question, 4)?;
        check_rollout(&question, &self.simulation, &self.description)
    }
}

/// Reads all records of a recording; returns how many there are, up to what is damaged.
///
/// # Errors
/// What a replay reports.
pub fn recording(bytes: &[u8]) -> Result<u64, String> {
    recording::count_records(bytes)
}

/// A recording with one block of these records, whose checksums are right.
pub fn recording_of(records: &[u64]) -> Vec<u8> {
    recording::file_of(records)
}

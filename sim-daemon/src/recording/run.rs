//! A simulation that does again what a recording says.

use std::path::Path;

use serde::Deserialize;
use sim_engine::options::{Adapter, cache_folder, compile_limit};
use sim_engine::simulation::{
    Device, Draws, Faults, Lanes, Options, OutputsAt, Precision, Simulation,
};
use sim_model::Model;
use sim_protocol::host::{Inbox, free_memory};
use sim_protocol::{CommandHeader, Description, Op};

use super::blocks::most_records;
use super::failure::unreadable;
use super::records::RecordedCommand;
use crate::config;
use crate::error::DaemonError;
use crate::export::{self, Advance, RunInfo};
use crate::eyes::{Eyes, FrameFields, Images, Sight};

/// Counts above this are damage; below it, sizes in bytes do not overflow.
const WORLDS_MAX: usize = u32::MAX as usize;

/// Bytes of a world's counters in a state; see `sim-core/engine/src/snapshot.rs`.
const COUNTERS: u64 = 28;

/// The device that computes a run's bits again: its GPU, whose bits are its own, unless they are those of the processor.
pub(super) fn device_of(daemon: &Description) -> Device {
    if daemon.adapter.is_empty() || daemon.cpu_bits {
        return Device::Cpu;
    }
    Device::Gpu {
        adapter: Adapter::Name(daemon.adapter.clone()),
        cache: cache_folder(),
    }
}

/// The head of a recording.
#[derive(Debug, Deserialize)]
pub(super) struct Head {
    pub(super) daemon: Description,
    pub(super) observed: Vec<String>,
}

impl Head {
    /// Reads it.
    pub(super) fn read(path: &Path, json: &[u8]) -> Result<Head, DaemonError> {
        let head: Head = serde_json::from_slice(json).map_err(|error| {
            let problem = format!(
                "its head cannot be read: {error}; replay it with the release that recorded it"
            );
            unreadable(path, problem)
        })?;
        let (first, worlds) = (head.daemon.first_world, head.daemon.worlds);
        let last = first.checked_add(worlds);
        if worlds == 0 || last.is_none_or(|last| last > WORLDS_MAX) {
            return Err(unreadable(
                path,
                format!("has {worlds} worlds from {first} on in its head"),
            ));
        }
        Ok(head)
    }

    /// The fields of the frames that were recorded.
    pub(super) fn fields(&self, path: &Path) -> Result<FrameFields, DaemonError> {
        let names = self.daemon.fields.iter().map(|field| field.name.as_str());
        FrameFields::named(names)
            .map_err(|name| unreadable(path, format!("has a field `{name}`, unknown here")))
    }
}

/// Fewest bytes of the state of all worlds: their counters, positions and velocities.
fn state_min(model: &Model, options: &Options) -> u64 {
    let real = match options.precision {
        Precision::F32 => 4,
        Precision::F64 => 8,
    };
    let world = COUNTERS + (model.coords() + model.dofs()) as u64 * real;
    world.saturating_mul(options.worlds as u64)
}

/// The worlds of a recording.
pub(super) struct Run {
    pub(super) simulation: Simulation,
    pub(super) eyes: Eyes,
    inbox: Inbox,
    mask: Vec<bool>,
    /// They are where the recording begins.
    pub(super) has_state: bool,
}

impl Run {
    /// Builds the simulation that the head of a file of so many bytes describes, with frames of `fields`.
    pub(super) fn open(
        path: &Path,
        bytes: u64,
        head: &Head,
        asked: &FrameFields,
        device: Device,
        threads: Option<usize>,
    ) -> Result<Run, DaemonError> {
        let failed = |problem: String| unreadable(path, problem);
        let daemon = &head.daemon;
        let scene = config::parse(&daemon.scene, "of the recording");
        let mut scene = scene.map_err(|error| failed(error.to_string()))?;
        let described = scene.describe(Path::new(&daemon.scene_folder));
        let described = described.map_err(|error| {
            failed(format!(
                "needs the scene's robots and meshes where they were: {error}"
            ))
        })?;
        let is_as_recorded = asked.cameras.is_empty() && !asked.of_every_world;
        let described = match is_as_recorded {
            true => described,
            false => {
                scene.cameras.extend(asked.cameras.iter().cloned());
                if asked.of_every_world {
                    scene.see_every_world();
                }
                scene.describe(Path::new(&daemon.scene_folder))?
            }
        };
        let model = described
            .compile()
            .map_err(|error| failed(error.to_string()))?;
        if model.hash() != daemon.model_hash {
            let (then, now) = (daemon.model_hash, model.hash());
            let release = env!("CARGO_PKG_VERSION");
            let cause = match daemon.release == release {
                true => {
                    "a robot file or a mesh of its scene has changed since; put back what it was"
                        .to_owned()
                }
                false => format!(
                    "a robot file or a mesh of its scene has changed since, or release {} makes another of it than \
                     ours, {release}; replay it with that one",
                    daemon.release
                ),
            };
            return Err(failed(format!(
                "is of another model ({then:016x}, here {now:016x}): {cause}"
            )));
        }
        let folder = Path::new(&daemon.scene_folder);
        let sight = Sight::open(&scene, folder, &described, &model, &asked.images)?;
        let options = Options {
            device,
            compile_limit: compile_limit()?,
            worlds: daemon.worlds,
            first_world: daemon.first_world,
            cpu_bits: daemon.cpu_bits,
            precision: match daemon.precision.as_str() {
                "f64" => Precision::F64,
                _ => Precision::F32,
            },
            threads,
            lanes: Lanes::Auto,
            fields: asked.fields.clone(),
            faults: Faults {
                joint_q_max: daemon.joint_q_max.unwrap_or(f64::INFINITY),
                joint_qd_max: daemon.joint_qd_max.unwrap_or(f64::INFINITY),
                resets: daemon.on_fault == "reset",
                freezes_nan: daemon.on_nan == "freeze",
            },
            draws: Draws::named(&daemon.draws)
                .ok_or_else(|| failed(format!("draws by `{}`, unknown here", daemon.draws)))?,
            outputs_at: OutputsAt::named(&daemon.outputs_at).ok_or_else(|| {
                failed(format!("outputs at `{}`, unknown here", daemon.outputs_at))
            })?,
            ..Options::default()
        };
        // a head may claim any number of worlds; the state of all of them is in the file
        if state_min(&model, &options) > most_records(bytes) {
            return Err(failed(format!(
                "has {} worlds in its head, more than its {bytes} bytes can hold; it was cut or forged",
                daemon.worlds
            )));
        }
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let images = Images::new(sight, &Simulation::layout_of(&model, &options))?;
        let frame = (images.arena_bytes() as u64)
            .saturating_add(images.memory_bytes(threads.unwrap_or_else(cores)));
        let needed = frame.saturating_add(Simulation::memory_of(&model, &options));
        let free = free_memory();
        if needed > free {
            return Err(failed(format!(
                "needs {needed} bytes of memory and {free} bytes are free; end other programs"
            )));
        }
        let simulation =
            Simulation::new(model, &options).map_err(|error| failed(error.to_string()))?;
        let (first_world, resets) = (options.first_world, options.faults.resets);
        let eyes = Eyes::alone(&images, &simulation, first_world, resets)?;
        let info = RunInfo {
            scene: &described,
            scene_text: String::new(),
            scene_folder: String::new(),
            device: String::new(),
            threads: 1,
            frames_held: 1,
            watch_worlds: 1,
            images: &images,
        };
        // what commands may have follows from the model, whatever the head says
        let description =
            export::description(simulation.model(), &options, simulation.layout(), info);
        Ok(Run {
            inbox: Inbox::for_commands_of(&description),
            mask: Vec::with_capacity(daemon.worlds),
            simulation,
            eyes,
            has_state: false,
        })
    }

    /// A state of all worlds.
    pub(super) fn restore(&mut self, path: &Path, state: &[u8]) -> Result<(), DaemonError> {
        let restored = self.simulation.restore(state, None, None);
        restored.map_err(|error| unreadable(path, error.to_string()))?;
        self.eyes.forget();
        self.has_state = true;
        Ok(())
    }

    /// Sets the inputs of command number `frame` and returns how to go on; nothing if it made no frame.
    pub(super) fn command(
        &mut self,
        path: &Path,
        command: &RecordedCommand<'_>,
        frame: u64,
    ) -> Result<Option<Advance>, DaemonError> {
        let refused = |problem: String| {
            let problem =
                format!("frame {frame}: a command that was carried out is refused: {problem}");
            unreadable(path, problem)
        };
        let header = CommandHeader {
            op: command.op,
            rows: command.rows,
            ..CommandHeader::default()
        };
        self.inbox.take(header, command.words).map_err(refused)?;
        let advance = match self.op() {
            // the state that came before is what the restore has left; a snapshot or a question changes nothing, and the steps
            // of a rollout came before
            Op::Restore | Op::Snapshot | Op::Ik | Op::Rollout => Advance::Forward,
            _ => export::apply(&mut self.simulation, &self.inbox, &mut self.mask)
                .map_err(|refusal| refused(refusal.reason))?,
        };
        Ok((!command.digests.is_empty()).then_some(advance))
    }

    /// What the last command was.
    pub(super) fn op(&self) -> Op {
        self.inbox.op()
    }

    /// Names of the arrays of the last command.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        self.inbox.arrays().map(|row| row.name.clone())
    }

    /// Goes on, and writes a frame.
    pub(super) fn advance(&mut self, advance: Advance, arena: &mut [u64]) {
        match advance {
            Advance::Step => self.simulation.step(arena),
            Advance::Forward => self.simulation.forward(arena),
        }
        self.eyes.draw(&self.simulation, arena, true);
    }
}

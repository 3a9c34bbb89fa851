//! Fields of worlds at a state that a daemon shows, whatever its own frames carry.

use std::path::Path;

use sim_engine::simulation::{Draws, Options, Precision, Simulation};

use sim_protocol::ProtocolError;
use sim_protocol::host::free_memory;

use crate::config;
use crate::error::DaemonError;
use crate::export::arrays::Arrays;
use crate::eyes::{Eyes, FrameFields, Images, Sight};

/// What the draws of a daemon's worlds depend on, as its description has it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drawn {
    /// World number of the first world.
    pub first_world: usize,
    /// Whether draws depend on the world's number.
    pub draws: Draws,
    /// Whether worlds are reset after a fault.
    pub resets: bool,
}

/// Worlds of a scene that are set to given states and evaluated, in this process and on one thread.
pub struct Evaluation {
    simulation: Simulation,
    eyes: Eyes,
    arrays: Arrays,
}

impl Evaluation {
    /// So many worlds of a scene as TOML, with paths relative to a folder, and frames of the fields asked for.
    ///
    /// # Errors
    /// A scene that is not valid, or whose files cannot be read; memory.
    pub fn new(
        scene: &str,
        folder: &Path,
        worlds: usize,
        precision: Precision,
        asked: &FrameFields,
        drawn: Drawn,
    ) -> Result<Evaluation, DaemonError> {
        let mut scene = config::parse(scene, "scene")?;
        scene.cameras.extend(asked.cameras.iter().cloned());
        scene.see_every_world();
        let description = scene.describe(folder)?;
        let model = description.compile()?;
        let sight = Sight::open(&scene, folder, &description, &model, &asked.images)?;
        let options = Options {
            worlds,
            precision,
            threads: Some(1),
            first_world: drawn.first_world,
            draws: drawn.draws,
            fields: asked.fields.clone(),
            // it never steps
            compiles: false,
            ..Options::default()
        };
        let images = Images::new(sight, &Simulation::layout_of(&model, &options))?.unkept();
        let needed = (images.arena_bytes() as u64)
            .saturating_add(images.memory_bytes(1))
            .saturating_add(Simulation::memory_of(&model, &options));
        let free = free_memory();
        if needed > free {
            let what = format!("to evaluate {worlds} worlds");
            return Err(ProtocolError::Memory { free, needed, what }.into());
        }
        let simulation = Simulation::new(model, &options)?;
        let eyes = Eyes::alone(&images, &simulation, drawn.first_world, drawn.resets)?;
        Ok(Evaluation {
            arrays: Arrays::new(&simulation, eyes.images()),
            simulation,
            eyes,
        })
    }

    /// Hash of the scene's model, as in a daemon's description.
    pub fn model_hash(&self) -> u64 {
        self.simulation.model().hash()
    }

    /// The fields at the state of the first worlds of a snapshot, which has as many or more.
    ///
    /// # Errors
    /// Bytes that are no snapshot of such worlds.
    pub fn evaluate(&mut self, state: &[u8]) -> Result<&Arrays, DaemonError> {
        let restored = self.simulation.restore_first(state);
        restored.map_err(|error| DaemonError::State {
            problem: error.to_string(),
        })?;
        self.simulation.forward(self.arrays.arena());
        self.eyes.draw(&self.simulation, self.arrays.arena(), false);
        Ok(&self.arrays)
    }
}

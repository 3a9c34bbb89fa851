//! Fields of worlds at a state that a daemon shows, whatever its own frames carry.

use std::path::Path;

use sim_engine::simulation::{Options, Precision, Simulation};

use crate::config;
use crate::error::DaemonError;
use crate::export::arrays::Arrays;
use crate::eyes::{Eyes, FrameFields, Images, Sight};

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
    ) -> Result<Evaluation, DaemonError> {
        let mut scene = config::parse(scene, "scene")?;
        scene.cameras.extend(asked.cameras.iter().cloned());
        let description = scene.describe(folder)?;
        let model = description.compile()?;
        let sight = Sight::open(&scene, folder, &description, &model, &asked.images)?;
        let options = Options {
            worlds,
            precision,
            threads: Some(1),
            fields: asked.fields.clone(),
            // it never steps
            compiles: false,
            ..Options::default()
        };
        let simulation = Simulation::new(model, &options)?;
        let eyes = Eyes::alone(&Images::new(sight, simulation.layout())?, &simulation)?;
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
        self.eyes.draw(&self.simulation, self.arrays.arena());
        Ok(&self.arrays)
    }
}

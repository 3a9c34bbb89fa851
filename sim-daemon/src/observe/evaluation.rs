//! Fields of worlds at a state that a daemon shows, whatever its own frames carry.

use std::path::Path;

use sim_engine::simulation::{Options, Precision, Simulation};
use sim_physics::arrays::Field;

use crate::config;
use crate::error::DaemonError;
use crate::export::arrays::Arrays;

/// Worlds of a scene that are set to given states and evaluated, in this process and on one thread.
pub struct Evaluation {
    simulation: Simulation,
    arrays: Arrays,
}

impl Evaluation {
    /// So many worlds of a scene as TOML, with paths relative to a folder, and frames of `fields`.
    ///
    /// # Errors
    /// A scene that is not valid, or whose files cannot be read; memory.
    pub fn new(
        scene: &str,
        folder: &Path,
        worlds: usize,
        precision: Precision,
        fields: &[Field],
    ) -> Result<Evaluation, DaemonError> {
        let model = config::parse(scene, "scene")?.describe(folder)?.compile()?;
        let options = Options {
            worlds,
            precision,
            threads: Some(1),
            fields: fields.to_vec(),
            // it never steps
            compiles: false,
            ..Options::default()
        };
        let simulation = Simulation::new(model, &options)?;
        Ok(Evaluation {
            arrays: Arrays::new(&simulation),
            simulation,
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
        Ok(&self.arrays)
    }
}

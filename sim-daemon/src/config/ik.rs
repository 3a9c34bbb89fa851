//! Inverse kinematics of a model: which frames are to reach targets, by names.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use sim_ik::{IkError, Reach, Solver, Task, frame};
use sim_model::Model;

use super::error::ConfigError;
use super::scene::SceneFile;

/// A frame that is to reach targets, by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IkReach {
    /// A link or site.
    pub frame: String,
    /// The link or site that its targets are measured from; none for the world.
    pub relative_to: Option<String>,
    /// Weights of the position error along three axes [1/m].
    pub position_weight: [f64; 3],
    /// Weights of the rotation error along three axes [1/rad].
    pub orientation_weight: [f64; 3],
}

/// What inverse kinematics is asked for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IkTask {
    /// Frames that are to reach targets.
    pub reaches: Vec<IkReach>,
    /// Whether each dof may move.
    pub moves: Vec<bool>,
    /// Whether joints keep within their limits.
    pub limits: bool,
    /// Weight of each dof's distance from its reference [1/rad or 1/m].
    pub posture_weight: Vec<f64>,
}

impl IkTask {
    /// What solves it on a model.
    ///
    /// # Errors
    /// A frame that is not there or does not move, limits that exclude each other, lists of other lengths.
    pub fn solver(&self, model: &Arc<Model>) -> Result<Solver, IkError> {
        let mount = |name: &String| frame(model, name);
        let reaches = self.reaches.iter().map(|reach| {
            Ok(Reach {
                name: reach.frame.clone(),
                frame: mount(&reach.frame)?,
                relative_to: reach.relative_to.as_ref().map(mount).transpose()?,
                position_weight: reach.position_weight,
                orientation_weight: reach.orientation_weight,
            })
        });
        let task = Task {
            reaches: reaches.collect::<Result<_, IkError>>()?,
            moves: self.moves.clone(),
            limits: self.limits,
            posture_weight: self.posture_weight.clone(),
        };
        Solver::new(Arc::clone(model), &task)
    }
}

impl SceneFile {
    /// The model of the scene; paths as in [`SceneFile::describe`].
    ///
    /// # Errors
    /// As [`SceneFile::describe`], and a mass matrix that cannot be factored.
    pub fn model(&self, base_dir: &Path) -> Result<Arc<Model>, ConfigError> {
        Ok(self.describe(base_dir)?.compile()?)
    }
}

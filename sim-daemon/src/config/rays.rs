//! What rays meet in a scene: the geoms of its MuJoCo models.

use std::collections::HashMap;
use std::path::Path;

use sim_model::ray_scene::RayScene;

use super::error::ConfigError;
use super::scene::SceneFile;

impl SceneFile {
    /// The geoms of the scene's MuJoCo models, one model after the other; paths as in [`SceneFile::describe`].
    ///
    /// `first_bodies` has the place of each model's first body among those of the scene, by the model's name.
    ///
    /// # Errors
    /// A model that cannot be read.
    pub fn rays(
        &self,
        base_dir: &Path,
        first_bodies: &HashMap<String, usize>,
    ) -> Result<RayScene, ConfigError> {
        let mut scene = RayScene::default();
        for table in &self.mujoco {
            let first = first_bodies.get(&table.name).copied().unwrap_or(0);
            scene.add_mujoco(base_dir.join(&table.model), &table.name, first)?;
        }
        Ok(scene)
    }
}

//! Mocap bodies of MuJoCo models.

use super::bodies::BodyBuilder;
use super::carrier::Carrier;
use crate::pose::Pose;
use sim_physics::constants::{Body, Motion, Tree};

impl BodyBuilder {
    /// A body that clients place, and that begins at `at`; in a tree of its own.
    pub(super) fn add_mocap(&mut self, at: Carrier) -> Carrier {
        let base = self.trees[at.tree].base;
        let [x, y, z, w] = at.pose.quat;
        let start = &mut self.start;
        start
            .mocap_pos
            .extend(base.iter().zip(at.pose.pos).map(|(base, x)| base + x));
        start.mocap_quat.extend([w, x, y, z]);
        self.trees.push(Tree {
            base: [0.0; 3],
            free: None,
        });
        self.bodies.push(Body {
            motion: Motion::Mocap,
            parent: None,
            tree: self.trees.len() - 1,
            dof: self.dofs.len(),
            coord: self.mocaps,
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            exchange: None,
            quat: Pose::identity().quat,
            position: [0.0; 3],
            mass: 0.0,
            center: [0.0; 3],
            inertia: [0.0; 6],
            parts: Vec::new(),
        });
        self.mocaps += 1;
        Carrier {
            body: Some(self.bodies.len() - 1),
            tree: self.trees.len() - 1,
            pose: Pose::identity(),
        }
    }
}

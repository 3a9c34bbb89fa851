//! What a solver is asked for.

use sim_physics::constants::site::Mount;

/// A frame that is to reach a target.
#[derive(Clone, Debug)]
pub struct Reach {
    /// Its name, for messages.
    pub name: String,
    /// Where it is.
    pub frame: Mount<f64>,
    /// What its target is measured from; none for the world.
    pub relative_to: Option<Mount<f64>>,
    /// Weights of the position error along the axes of what it is measured from [1/m].
    pub position_weight: [f64; 3],
    /// Weights of the rotation vector from the target, along the target's axes [1/rad].
    pub orientation_weight: [f64; 3],
}

/// Frames that are to reach targets, and what may move.
#[derive(Clone, Debug)]
pub struct Task {
    /// The frames.
    pub reaches: Vec<Reach>,
    /// Whether each dof may move.
    pub moves: Vec<bool>,
    /// Whether joints keep within their limits.
    pub limits: bool,
    /// Weight of each dof's distance from its reference; 0 for none [1/rad or 1/m].
    pub posture_weight: Vec<f64>,
}

//! Errors of a state in double precision, whatever precision found it.

use crate::measure::{Target, apart, missing, place, squares};
use crate::tables::Tables;
use sim_physics::arrays::Block;

/// What evaluates states.
pub struct Checker {
    block: Block<f64, f64>,
    slopes: Vec<f64>,
}

/// Errors of a state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    /// Largest distance of a frame of the task from its target [m].
    pub position: f64,
    /// Largest angle between a frame of the task and its target [rad].
    pub rotation: f64,
    /// The same of what the model ties together; a length counts as a position [m, rad].
    pub tied: [f64; 2],
}

impl Errors {
    /// Are they within tolerances?
    pub fn within(&self, [position, rotation]: [f64; 2]) -> bool {
        self.position.max(self.tied[0]) <= position && self.rotation.max(self.tied[1]) <= rotation
    }

    /// The largest as a multiple of its tolerance.
    pub fn worst(&self, [position, rotation]: [f64; 2]) -> f64 {
        let position = self.position.max(self.tied[0]) / position;
        position.max(self.rotation.max(self.tied[1]) / rotation)
    }
}

impl Checker {
    /// For a plan.
    pub fn new(t: &Tables<f64>) -> Checker {
        Checker {
            block: t.block(),
            slopes: vec![0.0; t.followers.len()],
        }
    }

    /// Errors of the frames at a state. The first `own_reaches` frames are of the task.
    #[inline(always)]
    pub fn errors(
        &mut self,
        t: &Tables<f64>,
        q: &[f64],
        targets: &[Target<f64>],
        own_reaches: usize,
    ) -> Errors {
        for &c in &t.coords {
            self.block.joint_q[c] = q[c];
        }
        place(t, &mut self.block, &mut self.slopes);
        let mut errors = Errors::default();
        for (k, (reach, target)) in t.reaches.iter().zip(targets).enumerate() {
            let deviation = apart(reach, &self.block.work, target);
            let [position, rotation] = squares(reach, &deviation).map(f64::sqrt);
            let at = match k < own_reaches {
                true => [&mut errors.position, &mut errors.rotation],
                false => {
                    let [position, rotation] = &mut errors.tied;
                    [position, rotation]
                }
            };
            for (worst, error) in at.into_iter().zip([position, rotation]) {
                // a state that overflows is no solution
                *worst = if error.is_nan() {
                    f64::INFINITY
                } else {
                    worst.max(error)
                };
            }
        }
        for length in &t.lengths {
            let (error, _) = missing(length, &self.block.joint_q);
            errors.tied[0] = errors.tied[0].max(error.abs());
        }
        errors
    }
}

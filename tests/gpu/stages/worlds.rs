//! Worlds that stages are run on, one after the other.

use crate::common::cases::Case;
use crate::common::dice::Dice;
use sim_physics::arrays::{Array, Block, Flat};
use sim_physics::constants::Constants;
use sim_physics::math::factor::multiply;
use sim_physics::step::StageId;

/// Input of a stage in a world: the values that it reads, and scratch memory.
pub struct Given {
    pub numbers: Vec<f64>,
    pub memory: Vec<f64>,
}

/// What it leaves: the numbers of what it writes, and that memory.
#[derive(Default)]
pub struct Left {
    pub numbers: Vec<f64>,
    pub memory: Vec<f64>,
}

/// Values of some worlds, from any backend.
pub struct Worlds {
    blocks: Vec<Block<f64, f64>>,
    memory: Vec<Vec<f64>>,
}

impl Worlds {
    /// Random states of a case.
    pub fn random(case: &Case, worlds: usize) -> Worlds {
        let mut dice = Dice::new(1);
        let block = |_| {
            let mut state = case.random_state(|| dice.number());
            let mut block = Block::new(&case.m, 0.0);
            for &array in Array::ALL {
                let from = numbers(state.array_mut(array)).iter();
                for (to, x) in numbers(block.array_mut(array)).iter_mut().zip(from) {
                    *to = f64::from(*x);
                }
            }
            block
        };
        Worlds {
            blocks: (0..worlds).map(block).collect(),
            memory: vec![vec![0.0; case.m.contacts.memory.len]; worlds],
        }
    }

    /// What a stage reads.
    pub fn given(&mut self, stage: StageId) -> Vec<Given> {
        (self.blocks.iter_mut().zip(&self.memory))
            .map(|(block, memory)| Given {
                numbers: (stage.reads().iter())
                    .flat_map(|array| numbers(block.array_mut(*array)).to_vec())
                    .collect(),
                memory: memory.clone(),
            })
            .collect()
    }

    /// What `integrate` reads, with M q̈ - smooth for the constraint forces of worlds that touch: in `f32` it takes what
    /// acts from M q̈, since stiff forces cancel and leave their rounding.
    pub fn given_uncancelled(&mut self, m: &Constants<f32>) -> Vec<Given> {
        let kept: Vec<Vec<f64>> = (self.blocks.iter_mut().zip(&self.memory))
            .map(|(block, memory)| {
                let kept = block.constraint_force.clone();
                let classes = m.contacts.classes.len();
                let counts = &memory[m.contacts.memory.counts.base..][..classes];
                if counts.iter().any(|count| *count > 0.0) {
                    let work = &block.work;
                    let force = &mut block.constraint_force;
                    multiply(&m.pattern, &work.mass_matrix, &block.joint_qdd, force);
                    for (force, smooth) in force.iter_mut().zip(&work.smooth_force) {
                        *force -= smooth;
                    }
                }
                kept
            })
            .collect();
        let given = self.given(StageId::named("integrate").expect("a stage"));
        for (block, kept) in self.blocks.iter_mut().zip(kept) {
            block.constraint_force = kept;
        }
        given
    }

    /// Goes on with what a stage left.
    pub fn take(&mut self, stage: StageId, left: &[Left]) {
        let worlds = self.blocks.iter_mut().zip(&mut self.memory);
        for ((block, memory), left) in worlds.zip(left) {
            let mut from = left.numbers.iter();
            for array in stage.writes() {
                for (to, x) in numbers(block.array_mut(*array)).iter_mut().zip(&mut from) {
                    *to = *x;
                }
            }
            memory.clone_from(&left.memory);
        }
    }

    /// Worlds whose accelerations `f32` leaves to `accelerations`: limits are all that could act, and none does.
    pub fn passed_over(&mut self, m: &Constants<f32>, stage: StageId) -> Vec<bool> {
        let may_be = matches!(stage.name(), "solver" | "solver_turning" | "refine")
            && m.equalities.is_empty()
            && m.frictions.is_empty()
            && m.contacts.classes.is_empty();
        let idle = |block: &mut Block<f64, f64>| {
            may_be && block.efc_weight.iter().all(|weight| *weight == 0.0)
        };
        self.blocks.iter_mut().map(idle).collect()
    }
}

/// The scalars of an array.
pub fn numbers<'a, F>(of: Flat<&'a mut [F], &'a mut [F]>) -> &'a mut [F] {
    match of {
        Flat::Cells(x) | Flat::Values(x) => x,
    }
}

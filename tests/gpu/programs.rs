//! Random programs on random scenes (tests/interventions.rs) on a GPU: worlds do not notice each other, nor their number.

use crate::common::any_program::{Scope, any_program};
use crate::common::any_scene::any_scene;
use crate::common::dice::Dice;
use crate::common::program::{Op, play};
use crate::{gpu, options};
use sim_engine::simulation::{Draws, Faults, Options};
use sim_physics::arrays::Field;

/// Each is a program of its own for the driver, which takes seconds.
const CASES: usize = 3;

#[test]
fn a_world_alone_is_the_world_among_others() {
    let mut cases = 0;
    for seed in 1.. {
        let mut dice = Dice::new(seed);
        let Ok(model) = any_scene(&mut dice, true).compile() else {
            continue;
        };
        // a driver takes long over the searches of hulls
        if model.constants().contacts.hulls.spans.rows > 0 {
            continue;
        }
        let worlds = 5;
        let options = Options {
            faults: Faults {
                resets: dice.chance(0.5),
                ..Faults::default()
            },
            // a world is then a function of its seed wherever it stands
            draws: Draws::Seed,
            ..options(gpu(), worlds, Field::ALL)
        };
        let scope = Scope {
            model: &model,
            worlds: vec![true; worlds],
            sources: (0..worlds).collect(),
            first_kept: 0,
            huge: dice.chance(0.3).then_some(1e38),
        };
        let ops = any_program(&mut dice, &scope, 4);
        // a snapshot of five worlds is not one of one
        let ops: Vec<Op> = (ops.into_iter())
            .filter(|op| !matches!(op, Op::Restore(..)))
            .collect();
        let seeds: Vec<u64> = (0..worlds as u64).map(|w| 100 + w).collect();
        let all = vec![Op::Reset(vec![true; worlds], Some(seeds))];
        let ops: Vec<Op> = all.into_iter().chain(ops).collect();
        let together = play(&model, &options, &ops).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let alone: Vec<Op> = ops.iter().map(|op| op.for_worlds(&[3])).collect();
        let single = Options {
            worlds: 1,
            ..options.clone()
        };
        let alone = play(&model, &single, &alone).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        together
            .differs(3, &alone, 0)
            .unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        cases += 1;
        if cases == CASES {
            break;
        }
    }
}

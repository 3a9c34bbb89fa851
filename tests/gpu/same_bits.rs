//! A world's bits on a GPU: whatever their number, its place, and the run.

use crate::common::grouped::assert_groups_are_the_whole;
use crate::common::{Demo, Run, command, lesson, lesson_with_table, noise};
use crate::{assert_alive, gpu, options, run};
use sim_engine::backend::Values;
use sim_model::Model;
use sim_physics::arrays::Field;
use std::sync::Arc;

const FIELDS: [Field; 4] = [Field::JointQ, Field::JointQd, Field::JointQdd, Field::BodyQ];

/// Bits of each world after some frames; world w starts and is driven by `seeds[w]`.
fn bits(model: &Arc<Model>, demo: Demo, seeds: &[usize], frames: usize) -> Vec<Vec<u64>> {
    let worlds = seeds.len();
    let mut run: Run = run(model, gpu(), worlds, &FIELDS);
    let rows = |scale: f64, base: &[f64], salt: usize| -> Vec<f64> {
        let row = |&seed: &usize| {
            (base.iter().enumerate()).map(move |(j, x)| x + scale * noise(seed, salt + j))
        };
        seeds.iter().flat_map(row).collect()
    };
    let q = rows(0.1, &model.start().joint_q[..9], 0);
    run.sim
        .write(Field::JointQ, 0..9, Values::F64(&q), None)
        .unwrap();
    for frame in 0..frames {
        let (field, row) = command(demo, frame);
        let values = rows(0.1, &row[..9], 100 * (frame + 1));
        run.sim.command(field, 0..9, Values::F64(&values)).unwrap();
        run.step();
    }
    assert_alive(&run);
    (0..worlds)
        .map(|world| {
            let numbers = FIELDS.iter().flat_map(|field| run.get(*field, world));
            numbers.map(f64::to_bits).collect()
        })
        .collect()
}

fn check(model: &Arc<Model>, demo: Demo, frames: usize) {
    let many: Vec<usize> = (0..4096).collect();
    let all = bits(model, demo, &many, frames);
    assert!(
        all == bits(model, demo, &many, frames),
        "a second run differs"
    );
    let few: Vec<usize> = vec![4095, 17, 0, 2048, 63, 64, 1];
    for (seed, world_bits) in few.iter().zip(bits(model, demo, &few, frames)) {
        assert_eq!(world_bits, all[*seed], "world {seed} of 4096 among seven");
    }
    assert_eq!(bits(model, demo, &[1234], frames)[0], all[1234], "alone");
    assert_ne!(all[0], all[1]);
}

#[test]
fn a_world_of_the_lesson_is_the_same_among_1_7_and_4096_and_in_every_run() {
    check(&lesson(Demo::Target).compile().unwrap(), Demo::Target, 12);
}

#[test]
fn a_world_of_the_grasp_is_the_same_among_1_7_and_4096_and_in_every_run() {
    let model = lesson_with_table(Demo::Target, true).compile().unwrap();
    check(&model, Demo::Target, 3);
}

#[test]
fn worlds_that_do_not_fit_into_one_binding_are_no_different() {
    let model = lesson(Demo::Target).compile().unwrap();
    let few = [39_999, 0, 20_000, 19_999];
    let many: Vec<usize> = (0..40_000).collect();
    let all = bits(&model, Demo::Target, &many, 2);
    for (seed, world_bits) in few.iter().zip(bits(&model, Demo::Target, &few, 2)) {
        assert_eq!(world_bits, all[*seed], "world {seed} of 40000 among four");
    }
}

#[test]
fn groups_have_the_bits_of_all_worlds_together() {
    assert_groups_are_the_whole(options(gpu(), 5, &[]), 2);
}

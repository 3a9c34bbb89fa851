//! Resets: which worlds they start anew, under which seed, and whom they leave alone.

mod common;

use common::Run;
use common::drawn::{STATE, launched, model, options};
use sim_engine::backend::{BackendError, Values, cpu};
use sim_engine::simulation::{Lanes, Precision};
use sim_physics::arrays::Field;

/// Bits of the state of each world.
fn bits(run: &Run) -> Vec<Vec<u64>> {
    let state_of = |world| STATE.iter().flat_map(move |&field| run.get(field, world));
    (0..run.sim.worlds())
        .map(|world| state_of(world).map(f64::to_bits).collect())
        .collect()
}

/// Bits of the state after a reset.
fn reset(run: &mut Run, mask: Option<&[bool]>, seed: Option<&[u64]>) -> Vec<Vec<u64>> {
    run.sim.reset(mask, seed).unwrap();
    run.forward();
    bits(run)
}

#[test]
fn a_start_is_the_same_for_any_number_of_worlds_lanes_and_threads() {
    let model = model();
    let mut reference = Run::new(&model, options(4096, Precision::F32, Lanes::Auto, 1));
    let many = reset(&mut reference, None, Some(&[77]));
    let mut distinct = many.clone();
    distinct.sort();
    distinct.dedup();
    assert_eq!(
        distinct.len(),
        many.len(),
        "each world has a start of its own"
    );
    for worlds in [1, 17, 4096] {
        for (lanes, threads) in [
            (Lanes::Scalar, 1),
            (Lanes::Scalar, 2),
            (Lanes::Eight, 1),
            (Lanes::Sixteen, 2),
        ] {
            if !cpu::available(lanes) {
                println!("skipped: this processor has no {lanes:?}");
                continue;
            }
            let mut run = Run::new(&model, options(worlds, Precision::F32, lanes, threads));
            let started = reset(&mut run, None, Some(&[77]));
            assert!(
                started == many[..worlds],
                "{worlds} worlds, {lanes:?}, {threads} threads"
            );
        }
    }
}

#[test]
fn a_seed_gives_the_same_episodes_again_and_each_another_start() {
    let model = model();
    for precision in [Precision::F32, Precision::F64] {
        let mut run = launched(&model, 20, precision);
        let mut seen = vec![bits(&run)];
        for _ in 0..3 {
            run.step();
            seen.push(reset(&mut run, None, None));
        }
        for (episode, state) in seen.iter().enumerate() {
            for other in &seen[..episode] {
                assert!(state.iter().zip(other).all(|(a, b)| a != b), "{episode}");
            }
        }
        // a launch is episode 0 of seed 0
        assert!(reset(&mut run, None, Some(&[0])) == seen[0]);
        for state in &seen[1..] {
            assert!(reset(&mut run, None, None) == *state);
        }
        let other = reset(&mut run, None, Some(&[u64::MAX]));
        assert!(other.iter().zip(&seen[0]).all(|(a, b)| a != b));
    }
}

#[test]
fn each_world_can_have_a_seed_of_its_own() {
    let model = model();
    let mut run = launched(&model, 20, Precision::F32);
    let seeds: Vec<u64> = (0..20).map(|world| world % 3).collect();
    let starts: Vec<_> = (0..3)
        .map(|seed| reset(&mut run, None, Some(&[seed])))
        .collect();
    let mixed = reset(&mut run, None, Some(&seeds));
    for world in 0..20 {
        assert_eq!(mixed[world], starts[world % 3][world], "world {world}");
    }
}

#[test]
fn a_partial_reset_leaves_the_other_worlds_untouched_then_and_later() {
    let model = model();
    for (precision, lanes) in [
        (Precision::F32, Lanes::Auto),
        (Precision::F32, Lanes::Scalar),
        (Precision::F64, Lanes::Auto),
    ] {
        let mask: Vec<bool> = (0..45).map(|world| world % 7 == 3 || world == 44).collect();
        let mut runs = [0; 2].map(|_| Run::new(&model, options(45, precision, lanes, 2)));
        let push = vec![0.2; 45 * model.dofs()];
        for run in &mut runs {
            let dofs = 0..model.dofs();
            run.sim
                .command(Field::JointF, dofs, Values::F64(&push))
                .unwrap();
            run.step();
            run.step();
            run.forward();
        }
        let [plain, reset] = &mut runs;
        reset.sim.reset(Some(&mask), None).unwrap();
        reset.forward();
        for frame in 0..4 {
            for (world, (a, b)) in bits(plain).iter().zip(&bits(reset)).enumerate() {
                assert_eq!(a != b, mask[world], "world {world}, frame {frame}");
            }
            plain.step();
            reset.step();
        }
        // worlds that were left alone are still in their first episode
        let after = crate::reset(reset, None, None);
        let mut counted = launched(&model, 45, precision);
        let first = crate::reset(&mut counted, None, None);
        let second = crate::reset(&mut counted, None, None);
        for world in 0..45 {
            let expected = if mask[world] { &second } else { &first };
            assert_eq!(after[world], expected[world], "world {world}");
        }
    }
}

#[test]
fn a_world_that_is_reset_moves_as_a_new_one_does() {
    let model = model();
    for precision in [Precision::F32, Precision::F64] {
        let mut old = launched(&model, 20, precision);
        let push = vec![0.3; 20 * model.dofs()];
        let dofs = 0..model.dofs();
        old.sim
            .command(Field::JointF, dofs, Values::F64(&push))
            .unwrap();
        for _ in 0..5 {
            old.step();
        }
        // warm start, rests, forces and counters as at the launch
        old.sim.reset(None, Some(&[0])).unwrap();
        let mut new = launched(&model, 20, precision);
        for _ in 0..5 {
            old.step();
            new.step();
            assert!(bits(&old) == bits(&new));
        }
        assert!(old.arena == new.arena, "time, step and status too");
    }
}

#[test]
fn seeds_of_a_wrong_number_are_refused_and_nothing_is_reset() {
    let model = model();
    let mut run = launched(&model, 5, Precision::F32);
    run.step();
    run.forward();
    let before = bits(&run);
    for seeds in [&[][..], &[1, 2], &[0; 6]] {
        let refused = run.sim.reset(None, Some(seeds));
        let got = seeds.len();
        assert_eq!(refused, Err(BackendError::Seeds { got, worlds: 5 }));
    }
    run.forward();
    assert!(bits(&run) == before);
}

//! What draws depend on. By seeds alone, worlds of one seed are alike wherever they are; by their number they are not, and have it in
//! whatever group they are.

mod common;

use common::Run;
use common::grouped::{FIELDS, assert_groups_are_the_whole, scene};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Draws, Lanes, Options, Precision};
use sim_physics::arrays::Field;

/// Seeds of 21 worlds, three of which have that of world 5: in its block of eight, of sixteen, and in none of them.
const SEEDS: [u64; 21] = [
    10, 11, 12, 13, 14, 1234, 16, 1234, 18, 19, 20, 21, 22, 1234, 24, 25, 26, 27, 28, 29, 1234,
];
const ALIKE: [usize; 4] = [5, 7, 13, 20];

fn options(worlds: usize, precision: Precision, lanes: Lanes, draws: Draws) -> Options {
    Options {
        draws,
        ..common::options(&FIELDS, worlds, precision, lanes, 2)
    }
}

/// Three episodes under the seeds; of each world the bits of all fields in all frames, and of its parameters.
fn play(run: &mut Run, seeds: &[u64]) -> Vec<Vec<u64>> {
    let mut bits = vec![Vec::new(); run.sim.worlds()];
    run.sim.reset(None, Some(seeds)).unwrap();
    for episode in 0..3 {
        if episode > 0 {
            run.sim.reset(None, None).unwrap();
        }
        for frame in 0..4 {
            if frame == 0 {
                run.forward();
            } else {
                run.step();
            }
            for (world, bits) in bits.iter_mut().enumerate() {
                for field in FIELDS {
                    bits.extend(run.get(field, world).iter().map(|x| x.to_bits()));
                }
            }
        }
        for param in run.sim.model().clone().constants().varying.params() {
            let numbers = run.sim.param(param).unwrap();
            let columns = numbers.len() / bits.len();
            for (bits, row) in bits.iter_mut().zip(numbers.chunks_exact(columns)) {
                bits.extend(row.iter().map(|x| x.to_bits()));
            }
        }
    }
    bits
}

#[test]
fn worlds_of_one_seed_are_alike_wherever_they_are() {
    let model = scene().compile().unwrap();
    for (precision, lanes) in [
        (Precision::F64, Lanes::Scalar),
        (Precision::F32, Lanes::Scalar),
        (Precision::F32, Lanes::Eight),
        (Precision::F32, Lanes::Sixteen),
    ] {
        if !cpu::available(lanes) {
            println!("skipped: this processor has no {lanes:?}");
            continue;
        }
        let play = |seeds: &[u64], lanes, draws| {
            let mut run = Run::new(&model, options(seeds.len(), precision, lanes, draws));
            play(&mut run, seeds)
        };
        let many = play(&SEEDS, lanes, Draws::Seed);
        let alone = play(&[1234], Lanes::Scalar, Draws::Seed);
        for (world, bits) in many.iter().enumerate() {
            assert!(
                (*bits == alone[0]) == ALIKE.contains(&world),
                "world {world}, {precision:?}, {lanes:?}"
            );
        }
        // by their number they differ, but for world 0, for whose number 0 stands
        let by_number = play(&SEEDS, lanes, Draws::World);
        for (world, bits) in by_number.iter().enumerate() {
            assert_eq!(*bits == many[world], world == 0, "world {world}");
            assert!(*bits != alone[0], "world {world}");
        }
    }
}

#[test]
fn one_seed_for_all_makes_all_worlds_equal_and_so_does_a_launch() {
    let model = scene().compile().unwrap();
    let mut run = Run::new(
        &model,
        options(21, Precision::F32, Lanes::Auto, Draws::Seed),
    );
    run.forward();
    let start = |run: &Run, world| {
        (
            run.get(Field::JointQ, world),
            run.get(Field::JointQd, world),
        )
    };
    let launched = start(&run, 0);
    assert!((1..21).all(|world| start(&run, world) == launched));
    let all = play(&mut run, &[77]);
    assert!(all.iter().all(|bits| *bits == all[0]));
    // the episodes of a world are its own: one reset more, and it is where the others come to
    let only: Vec<bool> = (0..21).map(|world| world == 3).collect();
    run.sim.reset(Some(&only), None).unwrap();
    run.forward();
    let ahead = start(&run, 3);
    assert!(ahead != start(&run, 4));
    run.sim.reset(None, None).unwrap();
    run.forward();
    assert!(start(&run, 4) == ahead && start(&run, 3) != ahead);
}

#[test]
fn a_snapshot_goes_on_with_the_draws_of_its_seeds() {
    let model = scene().compile().unwrap();
    let mut run = Run::new(
        &model,
        options(21, Precision::F32, Lanes::Auto, Draws::Seed),
    );
    play(&mut run, &SEEDS);
    let snapshot = run.sim.snapshot();
    let mut on = |from: Option<usize>| {
        run.sim.restore(&snapshot, None, from).unwrap();
        let forces = vec![0.1; 21 * model.dofs()];
        let forces = Values::F64(&forces);
        run.sim
            .command(Field::JointF, 0..model.dofs(), forces)
            .unwrap();
        run.step();
        run.sim.reset(None, None).unwrap();
        run.step();
        (0..21)
            .map(|world| run.get(Field::JointQMeasured, world))
            .collect::<Vec<_>>()
    };
    let kept = on(None);
    // one world in all places goes on as it does in its own
    assert!(on(Some(13)).iter().all(|q| *q == kept[13]));
    assert!(kept[12] != kept[13]);
}

#[test]
fn groups_have_the_bits_of_all_worlds_together() {
    for (precision, draws, worlds) in [
        (Precision::F64, Draws::World, 3),
        // neither a whole register nor a whole block
        (Precision::F32, Draws::World, 21),
        (Precision::F32, Draws::Seed, 7),
    ] {
        for (groups, threads) in [(2, 3), (3, 1)] {
            let options = Options {
                threads: Some(threads),
                ..options(worlds, precision, Lanes::Auto, draws)
            };
            assert_groups_are_the_whole(options, groups);
        }
    }
}

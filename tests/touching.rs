//! Worlds whose shapes touch: the same bits wherever they are, and what does not fit is counted.

mod common;

use common::shapes::shapes;
use common::stones::stones;
use common::{Run, noise};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Cone, Description, Model};
use sim_physics::arrays::{Field, status};
use std::sync::Arc;

const FIELDS: [Field; 11] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::ConstraintForce,
    Field::ContactCount,
    Field::ContactPos,
    Field::ContactNormal,
    Field::ContactDistance,
    Field::ContactForce,
    Field::ContactPair,
    Field::BodyContactForce,
];
const FRAMES: usize = 15;

/// Worlds in which both bodies are somewhere else among the shapes that stand still, turned and moving; world w by `seeds[w]`.
fn started(model: &Arc<Model>, seeds: &[usize], options: Options) -> Run {
    let mut run = Run::new(
        model,
        Options {
            worlds: seeds.len(),
            ..options
        },
    );
    let start = &model.start().joint_q;
    let place = |seed: usize, k: usize| match k % 7 {
        0..3 => start[k] + 0.08 * noise(seed, k),
        6 => 1.0 + 0.5 * noise(seed, k),
        _ => noise(seed, k),
    };
    let rows = |columns: usize, number: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let row = |&seed: &usize| (0..columns).map(move |k| number(seed, k));
        seeds.iter().flat_map(row).collect()
    };
    let q = rows(14, &place);
    let qd = rows(12, &|seed, k| noise(seed, 100 + k));
    for (field, columns, rows) in [(Field::JointQ, 14, q), (Field::JointQd, 12, qd)] {
        run.sim
            .write(field, 0..columns, Values::F64(&rows), None)
            .unwrap();
    }
    run
}

fn bits(run: &Run, world: usize) -> Vec<u64> {
    let numbers = FIELDS.iter().flat_map(|&field| run.get(field, world));
    // on ARM, the compiler makes one instruction of a negated `fma` of scalars, which gives a zero the other sign
    let zero = if cfg!(target_arch = "aarch64") {
        0.0
    } else {
        -0.0
    };
    numbers.map(|x| (x + zero).to_bits()).collect()
}

/// Bits of all fields of each world in every frame.
fn motion(model: &Arc<Model>, seeds: &[usize], options: Options) -> Vec<Vec<u64>> {
    let mut run = started(model, seeds, options);
    let mut motion = vec![vec![]; seeds.len()];
    for _ in 0..FRAMES {
        run.step();
        for (world, motion) in motion.iter_mut().enumerate() {
            motion.extend(bits(&run, world));
        }
    }
    motion
}

fn with(precision: Precision, lanes: Lanes, threads: usize) -> Options {
    Options {
        precision,
        lanes,
        threads: Some(threads),
        fields: FIELDS.to_vec(),
        ..Options::default()
    }
}

/// Shapes of every kind, and hulls of several clusters of vertices.
fn models() -> Vec<Arc<Model>> {
    let cones = [Cone::Elliptic, Cone::Pyramidal];
    let scenes = cones
        .into_iter()
        .flat_map(|cone| [shapes(cone), stones(cone)]);
    scenes.map(|scene| scene.compile().unwrap()).collect()
}

#[test]
fn world_whose_shapes_touch_is_the_same_alone_and_among_others_at_any_position() {
    let many: Vec<usize> = (0..67).collect();
    let backwards: Vec<usize> = many.iter().rev().copied().collect();
    for precision in [Precision::F32, Precision::F64] {
        let options = || with(precision, Lanes::Auto, 1);
        for model in models() {
            let together = motion(&model, &many, options());
            let moved = motion(&model, &backwards, options());
            for world in 0..67 {
                let elsewhere = &moved[66 - world];
                assert!(
                    together[world] == *elsewhere,
                    "{precision:?}: world {world}"
                );
            }
            for world in [0, 15, 16, 66] {
                let alone = motion(&model, &[world], options());
                assert!(together[world] == alone[0], "{precision:?}: world {world}");
            }
        }
    }
}

#[test]
fn scalar_equals_eight_equals_sixteen_worlds_a_block_equals_two_threads_where_shapes_touch() {
    let seeds: Vec<usize> = (0..70).collect();
    for model in models() {
        let scalar = motion(&model, &seeds, with(Precision::F32, Lanes::Scalar, 1));
        for lanes in [Lanes::Eight, Lanes::Sixteen] {
            if cpu::available(lanes) {
                for threads in [1, 2] {
                    let wide = motion(&model, &seeds, with(Precision::F32, lanes, threads));
                    assert!(scalar == wide, "{lanes:?}, {threads} threads");
                }
            } else {
                println!("skipped: this processor has no {lanes:?}");
            }
        }
    }
}

#[test]
fn fields_that_are_asked_for_do_not_change_how_shapes_touch() {
    let seeds: Vec<usize> = (0..20).collect();
    for model in models() {
        let motion = |fields: &[Field]| {
            let options = Options {
                fields: fields.to_vec(),
                ..with(Precision::F32, Lanes::Auto, 1)
            };
            let mut run = started(&model, &seeds, options);
            for frame in 0..FRAMES {
                run.step();
                if frame % 3 == 0 {
                    run.forward();
                }
            }
            let world = |&world: &usize| run.get(Field::JointQ, world);
            let numbers: Vec<f64> = seeds.iter().flat_map(world).collect();
            numbers.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        assert!(motion(&[Field::JointQ]) == motion(Field::ALL));
    }
}

#[test]
fn shapes_of_these_worlds_touch_come_apart_and_stay_within_bounds() {
    for model in models() {
        let seeds: Vec<usize> = (0..67).collect();
        let mut run = started(&model, &seeds, with(Precision::F32, Lanes::Auto, 1));
        let (mut touching, mut apart) = (0, 0);
        for _ in 0..FRAMES {
            run.step();
            for world in 0..seeds.len() {
                let count = run.get(Field::ContactCount, world)[0];
                touching += usize::from(count > 0.0);
                apart += usize::from(count == 0.0);
                assert!(run.get(Field::JointQ, world).iter().all(|x| x.abs() < 10.0));
            }
        }
        assert!(touching > 300 && apart > 30, "{touching} {apart}");
    }
}

/// Room for fewer contacts, or for as many by their rows.
fn tight(cone: Cone, room: Room) -> Description {
    let mut scene = shapes(cone);
    match room {
        Room::Contacts => scene.contacts_max = Some(MOST),
        Room::Rows => scene.rows_max = Some(MOST * rows_of(cone)),
    }
    scene
}

/// Most contacts of the scenes with little room.
const MOST: usize = 4;

#[derive(Clone, Copy, Debug)]
enum Room {
    Contacts,
    Rows,
}

/// Rows of a contact with friction: three, or an edge each of the pyramid.
fn rows_of(cone: Cone) -> usize {
    match cone {
        Cone::Elliptic => 3,
        Cone::Pyramidal => 4,
    }
}

#[test]
fn worlds_that_exceed_their_room_report_it_and_the_others_are_bitwise_unchanged() {
    let seeds: Vec<usize> = (0..67).collect();
    for cone in [Cone::Elliptic, Cone::Pyramidal] {
        let roomy = shapes(cone).compile().unwrap();
        let options = || with(Precision::F32, Lanes::Auto, 1);
        for room in [Room::Contacts, Room::Rows] {
            let model = tight(cone, room).compile().unwrap();
            let mut all = started(&roomy, &seeds, options());
            let mut run = started(&model, &seeds, options());
            let (mut full, mut free) = (0, 0);
            let mut has_left_out = vec![false; seeds.len()];
            for _ in 0..FRAMES {
                run.step();
                all.step();
                for (world, has_left_out) in has_left_out.iter_mut().enumerate() {
                    let left_out = run.get(Field::ContactsLeftOut, world)[0];
                    *has_left_out |= left_out > 0.0;
                    let status = run.get(Field::Status, world)[0] as u32;
                    let says = status & status::CONTACTS_LEFT_OUT != 0;
                    assert_eq!(says, left_out > 0.0, "{room:?}: world {world}");
                    if *has_left_out {
                        full += 1;
                        continue;
                    }
                    free += 1;
                    // the state after the frame may have more contacts than there is room for
                    let fits = all.get(Field::ContactCount, world)[0] <= MOST as f64;
                    let forces = [Field::BodyContactForce].into_iter().filter(|_| fits);
                    for field in [Field::JointQ, Field::JointQd].into_iter().chain(forces) {
                        let [first, other] = [&run, &all].map(|run| run.get(field, world));
                        assert!(first == other, "{room:?}: world {world}: {field:?}");
                    }
                }
            }
            assert!(full > 100 && free > 100, "{room:?}: {full} {free}");
        }
    }
}

#[test]
fn the_count_of_what_was_left_out_is_exact() {
    let seeds: Vec<usize> = (0..67).collect();
    let one_step = |mut scene: Description| {
        scene.substeps = 1;
        scene.compile().unwrap()
    };
    let options = || with(Precision::F32, Lanes::Auto, 1);
    let roomy = one_step(shapes(Cone::Elliptic));
    let model = one_step(tight(Cone::Elliptic, Room::Contacts));
    let mut all = started(&roomy, &seeds, options());
    let mut run = started(&model, &seeds, options());
    all.forward();
    run.forward();
    let first_value = |run: &Run, field, world| run.get(field, world)[0];
    let most = MOST as f64;
    let mut expected = Vec::new();
    for world in 0..seeds.len() {
        expected.push((first_value(&all, Field::ContactCount, world) - most).max(0.0));
        let left_out = first_value(&run, Field::ContactsLeftOut, world);
        assert_eq!(left_out, expected[world], "world {world}");
        assert!(first_value(&run, Field::ContactCount, world) <= most);
    }
    // of a frame, the most of its steps and of the state it ends in
    run.step();
    for (world, start) in expected.iter().enumerate() {
        let left_out = first_value(&run, Field::ContactsLeftOut, world);
        let shown = first_value(&run, Field::ContactCount, world);
        assert!(left_out >= *start, "world {world}");
        assert!(left_out == *start || shown == most, "world {world}");
    }
}

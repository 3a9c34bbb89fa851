//! What the host sends and what frames show: every word of every world, on cards with and without their own memory.

use crate::blocks;
use crate::common::{Demo, Run, lesson, noise};
use crate::{assert_alive, gpu, options, run};
use sim_engine::backend::Values;
use sim_engine::options::open_as_discrete;
use sim_engine::simulation::{Device, Faults};
use sim_physics::arrays::{Field, status};

/// More than a binding of the software driver holds, and no multiple of a workgroup.
const MANY: usize = 40_003;

/// Numbers that differ from world to world and from column to column, `(worlds, columns)`.
fn rows(worlds: usize, columns: usize, salt: usize) -> Vec<f32> {
    let row = |world| (0..columns).map(move |k| noise(world, 100 * salt + k) as f32);
    (0..worlds).flat_map(row).collect()
}

/// Sends commands and writes of odd widths, then shows the state.
fn sent(device: Device, worlds: usize) -> Run {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut run = run(&model, device, worlds, &[Field::JointQ, Field::JointQd]);
    let mask: Vec<bool> = (0..worlds).map(|w| w % 3 != 1).collect();
    let mut send = |field, first: usize, columns: usize, mask: Option<&[bool]>| {
        let values = rows(worlds, columns, first + 10 * columns);
        let range = first..first + columns;
        let values = Values::F32(&values);
        match field {
            Field::JointQ | Field::JointQd => run.sim.write(field, range, values, mask).unwrap(),
            _ => run.sim.command(field, range, values).unwrap(),
        }
    };
    send(Field::JointTargetQ, 0, 9, None);
    send(Field::JointQ, 0, 9, None);
    send(Field::JointQd, 2, 5, Some(&mask));
    send(Field::JointF, 3, 1, None);
    send(Field::JointTargetQd, 0, 9, None);
    run.forward();
    run
}

#[test]
fn commands_and_rows_of_odd_widths_reach_every_world_of_several_tiles() {
    let [here, there] = [gpu(), Device::Cpu].map(|device| sent(device, MANY));
    assert_alive(&here);
    assert!(here.sim.snapshot() == there.sim.snapshot());
    for field in [Field::JointQ, Field::JointQd] {
        for world in 0..MANY {
            let (a, b) = (here.get(field, world), there.get(field, world));
            assert_eq!(a, b, "world {world}");
        }
    }
}

#[test]
fn a_card_with_its_own_memory_shows_what_shared_memory_shows() {
    let fields = [
        Field::JointQ,
        Field::JointQd,
        Field::JointQdd,
        Field::BodyQ,
        Field::BodyQd,
        Field::BiasForce,
        Field::MassMatrix,
    ];
    let model = lesson(Demo::Target).compile().unwrap();
    let arenas = [false, true].map(|discrete| {
        open_as_discrete(discrete);
        let mut run = run(&model, gpu(), 70, &fields);
        open_as_discrete(false);
        let mut arenas = Vec::new();
        for frame in 0..4 {
            let goal = rows(70, 9, frame);
            let command = Values::F32(&goal);
            run.sim.command(Field::JointTargetQ, 0..9, command).unwrap();
            run.step();
            arenas.push(run.arena.clone());
            let mask: Vec<bool> = (0..70).map(|w| w == 7 + frame).collect();
            run.sim.reset(Some(&mask), None).unwrap();
        }
        assert_alive(&run);
        (arenas, run.sim.snapshot())
    });
    assert!(arenas[0].0 == arenas[1].0);
    assert!(arenas[0].1 == arenas[1].1);
}

/// Such frames are drawn in device memory, and copied.
#[test]
fn a_card_with_its_own_memory_shows_contacts() {
    let fields = [Field::JointQ, Field::ContactCount, Field::ContactDistance];
    let model = blocks::scene(2);
    let runs = [false, true].map(|discrete| {
        open_as_discrete(discrete);
        let mut run = run(&model, gpu(), 70, &fields);
        open_as_discrete(false);
        run.step();
        assert_alive(&run);
        run
    });
    for world in 0..70 {
        let [count, other] = [0, 1].map(|k: usize| runs[k].get(Field::ContactCount, world)[0]);
        assert_eq!(count, other, "world {world}");
        assert!(count >= 1.0, "the ball touches another");
        for (field, shown) in [
            (Field::JointQ, model.coords()),
            (Field::ContactDistance, count as usize),
        ] {
            let [a, b] = [0, 1].map(|k: usize| runs[k].get(field, world));
            let both = a[..shown].iter().zip(&b[..shown]);
            let worst = both.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
            assert!(worst < 1e-6, "world {world}, {field:?}: {worst:e}");
        }
    }
}

#[test]
fn bounds_that_change_between_frames_hold_from_the_next_one_on() {
    let model = lesson(Demo::Torque).compile().unwrap();
    let bounds = [50.0, 1e-3, 1e-3, 50.0];
    let statuses = [gpu(), Device::Cpu].map(|device| {
        let mut run = Run::new(&model, options(device, 5, &[Field::JointQd]));
        let mut statuses = Vec::new();
        for joint_qd_max in bounds {
            run.sim.set_faults(Faults {
                joint_qd_max,
                resets: true,
                ..Faults::default()
            });
            let push = Values::F32(&[20.0; 45]);
            run.sim.command(Field::JointF, 0..9, push).unwrap();
            run.step();
            statuses.push(run.get(Field::Status, 4)[0]);
        }
        statuses
    });
    let outside = f64::from(status::OUT_OF_BOUNDS);
    assert_eq!(statuses[0], [0.0, outside, outside, 0.0]);
    assert_eq!(statuses[0], statuses[1]);
}

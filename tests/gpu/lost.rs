//! A device that is lost, and one whose memory does not hold the worlds.

use crate::common::{Demo, command, lesson, lesson_with_table};
use crate::{gpu, options, run};
use sim_core::batch::{Field, status};
use sim_engine::backend::BackendError;
use sim_engine::options::adapters;
use sim_engine::simulation::{Options, Precision, Simulation};

#[test]
fn after_a_device_is_lost_every_frame_says_so_and_nothing_panics() {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut run = run(&model, gpu(), 3, &[Field::JointQ]);
    run.step();
    assert!(run.sim.lost().is_none());
    let kept = run.sim.snapshot();
    run.sim.lose();
    for frame in 0..3 {
        let (field, row) = command(Demo::Target, frame);
        run.command(field, &row);
        run.step();
        let lost = run.sim.lost().expect("the frame finds it").to_string();
        assert!(lost.contains("device lost"), "{lost}");
        for world in 0..3 {
            let shown = run.get(Field::Status, world);
            assert_eq!(shown, [f64::from(status::NOT_FINITE)]);
        }
    }
    run.sim.reset(None, Some(&[3])).unwrap();
    run.sim.restore(&kept, None, None).unwrap();
    run.sim.snapshot();
    run.forward();
    assert!(run.sim.lost().is_some());
}

#[test]
fn a_snapshot_finds_that_the_device_is_lost() {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut run = run(&model, gpu(), 3, &[Field::JointQ]);
    run.sim.lose();
    assert!(run.sim.lost().is_none());
    run.sim.snapshot();
    assert!(run.sim.lost().is_some());
}

#[test]
fn worlds_that_do_not_fit_are_refused_before_memory_is_taken() {
    // some 60 kB each with an arm, a table and a cube; their frames are small
    let model = lesson_with_table(Demo::Target, true).compile().unwrap();
    let wanted = options(gpu(), 5_000_000, &[]);
    match Simulation::new(model, &wanted).err() {
        Some(BackendError::Memory {
            needed_mb,
            available_mb,
            ..
        }) => assert!(needed_mb > available_mb),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_frame_that_no_program_sees_as_a_whole_is_refused() {
    let model = lesson(Demo::Target).compile().unwrap();
    let one = Simulation::layout_of(&model, &options(gpu(), 64, Field::ALL)).bytes / 64;
    let most = adapters()[0].binding_max as usize;
    let wanted = options(gpu(), most / one + 64, Field::ALL);
    match Simulation::new(model, &wanted).err() {
        Some(BackendError::DeviceMemory { reason }) => {
            assert!(reason.contains("fewer worlds or fields"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn double_precision_is_refused() {
    let model = lesson(Demo::Target).compile().unwrap();
    let wanted = Options {
        precision: Precision::F64,
        ..options(gpu(), 1, &[Field::JointQ])
    };
    assert_eq!(
        Simulation::new(model, &wanted).err(),
        Some(BackendError::DoubleOnGpu)
    );
}

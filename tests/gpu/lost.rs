//! A device that is lost, one whose memory does not hold the worlds, one that does not start; and what `auto` does then.

use crate::common::{Demo, Run, command, lesson, lesson_with_table};
use crate::{gpu, options, run};
use sim_engine::backend::BackendError;
use sim_engine::options::{AUTO_WORLDS, adapters, compiling, lose_after};
use sim_engine::simulation::{Device, Options, Precision, Simulation};
use sim_physics::arrays::{Field, status};
use std::time::Duration;

#[test]
fn after_a_device_is_lost_every_frame_reports_it_and_nothing_panics() {
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
    let world_bytes = Simulation::layout_of(&model, &options(gpu(), 64, Field::ALL)).bytes / 64;
    let most = adapters()[0].binding_max as usize;
    let wanted = options(gpu(), most / world_bytes + 64, Field::ALL);
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

#[test]
fn a_device_that_is_lost_at_any_point_of_the_start_is_an_error() {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut lost = 0;
    loop {
        lose_after(lost);
        match Simulation::new(model.clone(), &options(gpu(), 3, &[Field::JointQ])).err() {
            Some(BackendError::Device { reason }) => {
                assert!(reason.contains("device lost"), "{reason}")
            }
            Some(other) => panic!("after {lost} runs: {other}"),
            None => break,
        }
        lost += 1;
    }
    assert!(lost >= 5, "a start has more than {lost} runs");
}

/// Waits for a driver that was given up: a process must not end while it compiles.
pub fn compiled() {
    while compiling() > 0 {
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_driver_that_takes_too_long_is_named_with_the_cures() {
    let model = lesson(Demo::Target).compile().unwrap();
    let wanted = Options {
        compile_limit: Duration::from_micros(1),
        ..options(gpu(), 1, &[Field::JointQ])
    };
    let failure = Simulation::new(model, &wanted).err().unwrap().to_string();
    for word in [
        "did not compile within 1µs",
        "cpu",
        "TIGHTLOOP_COMPILE_LIMIT",
    ] {
        assert!(failure.contains(word), "{word}: {failure}");
    }
    compiled();
}

/// What is wanted of a device that is left open, if software may play it.
fn auto(software: bool, fields: &[Field]) -> Options {
    let device = Device::Auto {
        cache: None,
        software,
    };
    options(device, AUTO_WORLDS, fields)
}

#[test]
fn auto_falls_back_to_the_processor_where_the_gpu_does_not_start_and_says_why() {
    let model = lesson(Demo::Target).compile().unwrap();
    let few = [Field::JointQ];
    let too_slow = Options {
        compile_limit: Duration::from_micros(1),
        ..auto(true, &few)
    };
    let world_bytes = Simulation::layout_of(&model, &options(gpu(), 64, Field::ALL)).bytes / 64;
    let too_large = Options {
        worlds: adapters()[0].binding_max as usize / world_bytes + 64,
        ..auto(true, Field::ALL)
    };
    let cases = [
        (too_slow, u64::MAX, "did not compile within"),
        (too_large, u64::MAX, "fewer worlds or fields"),
        (auto(true, &few), 0, "device lost"),
        (auto(true, &few), 3, "device lost"),
    ];
    for (wanted, runs, why) in cases {
        lose_after(runs);
        let mut here = Run::new(&model, wanted.clone());
        lose_after(u64::MAX);
        let note = here.sim.device_note().expect("auto tells").to_owned();
        let name = &adapters()[0].name;
        let begin = format!("the processor: `{name}` failed: ");
        assert!(note.starts_with(&begin) && note.contains(why), "{note}");
        assert!(here.sim.device().starts_with("cpu"));
        let mut there = Run::new(
            &model,
            Options {
                device: Device::Cpu,
                ..wanted
            },
        );
        for run in [&mut here, &mut there] {
            run.step();
        }
        assert!(here.arena == there.arena, "{why}");
    }
    compiled();
}

//! Client and daemon, each in a process of its own: what crosses is what was sent, and mistakes get a sentence.

#[path = "../daemon/mod.rs"]
mod daemon;
mod halves;
#[path = "../common/imported_memory.rs"]
mod imported_memory;
mod mistakes;
mod on_device;

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use daemon::{Daemon, leftovers, scene};
use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;
use sim_protocol::{Client, Command, Dtype, Frame, ProtocolError, Values, keep_waiting};

/// Not a test by itself: the process that other tests start as a daemon.
#[test]
fn daemon_process() {
    daemon::serve_if_asked();
}

fn command<'a>(field: &'a str, values: &'a [f32]) -> Command<'a> {
    Command {
        field,
        columns: 0..9,
        values: Values::F32(values),
    }
}

fn step(client: &Client, commands: &[Command<'_>]) -> Result<Frame, ProtocolError> {
    client.step(commands, &mut keep_waiting())
}

fn reset(client: &Client) -> Frame {
    client.reset(None, None, &mut keep_waiting()).unwrap()
}

fn floats(frame: &Frame, field: &str) -> Vec<f32> {
    frame
        .field(field)
        .unwrap()
        .as_slice::<f32>()
        .unwrap()
        .to_vec()
}

/// A simulation of the daemons' scene in this process, and room for its frames.
fn twin(worlds: usize) -> (Simulation, Vec<u64>) {
    let scene = sim_daemon::config::parse(&scene(), "test").unwrap();
    let model = scene.describe(".".as_ref()).unwrap().compile().unwrap();
    let simulation = Simulation::new(
        model,
        &Options {
            worlds,
            threads: Some(1),
            ..Options::default()
        },
    )
    .unwrap();
    let words = simulation.layout().bytes / 8;
    (simulation, vec![0; words])
}

/// Bytes of a field in an arena of [`twin`].
fn twin_field(simulation: &Simulation, arena: &[u64], field: Field) -> Vec<u8> {
    let slot = simulation
        .layout()
        .slots
        .iter()
        .find(|slot| slot.field == field)
        .unwrap();
    let bytes: Vec<u8> = arena.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes[slot.offset..slot.offset + slot.bytes].to_vec()
}

#[test]
fn a_client_that_attaches_knows_everything() {
    let daemon = Daemon::start(
        "describe",
        &["--worlds", "3", "--fields", "joint_q,mass_matrix"],
    );
    let client = daemon.attach();
    let told = client.description();
    assert_eq!(
        (told.name.as_str(), told.pid, told.worlds),
        (daemon.name.as_str(), daemon.child.id(), 3)
    );
    assert_eq!(
        (told.dof_names.len(), told.dof_names[0].as_str()),
        (9, "arm/fr3_joint1")
    );
    assert_eq!(
        (told.robots[0].name.as_str(), told.robots[0].dofs),
        ("arm", [0, 9])
    );
    let fields: Vec<_> = told
        .fields
        .iter()
        .map(|field| field.name.as_str())
        .collect();
    let counters = ["time", "step", "status", "contacts_left_out"];
    assert_eq!(
        fields,
        [&["joint_q", "mass_matrix"][..], &counters].concat()
    );
    assert_eq!(
        (told.fields[1].dtype, &told.fields[1].shape[..]),
        (Dtype::F32, &[3, 9, 9][..])
    );
    assert!(
        told.known_fields
            .iter()
            .any(|field| field.name == "bias_force" && field.unit == "N·m or N")
    );
    assert!(sim_daemon::config::parse(&told.scene, "told").is_ok());
    let frame = reset(&client);
    for (view, info) in frame.fields().zip(&told.fields) {
        assert_eq!(
            (view.name, view.dtype, view.shape),
            (info.name.as_str(), info.dtype, &info.shape[..])
        );
        assert_eq!(view.ptr as usize % 64, 0, "{}", view.name);
    }
}

#[test]
fn frames_over_the_protocol_equal_frames_in_process_bit_for_bit() {
    let daemon = Daemon::start("twin", &["--worlds", "5", "--threads", "1"]);
    let client = daemon.attach();
    let (mut simulation, mut arena) = twin(5);
    let same = |frame: &Frame, simulation: &Simulation, arena: &[u64], when: &str| {
        for field in [
            Field::JointQ,
            Field::JointQd,
            Field::BodyQ,
            Field::Time,
            Field::Step,
            Field::Status,
        ] {
            let there = frame.field(field.row().name).unwrap().as_bytes();
            assert!(
                there == twin_field(simulation, arena, field),
                "{} {when}",
                field.row().name
            );
        }
    };
    let start: Vec<f32> = (0..45).map(|i| 0.01 * i as f32).collect();
    let mask = [true, false, true, true, false];
    simulation
        .write(
            Field::JointQ,
            0..9,
            sim_engine::backend::Values::F32(&start),
            Some(&mask),
        )
        .unwrap();
    simulation.forward(&mut arena);
    let frame = client
        .write(
            &[command("joint_q", &start)],
            Some(&mask),
            &mut keep_waiting(),
        )
        .unwrap();
    same(&frame, &simulation, &arena, "after write");
    for n in 0..20 {
        let target: Vec<f32> = (0..15).map(|i| 0.3 * ((n + i) as f32).sin()).collect();
        simulation
            .command(
                Field::JointTargetQ,
                2..5,
                sim_engine::backend::Values::F32(&target),
            )
            .unwrap();
        simulation.step(&mut arena);
        let part = Command {
            field: "joint_target_q",
            columns: 2..5,
            values: Values::F32(&target),
        };
        same(
            &step(&client, &[part]).unwrap(),
            &simulation,
            &arena,
            "after step",
        );
    }
    simulation.reset(Some(&mask), None).unwrap();
    simulation.forward(&mut arena);
    same(
        &client
            .reset(Some(&mask), None, &mut keep_waiting())
            .unwrap(),
        &simulation,
        &arena,
        "after reset",
    );
    same(
        &client.forward(&mut keep_waiting()).unwrap(),
        &simulation,
        &arena,
        "after forward",
    );
}

#[test]
fn f64_numbers_reach_an_f32_run_rounded_and_an_f64_run_whole() {
    for (precision, dtype) in [("f32", Dtype::F32), ("f64", Dtype::F64)] {
        let daemon = Daemon::start("precision", &["--precision", precision]);
        let client = daemon.attach();
        let q: Vec<f64> = (0..9).map(|i| 0.02 + 1e-3 * f64::from(i) / 3.0).collect();
        let values = Command {
            field: "joint_q",
            columns: 0..9,
            values: Values::F64(&q),
        };
        let frame = client.write(&[values], None, &mut keep_waiting()).unwrap();
        let there = frame.field("joint_q").unwrap();
        assert_eq!(there.dtype, dtype);
        let same = match dtype {
            Dtype::F32 => there
                .as_slice::<f32>()
                .unwrap()
                .iter()
                .zip(&q)
                .all(|(&a, &b)| a == b as f32),
            _ => there.as_slice::<f64>().unwrap() == q,
        };
        assert!(same, "{precision}");
    }
}

#[test]
fn a_frame_stays_unchanged_while_held_and_one_too_many_is_refused() {
    let daemon = Daemon::start("held", &["--worlds", "2"]);
    let client = daemon.attach();
    let mut held = vec![(reset(&client), Vec::new())];
    held[0].1 = floats(&held[0].0, "joint_q");
    for n in 0..3 {
        let frame = step(&client, &[command("joint_f", &[n as f32; 18])]).unwrap();
        let copy = floats(&frame, "joint_q");
        held.push((frame, copy));
    }
    let error = step(&client, &[]).unwrap_err();
    assert!(
        matches!(error, ProtocolError::FramesHeld { held: 4 }),
        "{error}"
    );
    assert!(
        error.to_string().contains("frame.copy()") && error.to_string().contains("frames_held"),
        "{error}"
    );
    held.remove(0);
    for _ in 0..100 {
        step(&client, &[]).unwrap();
    }
    let steps = step(&client, &[])
        .unwrap()
        .field("step")
        .unwrap()
        .as_slice::<u64>()
        .unwrap()
        .to_vec();
    assert_eq!(steps, [104, 104], "the refused step was not made");
    for (frame, copy) in &held {
        assert_eq!(&floats(frame, "joint_q"), copy);
    }
}

#[test]
fn a_frame_survives_its_client_and_its_daemon() {
    let mut daemon = Daemon::start("survive", &["--worlds", "100"]);
    let client = daemon.attach();
    let frame = reset(&client);
    let copy = floats(&frame, "body_q");
    drop(client);
    daemon.kill();
    drop(daemon);
    assert_eq!(floats(&frame, "body_q"), copy);
}

#[test]
fn a_second_controller_learns_who_is_first_and_may_follow() {
    let daemon = Daemon::start("second", &[]);
    let (first, second) = (daemon.attach(), daemon.attach());
    assert_eq!(second.controller(&mut keep_waiting()).unwrap(), None);
    reset(&first);
    let error = step(&second, &[]).unwrap_err();
    let own_pid = std::process::id();
    assert!(
        matches!(error, ProtocolError::LeaseHeld { pid, .. } if pid == own_pid),
        "{error}"
    );
    assert_eq!(
        second.controller(&mut keep_waiting()).unwrap(),
        Some(own_pid)
    );
    step(&first, &[]).unwrap();
    first.release(&mut keep_waiting()).unwrap();
    assert_eq!(
        step(&second, &[])
            .unwrap()
            .field("step")
            .unwrap()
            .as_slice::<u64>()
            .unwrap(),
        [2]
    );
    drop(second);
    for _ in 0..20 {
        reset(&first);
        first.release(&mut keep_waiting()).unwrap();
    }
}

#[test]
fn an_observer_sees_the_first_worlds_and_disturbs_nobody() {
    let daemon = Daemon::start("watch", &["--worlds", "10", "--watch-worlds", "4"]);
    let (controller, observer) = (daemon.attach(), daemon.attach());
    let newer = |what: &str| {
        let frame = observer
            .wait_newer(Some(Duration::from_secs(2)), &mut keep_waiting())
            .unwrap();
        frame.unwrap_or_else(|| panic!("no frame {what}"))
    };
    let first = newer("before any command");
    assert_eq!(first.field("body_q").unwrap().shape[0], 4);
    let mut steps = 0;
    let mut last = reset(&controller);
    while steps < 50 {
        last = step(&controller, &[]).unwrap();
        steps += 1;
    }
    let deadline = Instant::now() + Duration::from_secs(2);
    let seen = loop {
        let frame = newer("after the last step");
        if frame.field("step").unwrap().as_slice::<u64>().unwrap() == [50; 4] {
            break frame;
        }
        assert!(Instant::now() < deadline, "the last state was not shown");
    };
    assert_eq!(floats(&seen, "joint_q"), floats(&last, "joint_q")[..36]);
    assert!(
        observer.latest(&mut keep_waiting()).unwrap().is_none(),
        "nothing is newer"
    );
    let late = daemon.attach();
    let frame = late
        .wait_newer(Some(Duration::from_secs(2)), &mut keep_waiting())
        .unwrap()
        .expect("the last frame");
    assert_eq!(floats(&frame, "joint_q"), floats(&seen, "joint_q"));
}

#[test]
fn an_interrupted_wait_returns_and_the_next_step_goes_on() {
    let daemon = Daemon::start("interrupt", &[]);
    let client = daemon.attach();
    reset(&client);
    daemon::freeze(daemon.child.id());
    let start = Instant::now();
    let mut hook = || {
        if start.elapsed() > Duration::from_millis(120) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let error = client.step(&[], &mut hook).unwrap_err();
    assert!(matches!(error, ProtocolError::Interrupted), "{error}");
    assert!(
        start.elapsed() < Duration::from_millis(500),
        "{:?}",
        start.elapsed()
    );
    daemon.signal(rustix::process::Signal::CONT);
    let frame = step(&client, &[]).unwrap();
    assert_eq!(
        frame.field("step").unwrap().as_slice::<u64>().unwrap(),
        [2],
        "the interrupted step was made once"
    );
}

#[test]
fn a_client_can_end_the_daemon_and_nothing_is_left() {
    let mut daemon = Daemon::start("end", &["--worlds", "64"]);
    let client = daemon.attach();
    let frame = reset(&client);
    client.shutdown(&mut keep_waiting()).unwrap();
    assert_eq!(leftovers(&daemon.name), [""; 0]);
    assert_eq!(daemon.child.wait().unwrap().code(), Some(0));
    assert!(matches!(
        step(&client, &[]),
        Err(ProtocolError::DaemonLost { .. })
    ));
    drop((frame, client));
    assert_eq!(leftovers(&daemon.name), [""; 0]);
}

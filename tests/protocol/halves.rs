//! A step in two halves, against daemons in processes of their own.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use sim_protocol::{Frame, ProtocolError, keep_waiting};

use crate::daemon::{self, Daemon};
use crate::{command, reset, step};

/// Every array of a frame.
fn bytes(frame: &Frame) -> Vec<u8> {
    frame
        .fields()
        .flat_map(|view| view.as_bytes().to_vec())
        .collect()
}

fn steps(frame: &Frame) -> Vec<u64> {
    frame
        .field("step")
        .unwrap()
        .as_slice::<u64>()
        .unwrap()
        .to_vec()
}

#[test]
fn halves_of_steps_give_the_bits_of_whole_ones() {
    let daemons = ["halves", "whole"].map(|name| Daemon::start(name, &["--worlds", "3"]));
    let [halves, whole] = daemons.each_ref().map(Daemon::attach);
    reset(&halves);
    reset(&whole);
    for n in 0..30 {
        let target: Vec<f32> = (0..27).map(|i| 0.3 * ((n + i) as f32).sin()).collect();
        let commands = [command("joint_target_q", &target)];
        halves.send(&commands, &mut keep_waiting()).unwrap();
        let expected = bytes(&step(&whole, &commands).unwrap());
        assert_eq!(
            bytes(&halves.recv(&mut keep_waiting()).unwrap()),
            expected,
            "step {n}"
        );
    }
}

#[test]
fn what_only_the_daemon_finds_comes_with_recv_and_the_next_step_goes_on() {
    let daemon = Daemon::start("refused-half", &["--worlds", "2"]);
    let client = daemon.attach();
    let hook = &mut keep_waiting();
    reset(&client);
    let mut torque = [0.0; 18];
    let short = client.send(&[command("joint_f", &torque[..9])], hook);
    assert!(matches!(short, Err(ProtocolError::Shape { .. })));
    torque[12] = f32::NAN;
    client.send(&[command("joint_f", &torque)], hook).unwrap();
    let error = client.recv(hook).unwrap_err();
    assert!(
        matches!(error, ProtocolError::CommandRefused { .. }) && error.to_string().contains("NaN"),
        "{error}"
    );
    client.send(&[], hook).unwrap();
    assert_eq!(steps(&client.recv(hook).unwrap()), [1, 1]);
}

#[test]
fn an_interrupted_recv_may_be_taken_up_again() {
    let daemon = Daemon::start("interrupted-half", &[]);
    let client = daemon.attach();
    reset(&client);
    daemon::freeze(daemon.child.id());
    client.send(&[], &mut keep_waiting()).unwrap();
    for _ in 0..2 {
        let error = client.recv(&mut || ControlFlow::Break(())).unwrap_err();
        assert!(matches!(error, ProtocolError::Interrupted), "{error}");
    }
    daemon.signal(rustix::process::Signal::CONT);
    assert_eq!(steps(&client.recv(&mut keep_waiting()).unwrap()), [1]);
    assert_eq!(steps(&step(&client, &[]).unwrap()), [2]);
}

#[test]
fn a_daemon_that_is_killed_in_between_is_reported_by_every_call() {
    let mut daemon = Daemon::start("killed-half", &[]);
    let client = daemon.attach();
    reset(&client);
    daemon::freeze(daemon.child.id());
    client.send(&[], &mut keep_waiting()).unwrap();
    daemon.kill();
    let began = Instant::now();
    for call in 0..4 {
        let error = match call % 2 {
            0 => client.recv(&mut keep_waiting()).unwrap_err(),
            _ => step(&client, &[]).unwrap_err(),
        };
        assert!(matches!(error, ProtocolError::DaemonLost { .. }), "{error}");
    }
    assert!(began.elapsed() < Duration::from_secs(1));
}

#[test]
fn slots_of_frames_are_counted_before_a_step_is_sent() {
    let daemon = Daemon::start("slots", &["--frames-held", "2"]);
    let client = daemon.attach();
    let hook = &mut keep_waiting();
    let first = reset(&client);
    client.send(&[], hook).unwrap();
    let second = client.recv(hook).unwrap();
    let error = client.send(&[], hook).unwrap_err();
    assert!(
        matches!(error, ProtocolError::FramesHeld { held: 2 }),
        "{error}"
    );
    drop(first);
    client.send(&[], hook).unwrap();
    assert_eq!(steps(&client.recv(hook).unwrap()), [2]);
    drop(second);
}

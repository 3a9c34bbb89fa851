//! Mistakes of users: each gets a sentence with the culprit and the cure, and the daemon goes on.

use sim_physics::arrays::Field;
use sim_protocol::{
    Command, Frame, PROTOCOL_VERSION, ProtocolError, RefusalKind, Values, keep_waiting,
};

use crate::daemon::{Daemon, attach, scene, unique};
use crate::{command, floats, reset, step, twin, twin_field};

#[test]
fn a_nan_is_refused_by_name_and_nothing_is_set() {
    let daemon = Daemon::start("nan", &["--worlds", "4"]);
    let client = daemon.attach();
    let before = floats(&reset(&client), "joint_q");
    let (good, mut bad) = ([1.0; 36], [0.5; 36]);
    bad[2 * 9 + 3] = f32::NAN;
    let error = step(
        &client,
        &[command("joint_f", &good), command("joint_target_q", &bad)],
    )
    .unwrap_err();
    let ProtocolError::CommandRefused {
        kind: RefusalKind::NotFinite,
        reason,
    } = &error
    else {
        panic!("{error:?}")
    };
    for word in ["joint_target_q", "world 2", "arm/fr3_joint4", "NaN"] {
        assert!(reason.contains(word), "{word} is not in: {reason}");
    }
    assert!(
        client
            .write(&[command("joint_q", &bad)], None, &mut keep_waiting())
            .is_err()
    );
    assert_eq!(
        floats(&client.forward(&mut keep_waiting()).unwrap(), "joint_q"),
        before
    );
    // joint_f came first and was good: it must not have been set either
    let (mut simulation, mut arena) = twin(4);
    simulation.step(&mut arena);
    let frame = step(&client, &[]).unwrap();
    assert!(
        frame.field("joint_qd").unwrap().as_bytes()
            == twin_field(&simulation, &arena, Field::JointQd)
    );
}

#[test]
fn wrong_shapes_fields_and_masks_are_refused_with_what_is_right() {
    let daemon = Daemon::start("shapes", &["--worlds", "2"]);
    let client = daemon.attach();
    let wait = &mut keep_waiting();
    let cases: [(Result<Frame, ProtocolError>, &str); 8] = [
        (
            step(&client, &[command("joint_f", &[0.0; 9])]),
            "2 worlds x 9 columns = 18",
        ),
        (
            step(&client, &[command("joint_q", &[0.0; 18])]),
            "joint_f, joint_target_q, joint_target_qd",
        ),
        (
            step(&client, &[command("torque", &[0.0; 18])]),
            "\"torque\" cannot be commanded",
        ),
        (
            client.write(&[command("joint_f", &[0.0; 18])], None, wait),
            "joint_q, joint_qd",
        ),
        (
            step(
                &client,
                &[Command {
                    field: "joint_f",
                    columns: 5..10,
                    values: Values::F32(&[0.0; 10]),
                }],
            ),
            "columns within 0..9",
        ),
        (
            step(
                &client,
                &[
                    command("joint_f", &[0.0; 18]),
                    command("joint_f", &[0.0; 18]),
                ],
            ),
            "at most once",
        ),
        (
            client.reset(Some(&[true]), None, wait),
            "expected (2,), got (1,)",
        ),
        (
            client.reset(None, Some(&[1, 2, 3]), wait),
            "expected (1,) or (2,), got (3,)",
        ),
    ];
    for (result, words) in cases {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(words), "{words} is not in: {error}");
    }
    let error = reset(&client).field("mass_matrix").unwrap_err().to_string();
    assert!(
        error.contains("joint_q, joint_qd, body_q, time, step, status"),
        "{error}"
    );
}

#[test]
fn bad_arguments_name_the_culprit_and_the_cure_and_leave_nothing() {
    let cases: [(&[&str], &str, &str); 8] = [
        (
            &["--worlds", "0"],
            "ArgumentError",
            "worlds \"0\": ask for 1",
        ),
        (
            &["--fields", "joint_q,speed"],
            "ArgumentError",
            "fields \"speed\": unknown field; known are joint_q",
        ),
        (
            &["--device", "tpu"],
            "ArgumentError",
            "device \"tpu\": unknown; use auto, cpu or gpu",
        ),
        (
            &["--precision", "f16"],
            "ArgumentError",
            "precision \"f16\": unknown; use f32 or f64",
        ),
        (&["--threads", "0"], "ArgumentError", "threads \"0\""),
        (
            &["--frames-held", "0"],
            "ArgumentError",
            "frames-held \"0\"",
        ),
        (
            &["--worlds", "4000000000"],
            "ResourceError",
            "bytes of memory are free",
        ),
        (&["--log", "/nowhere/log"], "LaunchError", "/nowhere/log"),
    ];
    for (flags, kind, message) in cases {
        let mut daemon = Daemon::start("bad", flags);
        assert_eq!(daemon.error().0, kind, "{flags:?}: {}", daemon.said);
        assert!(
            daemon.error().1.contains(message),
            "{message} is not in: {}",
            daemon.error().1
        );
        let code = daemon.child.wait().unwrap().code();
        assert_eq!(
            code,
            Some(if kind == "ArgumentError" { 2 } else { 1 }),
            "{flags:?}"
        );
        assert_eq!(daemon.leftovers(), [""; 0], "{flags:?}");
    }
    let daemon = Daemon::start_as("a/b", &scene(), &[]);
    assert_eq!(daemon.error().0, "ArgumentError", "{}", daemon.said);
    let daemon = Daemon::start_scene("broken", "dt = ", &[]);
    assert_eq!(daemon.error().0, "SceneError", "{}", daemon.said);
}

#[test]
fn a_name_is_used_once_and_an_unknown_one_is_answered_with_the_known() {
    let daemon = Daemon::start("taken", &[]);
    let name = daemon.name.clone();
    let second = std::mem::ManuallyDrop::new(Daemon::start_as(&name, &scene(), &[]));
    assert_eq!(second.error().0, "LaunchError");
    assert!(
        second
            .error()
            .1
            .contains(&format!("pid {}", daemon.child.id())),
        "{}",
        second.error().1
    );
    let error = attach(&unique("absent")).unwrap_err().to_string();
    assert!(
        error.contains("no daemon named") && error.contains(&name),
        "{error}"
    );
    reset(&daemon.attach());
}

#[test]
fn another_protocol_version_is_refused_with_both_named() {
    let name = unique("version");
    let daemon = sim_protocol::paths::DaemonPaths::new(None, &name).unwrap();
    std::fs::write(daemon.lock_path(), "tightloop 99 4711 00000000000000aa\n").unwrap();
    let file = std::fs::File::open(daemon.lock_path()).unwrap();
    file.lock().unwrap();
    let error = attach(&name).unwrap_err();
    assert!(
        matches!(
            error,
            ProtocolError::ProtocolVersion {
                daemon: 99,
                client: PROTOCOL_VERSION,
                ..
            }
        ),
        "{error}"
    );
    assert!(
        error.to_string().contains("99") && error.to_string().contains("version"),
        "{error}"
    );
    drop(file);
    assert!(sim_protocol::cleanup_after_death(None, &name).unwrap());
}

#[test]
fn observers_keep_no_controller_out_and_one_too_many_gets_the_limit() {
    let daemon = Daemon::start("many", &[]);
    let mut observers: Vec<_> = (0..32).map(|_| daemon.attach()).collect();
    for observer in &observers {
        observer.latest(&mut keep_waiting()).unwrap();
    }
    let other = daemon.attach();
    let error = other.latest(&mut keep_waiting()).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!(
            "daemon {:?} has 32 observers, which is the limit; close one of them",
            daemon.name
        )
    );
    // a client that may not observe may still command
    reset(&other);
    observers.truncate(31);
    daemon.attach().latest(&mut keep_waiting()).unwrap();
}

#[test]
fn a_client_too_many_gets_the_limit_and_may_come_when_another_goes() {
    let daemon = Daemon::start("more", &[]);
    let mut clients: Vec<_> = (0..64).map(|_| daemon.attach()).collect();
    let error = attach(&daemon.name).unwrap_err();
    assert!(
        matches!(error, ProtocolError::TooManyClients { max: 64, .. }),
        "{error}"
    );
    let holders = format!("which is the limit (process {} has 64)", std::process::id());
    assert!(error.to_string().contains(&holders), "{error}");
    clients.truncate(63);
    reset(&daemon.attach());
}

//! Processes that are killed, stopped or orphaned: the other side notices, goes on, and nothing is left behind.
//!
//! `TIGHTLOOP_KILL_LOOPS` sets how often each kind of killing is repeated; a few times by default.

mod daemon;

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use daemon::{Daemon, attach, leftovers, scene, unique};
use rustix::process::Signal;
use sim_protocol::{Client, Frame, ProtocolError, keep_waiting};

/// Name of the daemon that [`client_process`] steps, in the process that is to do so.
const STEP: &str = "TIGHTLOOP_TEST_STEP";
/// Name of the daemon that [`parent_process`] starts, in the process that is to do so.
const PARENT: &str = "TIGHTLOOP_TEST_PARENT";

/// Not a test by itself: the process that other tests start as a daemon.
#[test]
fn daemon_process() {
    daemon::serve_if_asked();
}

/// Not a test by itself: a client that steps until it is killed, printing "stepping" once it does, and the error that ends
/// it, if one does.
#[test]
fn client_process() {
    let Ok(name) = std::env::var(STEP) else {
        return;
    };
    let client = attach(&name).unwrap();
    let mut count = 0;
    let error = loop {
        match step(&client) {
            Ok(_) => count += 1,
            Err(error) => break error,
        }
        if count == 10 {
            println!("stepping");
        }
    };
    println!("error: {error}");
    std::process::exit(7);
}

/// Not a test by itself: a process that starts a daemon as `tightloop.launch` does, and waits to be killed.
#[test]
fn parent_process() {
    let Ok(name) = std::env::var(PARENT) else {
        return;
    };
    let parent = std::process::id().to_string();
    let daemon = Daemon::start_as(&name, &scene(), &["--parent", &parent]);
    println!("{}", daemon.said);
    let client = daemon.attach();
    loop {
        step(&client).unwrap();
    }
}

/// Starts one of the processes above and waits until it prints `word`.
fn start(
    test: &str,
    variable: &str,
    name: &str,
    word: &str,
) -> (Child, impl Iterator<Item = String>) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture", "--test-threads=1"])
        .env(variable, name)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok);
    assert!(
        lines.any(|line| line.contains(word)),
        "{test} ended without {word:?}"
    );
    (child, lines)
}

fn kill_loops() -> usize {
    std::env::var("TIGHTLOOP_KILL_LOOPS")
        .map_or(5, |count| count.parse().expect("a number of loops"))
}

fn step(client: &Client) -> Result<Frame, ProtocolError> {
    client.step(&[], &mut keep_waiting())
}

fn kill(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Tries until it works or a second is over.
fn within_a_second<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(done) = attempt() {
            return done;
        }
        assert!(
            start.elapsed() < Duration::from_secs(1),
            "{what} took longer than a second"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Moments spread over what a client or a daemon does, by the golden ratio.
fn moment(n: usize) -> Duration {
    Duration::from_micros((n as f64 * 0.618_034).fract().mul_add(20_000.0, 10.0) as u64)
}

#[test]
fn a_killed_daemon_is_noticed_within_a_second_and_the_next_one_starts_clean() {
    let name = unique("kill-daemon");
    for n in 0..kill_loops() {
        // half of the daemons compute for some milliseconds a step, so that they die in the middle of one
        let worlds = if n % 2 == 0 { "1" } else { "2000" };
        let mut daemon = Daemon::start_as(&name, &scene(), &["--worlds", worlds]);
        let client = daemon.attach();
        let held = step(&client).unwrap();
        let stepper = std::thread::spawn(move || {
            loop {
                if let Err(error) = step(&client) {
                    return (error, Instant::now());
                }
            }
        });
        std::thread::sleep(moment(n));
        daemon.kill();
        let killed = Instant::now();
        let (error, noticed) = stepper.join().unwrap();
        assert!(
            matches!(error, ProtocolError::DaemonLost { .. }),
            "round {n}: {error}"
        );
        assert!(
            noticed.saturating_duration_since(killed) < Duration::from_secs(1),
            "round {n}"
        );
        if n % 3 == 0 {
            // the others are left for the next start to clean
            assert!(sim_protocol::cleanup_after_death(None, &name).unwrap());
            assert_eq!(leftovers(&name), [""; 0], "round {n}");
        }
        assert_eq!(held.field("step").unwrap().as_slice::<u64>().unwrap()[0], 1);
        std::mem::forget(daemon); // its Drop would clean up for the next round
    }
    let mut last = Daemon::start_as(&name, &scene(), &[]);
    step(&last.attach()).unwrap();
    last.signal(Signal::TERM);
    assert_eq!(last.child.wait().unwrap().code(), Some(0));
    assert_eq!(leftovers(&name), [""; 0]);
}

#[test]
fn a_killed_controller_loses_its_lease_within_a_second_and_the_daemon_goes_on() {
    for worlds in ["1", "2000"] {
        let daemon = Daemon::start("kill-client", &["--worlds", worlds]);
        let observer = daemon.attach();
        for n in 0..kill_loops() {
            let (mut child, _lines) = start("client_process", STEP, &daemon.name, "stepping");
            std::thread::sleep(moment(n));
            kill(&mut child);
            let next = daemon.attach();
            within_a_second("the next controller", || match step(&next) {
                Ok(frame) => Some(frame),
                Err(ProtocolError::LeaseHeld { pid, .. }) if pid == child.id() => None,
                Err(error) => panic!("round {n}: {error}"),
            });
            for _ in 0..10 {
                step(&next).unwrap();
            }
            assert!(observer.latest(&mut keep_waiting()).is_ok());
        }
        let name = daemon.name.clone();
        observer.shutdown(&mut keep_waiting()).unwrap();
        assert_eq!(leftovers(&name), [""; 0]);
    }
}

#[test]
fn a_stopped_controller_loses_its_lease_when_another_asks_and_learns_it() {
    let daemon = Daemon::start("stop-client", &[]);
    let (mut child, mut lines) = start("client_process", STEP, &daemon.name, "stepping");
    let other = daemon.attach();
    assert!(matches!(step(&other), Err(ProtocolError::LeaseHeld { pid, .. }) if pid == child.id()));
    daemon::freeze(child.id());
    let start = Instant::now();
    while let Err(error) = step(&other) {
        assert!(matches!(error, ProtocolError::LeaseHeld { .. }), "{error}");
        assert!(
            start.elapsed() < Duration::from_secs(5),
            "the lease did not expire"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(
        start.elapsed() > Duration::from_millis(500),
        "a short pause must not cost the lease"
    );
    daemon::send(child.id(), Signal::CONT);
    let error = lines
        .find(|line| line.contains("error: "))
        .expect("the stopped client goes on and fails");
    assert!(
        error.contains("control of daemon") && error.contains("lost"),
        "{error}"
    );
    assert_eq!(child.wait().unwrap().code(), Some(7));
    step(&other).unwrap();
}

#[test]
fn a_stopped_controller_keeps_its_lease_when_nobody_asks() {
    let daemon = Daemon::start("pause-client", &[]);
    let (mut child, _lines) = start("client_process", STEP, &daemon.name, "stepping");
    daemon::freeze(child.id());
    std::thread::sleep(Duration::from_millis(2500));
    daemon::send(child.id(), Signal::CONT);
    std::thread::sleep(Duration::from_millis(200));
    assert!(child.try_wait().unwrap().is_none(), "the client goes on");
    assert!(matches!(
        step(&daemon.attach()),
        Err(ProtocolError::LeaseHeld { .. })
    ));
    kill(&mut child);
}

#[test]
fn a_daemon_ends_when_its_parent_is_killed_and_leaves_nothing() {
    for n in 0..kill_loops() {
        let name = unique("orphan");
        let (mut parent, _lines) = start("parent_process", PARENT, &name, "ready");
        std::thread::sleep(moment(n));
        kill(&mut parent);
        within_a_second("the end of an orphan", || {
            leftovers(&name).is_empty().then_some(())
        });
    }
}

#[test]
fn a_daemon_that_is_asked_to_end_does_so_at_once_and_leaves_nothing() {
    for signal in [Signal::TERM, Signal::INT, Signal::HUP] {
        let mut daemon = Daemon::start("signal", &["--worlds", "10"]);
        let client = daemon.attach();
        let frame = step(&client).unwrap();
        let start = Instant::now();
        daemon.signal(signal);
        assert_eq!(daemon.child.wait().unwrap().code(), Some(0));
        assert!(
            start.elapsed() < Duration::from_millis(300),
            "{:?}",
            start.elapsed()
        );
        assert!(matches!(
            step(&client),
            Err(ProtocolError::DaemonLost { .. })
        ));
        assert_eq!(daemon.leftovers(), [""; 0]);
        drop((client, frame));
        assert_eq!(
            daemon.leftovers(),
            [""; 0],
            "an old client must not leave anything either"
        );
    }
}

#[test]
fn an_old_client_learns_of_a_restart_and_does_not_disturb_the_new_daemon() {
    let name = unique("restart");
    let mut first = Daemon::start_as(&name, &scene(), &[]);
    let old = first.attach();
    let held = step(&old).unwrap();
    first.kill();
    std::mem::forget(first);
    let second = Daemon::start_as(&name, &scene(), &[]);
    let new = second.attach();
    step(&new).unwrap();
    let error = step(&old).unwrap_err();
    assert!(
        matches!(error, ProtocolError::DaemonRestarted { .. }),
        "{error}"
    );
    drop((old, held));
    for _ in 0..100 {
        step(&new).unwrap();
    }
    step(&{
        new.release(&mut keep_waiting()).unwrap();
        second.attach()
    })
    .unwrap();
}

#[test]
fn what_a_killed_daemon_left_goes_with_the_start_of_any_other() {
    let mut dead = Daemon::start("dead", &[]);
    dead.kill();
    assert_ne!(leftovers(&dead.name), [""; 0]);
    let _other = Daemon::start("other", &[]);
    assert_eq!(leftovers(&dead.name), [""; 0]);
}

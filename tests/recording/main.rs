//! What was recorded of a daemon is replayed bit for bit; recorders that are killed, stopped or out of room harm nobody.
//!
//! `TIGHTLOOP_RECORD_FRAMES` sets the frames of the long run.

#[path = "../common/mod.rs"]
mod common;
#[path = "../daemon/mod.rs"]
mod daemon;
mod run;

use std::io::{BufRead, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use daemon::{Daemon, attach, freeze, send, tightloop};
use run::{Folder, Recorder, act, files, frames, replay, run, soon, step, under_way};
use rustix::process::Signal;
use sim_protocol::keep_waiting;

/// Not a test by itself: the process that other tests start as a daemon, a recorder or a replay.
#[test]
fn daemon_process() {
    daemon::serve_if_asked();
}

#[test]
fn everything_that_a_client_can_ask_for_is_replayed_bit_for_bit() {
    let count = std::env::var("TIGHTLOOP_RECORD_FRAMES");
    let count: usize = count.map_or(10_000, |count| count.parse().expect("a number of frames"));
    let folder = Folder::new("long");
    let (daemon, client) = under_way("record-long", &folder);
    let file = folder.file("run.tlrec");
    let recorder = Recorder::start(&daemon.name, &file, &["--frames", &count.to_string()]);
    for key in 120..120 + count {
        act(&client, &folder, key);
    }
    let (said, code) = recorder.finish();
    assert_eq!((code, frames(&said)), (0, count as u64), "{said}");
    assert!(said.contains("no gaps"), "{said}");
    // its snapshots are gone by now, and what is left of the daemon
    std::fs::remove_file(folder.file("worlds")).unwrap();
    drop((client, daemon));
    for threads in ["1", "2"] {
        let (said, code) = run(&["replay", &file, "--threads", threads]);
        assert_eq!((code, frames(&said)), (0, count as u64), "{said}");
    }
    let (said, code) = run(&["replay", &file, "--frames", "7"]);
    assert_eq!((code, frames(&said)), (0, 7), "{said}");
}

#[test]
fn what_a_killed_recorder_has_written_is_replayed_and_the_daemon_goes_on() {
    let folder = Folder::new("killed");
    let (daemon, client) = under_way("record-killed", &folder);
    let before = files(&daemon);
    for round in 0..5 {
        let file = folder.file(&format!("{round}.tlrec"));
        let mut recorder = Recorder::start(&daemon.name, &file, &[]);
        let first = 120 + 1000 * round;
        for key in first..first + 700 + 50 * round {
            act(&client, &folder, key);
        }
        recorder.kill();
        let said = replay(&file);
        assert!(said.contains("its recorder was killed"), "{said}");
        let frames = frames(&said);
        assert!(frames > 0 && frames <= 700 + 50 * round as u64, "{said}");
        act(&client, &folder, 99);
        soon("the journal goes", || {
            (files(&daemon) == before).then_some(())
        });
    }
}

#[test]
fn a_recorder_that_stands_loses_entries_reports_it_and_keeps_nobody_waiting() {
    let folder = Folder::new("stands");
    let daemon = Daemon::start("record-stands", &["--worlds", "64"]);
    let client = daemon.attach();
    let file = folder.file("gap.tlrec");
    let mut recorder = Recorder::start(&daemon.name, &file, &[]);
    (0..100).for_each(|key| step(&client, key));
    // all of them are written before it stands
    std::thread::sleep(Duration::from_millis(300));
    freeze(recorder.child.id());
    // far more than wait in shared memory
    let steps = 3000;
    (0..steps).for_each(|key| step(&client, key));
    // an entry follows its frame: the last one is there once the daemon serves something else
    drop(daemon.attach());
    send(recorder.child.id(), Signal::CONT);
    let mut news = String::new();
    recorder.news.read_line(&mut news).unwrap();
    assert!(news.contains("after frame 100 a gap"), "{news}");
    // it reports it once it has the state behind the gap
    (0..50).for_each(|key| step(&client, key));
    let (said, code) = recorder.stop();
    assert_eq!(code, 0, "{said}");
    let lost = said.split("1 gap of ").nth(1).expect(&said);
    let lost: u64 = lost.split(' ').next().unwrap().parse().unwrap();
    assert_eq!((frames(&said), lost), (150, steps as u64), "{said}");
    let (said, code) = run(&["replay", &file]);
    assert_eq!(code, 1, "{said}");
    // the frames behind the gap are compared, too
    assert!(said.contains("150 frames are equal, bit for bit"), "{said}");
    let gap = format!("a gap after frame 100: {lost} or more entries are missing");
    let steps = format!("of world 0 the steps 101 to {}", 100 + steps);
    assert!(said.contains(&gap) && said.contains(&steps), "{said}");
}

#[test]
fn a_full_disk_ends_the_recording_with_an_error_and_not_the_simulation() {
    let folder = Folder::new("full");
    let daemon = Daemon::start("record-full", &["--worlds", "64"]);
    let client = daemon.attach();
    let file = folder.file("full.tlrec");
    // 2 MB; the shell becomes the recorder
    let line = tightloop(&["record", &daemon.name, &file]);
    let mut child = Command::new("bash")
        .args(["-c", "ulimit -f 2000; exec \"$0\" \"$@\""])
        .arg(line.get_program())
        .args(line.get_args())
        .envs(
            line.get_envs()
                .filter_map(|(key, value)| Some((key, value?))),
        )
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    soon("it writes", || {
        std::fs::metadata(&file)
            .ok()
            .filter(|there| there.len() > 1000)
    });
    let mut key = 0;
    let status = soon("it ends", || {
        key += 1;
        step(&client, key);
        child.try_wait().unwrap()
    });
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(said.contains("cannot be written: File too large"), "{said}");
    assert!(frames(&replay(&file)) > 100);
    step(&client, 0);
    // a device that is always full
    let (said, code) = run(&["record", &daemon.name, "/dev/full", "--force"]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("/dev/full: cannot be written: No space left"),
        "{said}"
    );
    step(&client, 0);
}

#[test]
fn four_recorders_record_at_once_and_a_fifth_is_refused() {
    let folder = Folder::new("four");
    let (daemon, client) = under_way("record-four", &folder);
    let out = |index: usize| folder.file(&format!("{index}.tlrec"));
    let mut recorders = Vec::new();
    for index in 0..4 {
        recorders.push(Recorder::start(&daemon.name, &out(index), &[]));
        (0..200).for_each(|key| act(&client, &folder, 120 + key + index));
    }
    let (said, code) = run(&["record", &daemon.name, &out(4)]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("4 recorders are at work, which is the limit"),
        "{said}"
    );
    assert!(!Path::new(&out(4)).exists());
    // the journals go on under another controller
    client.release(&mut keep_waiting()).unwrap();
    let other = daemon.attach();
    (0..200).for_each(|key| act(&other, &folder, 120 + key));
    std::thread::sleep(Duration::from_millis(300));
    for (index, recorder) in recorders.into_iter().enumerate() {
        let (said, code) = recorder.stop();
        assert_eq!(
            (code, frames(&said)),
            (0, 200 * (5 - index as u64)),
            "{said}"
        );
        assert_eq!(frames(&replay(&out(index))), 200 * (5 - index as u64));
    }
}

#[test]
fn a_recording_ends_well_with_its_daemon_and_tells_of_one_that_is_not_there() {
    let folder = Folder::new("ends");
    let mut daemon = Daemon::start("record-ends", &["--worlds", "64"]);
    let client = daemon.attach();
    let file = folder.file("run.tlrec");
    let recorder = Recorder::start(&daemon.name, &file, &["--fields", "joint_q"]);
    (0..500).for_each(|key| step(&client, key));
    // it is there, and stays as it is
    let (said, code) = run(&["record", &daemon.name, &file]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("is there already; choose another name"),
        "{said}"
    );
    client.shutdown(&mut keep_waiting()).unwrap();
    let (said, code) = recorder.finish();
    assert_eq!((code, frames(&said)), (0, 500), "{said}");
    assert!(said.contains("is gone"), "{said}");
    assert_eq!(frames(&replay(&file)), 500);
    daemon.child.wait().unwrap();
    let other = folder.file("other.tlrec");
    let (said, code) = run(&["record", &daemon.name, &other]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("no daemon named"), "{said}");
    assert!(!Path::new(&other).exists());
    assert!(attach(&daemon.name).is_err());
}

#[test]
fn a_killed_daemon_ends_the_recording_too() {
    let folder = Folder::new("gone");
    let mut daemon = Daemon::start("record-gone", &["--worlds", "64"]);
    let client = daemon.attach();
    let file = folder.file("run.tlrec");
    let recorder = Recorder::start(&daemon.name, &file, &[]);
    (0..200).for_each(|key| step(&client, key));
    std::thread::sleep(Duration::from_millis(300));
    daemon.kill();
    let (said, code) = recorder.finish();
    assert_eq!((code, frames(&said)), (0, 200), "{said}");
    assert_eq!(frames(&replay(&file)), 200);
}

#[test]
fn unknown_fields_and_counts_of_nothing_are_refused() {
    let folder = Folder::new("refused");
    let daemon = Daemon::start("record-refused", &["--worlds", "64"]);
    let file = folder.file("run.tlrec");
    for (flags, code, words) in [
        (
            ["--fields", "joint_x"],
            1,
            "frames carry no field \"joint_x\"; they carry: joint_q",
        ),
        (["--frames", "0"], 2, "frames \"0\": ask for at least 1"),
        (["--seconds", "0"], 2, "seconds \"0\": ask for more than 0"),
        (
            ["--seconds", "NaN"],
            2,
            "seconds \"NaN\": ask for more than 0",
        ),
    ] {
        let (said, got) = run(&[&["record", &daemon.name, &file], &flags[..]].concat());
        assert_eq!(got, code, "{said}");
        assert!(said.contains(words), "{said}");
        assert!(!Path::new(&file).exists());
    }
    let (said, code) = run(&["record", &daemon.name, &folder.file("no/run.tlrec")]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("its folder is not there; make it first"),
        "{said}"
    );
}

#[test]
fn a_robot_file_that_has_changed_since_is_reported() {
    let folder = Folder::new("changed");
    let urdf = folder.file("pole.urdf");
    let robot = |mass: f64| {
        format!(
            "<robot name='pole'><link name='base'/><link name='pole'><inertial><mass value='{mass}'/>\
             <inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>\
             <joint name='hinge' type='continuous'><parent link='base'/><child link='pole'/>\
             <axis xyz='0 1 0'/></joint></robot>"
        )
    };
    std::fs::write(&urdf, robot(1.0)).unwrap();
    let scene = format!("dt = 0.002\nsubsteps = 4\n[[robot]]\nname = \"pole\"\nurdf = {urdf:?}\n");
    let daemon = Daemon::start_scene("record-changed", &scene, &[]);
    let client = daemon.attach();
    let file = folder.file("run.tlrec");
    let recorder = Recorder::start(&daemon.name, &file, &["--seconds", "0.3"]);
    for _ in 0..10 {
        client.step(&[], &mut keep_waiting()).unwrap();
    }
    let (said, code) = recorder.finish();
    assert_eq!((code, frames(&said)), (0, 10), "{said}");
    assert_eq!(frames(&replay(&file)), 10);
    std::fs::write(&urdf, robot(1.5)).unwrap();
    let (said, code) = run(&["replay", &file]);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("is of another model"), "{said}");
    std::fs::remove_file(&urdf).unwrap();
    let (said, code) = run(&["replay", &file]);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("pole.urdf"), "{said}");
}

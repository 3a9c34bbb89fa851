//! What was recorded of a daemon is replayed bit for bit; recorders that are killed, stopped or out of room harm nobody.
//!
//! `TIGHTLOOP_RECORD_FRAMES` sets the frames of the long run.

mod common;
mod daemon;

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Output};
use std::time::{Duration, Instant};

use common::noise;
use daemon::{Daemon, attach, freeze, scene, send, tightloop, unique};
use rustix::process::Signal;
use sim_protocol::{Client, Command, Values, keep_waiting};

const WORLDS: usize = 64;
const DOFS: usize = 9;

/// Not a test by itself: the process that other tests start as a daemon, a recorder or a replay.
#[test]
fn daemon_process() {
    daemon::serve_if_asked();
}

/// A folder of a test, which goes with it.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("tightloop-{}", unique(test)));
        std::fs::create_dir(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap();
    }
}

/// A recorder that has begun.
struct Recorder {
    child: Child,
    news: BufReader<std::process::ChildStderr>,
}

impl Recorder {
    fn start(name: &str, out: &str, flags: &[&str]) -> Recorder {
        let line = [&["record", name, out], flags].concat();
        let mut child = tightloop(&line).spawn().unwrap();
        let mut news = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        news.read_line(&mut said).unwrap();
        assert!(said.contains("recording "), "{said}");
        Recorder { child, news }
    }

    /// Waits for its end; what it said on both streams, and its exit code.
    fn finish(mut self) -> (String, i32) {
        let mut said = String::new();
        let mut stdout = self.child.stdout.take().unwrap();
        stdout.read_to_string(&mut said).unwrap();
        self.news.read_to_string(&mut said).unwrap();
        let code = self.child.wait().unwrap().code().unwrap_or(-1);
        (said, code)
    }

    /// Asks it to end, and waits for that.
    fn stop(self) -> (String, i32) {
        send(self.child.id(), Signal::TERM);
        self.finish()
    }

    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a command line said on both streams, and its exit code.
fn run(line: &[&str]) -> (String, i32) {
    let Output {
        status,
        stdout,
        stderr,
    } = tightloop(line).output().unwrap();
    let said = String::from_utf8(stdout).unwrap() + &String::from_utf8(stderr).unwrap();
    (said, status.code().unwrap_or(-1))
}

/// Replays a file that must be equal; what it said.
fn replay(file: &str) -> String {
    let (said, code) = run(&["replay", file]);
    assert!(
        code == 0 && said.contains("equal, bit for bit"),
        "{code}: {said}"
    );
    said
}

/// The number of frames in "FILE: 123 frames …".
fn frames(said: &str) -> u64 {
    let before = said.split_once(" frames").expect(said).0;
    before.rsplit(' ').next().unwrap().parse().expect(said)
}

/// Numbers between -1 and 1, `(WORLDS, columns)`, another set for each `key`.
fn numbers(columns: usize, key: usize) -> Vec<f32> {
    let rows =
        (0..WORLDS).flat_map(|w| (0..columns).map(move |k| noise(w + 1, k + 64 * key) as f32));
    rows.collect()
}

fn array<'a>(field: &'a str, columns: usize, values: &'a [f32]) -> Command<'a> {
    Command {
        field,
        columns: 0..columns,
        values: Values::F32(values),
    }
}

fn step(client: &Client, key: usize) {
    let targets = numbers(DOFS, key);
    client
        .step(
            &[array("joint_target_q", DOFS, &targets)],
            &mut keep_waiting(),
        )
        .unwrap();
}

/// The `key`th command of a run in which everything that a client can ask for comes.
fn act(client: &Client, folder: &Folder, key: usize) {
    let hook = &mut keep_waiting();
    let description = client.description();
    let columns = |name: &str| {
        let mut inputs = description.writes.iter().chain(&description.commands);
        inputs.find(|input| input.name == name).expect(name).columns
    };
    let mask: Vec<bool> = (0..WORLDS).map(|w| noise(w, key) > 0.5).collect();
    let seeds: Vec<u64> = (0..WORLDS as u64).map(|w| w + 1000 * key as u64).collect();
    let file = folder.file("worlds");
    let done = match key % 100 {
        7 => client.reset(Some(&mask), None, hook),
        17 => client.reset(Some(&mask), Some(&seeds), hook),
        27 => client.write(
            &[array("joint_qd", DOFS, &numbers(DOFS, key))],
            Some(&mask),
            hook,
        ),
        37 => {
            let gains: Vec<f32> = numbers(DOFS, key)
                .iter()
                .map(|x| 1000.0 + 500.0 * x)
                .collect();
            client.write(&[array("joint_target_ke", DOFS, &gains)], Some(&mask), hook)
        }
        47 => {
            let pushes = numbers(columns("body_f"), key);
            client.step(&[array("body_f", columns("body_f"), &pushes)], hook)
        }
        57 => client.snapshot(&file, hook),
        67 if key > 100 => client.restore(&file, Some(&mask), None, hook),
        77 if key > 100 => client.restore(&file, None, Some(key as u64 % WORLDS as u64), hook),
        87 => client.forward(hook),
        97 => {
            let all = [numbers(DOFS, key), numbers(DOFS, key + 1)];
            client.step(
                &[
                    array("joint_f", DOFS, &all[0]),
                    array("joint_target_q", DOFS, &all[1]),
                ],
                hook,
            )
        }
        _ => client.step(&[array("joint_target_q", DOFS, &numbers(DOFS, key))], hook),
    };
    done.unwrap();
}

/// The scene with start states that are drawn.
fn drawn() -> String {
    format!(
        "{}[randomize.joint_q]\narm = {{ uniform = [-0.1, 0.1] }}\n",
        scene()
    )
}

/// A daemon of 64 worlds in which [`act`] may do everything, and a client that has done some of it.
fn under_way(name: &str, folder: &Folder) -> (Daemon, Client) {
    let flags = [
        "--worlds",
        "64",
        "--params",
        "joint_target_ke,body_f",
        "--joint-qd-max",
        "20",
        "--on-fault",
        "reset",
    ];
    let daemon = Daemon::start_scene(name, &drawn(), &flags);
    let client = daemon.attach();
    for key in 0..120 {
        act(&client, folder, key);
    }
    (daemon, client)
}

/// Tries until it works or some seconds are over.
fn soon<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(done) = attempt() {
            return done;
        }
        assert!(start.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Files in shared memory that are of this daemon.
fn files(daemon: &Daemon) -> usize {
    daemon.leftovers().len()
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
fn a_recorder_that_stands_loses_entries_says_so_and_keeps_nobody_waiting() {
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
    send(recorder.child.id(), Signal::CONT);
    let mut news = String::new();
    recorder.news.read_line(&mut news).unwrap();
    assert!(news.contains("after frame 100 a gap"), "{news}");
    (0..50).for_each(|key| step(&client, key));
    std::thread::sleep(Duration::from_millis(300));
    let (said, code) = recorder.stop();
    assert_eq!(code, 0, "{said}");
    let lost = said.split("1 gap of ").nth(1).expect(&said);
    let lost: u64 = lost.split(' ').next().unwrap().parse().unwrap();
    assert_eq!(frames(&said) + lost, 100 + steps as u64 + 50, "{said}");
    let (said, code) = run(&["replay", &file]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains(&format!("before frame 100 a gap: {lost} entries were lost")),
        "{said}"
    );
}

#[test]
fn a_full_disk_ends_the_recording_with_an_error_and_not_the_simulation() {
    let folder = Folder::new("full");
    let daemon = Daemon::start("record-full", &["--worlds", "64"]);
    let client = daemon.attach();
    let file = folder.file("full.tlrec");
    let line = ["record", &daemon.name, &file];
    // 400 kB; the shell becomes the recorder
    let limited = tightloop(&line);
    let program = limited.get_program().to_owned();
    let arguments: Vec<_> = limited
        .get_args()
        .map(|a| a.to_str().unwrap().to_owned())
        .collect();
    let mut shell = std::process::Command::new("bash");
    shell
        .args(["-c", "ulimit -f 400; exec \"$0\" \"$@\""])
        .arg(program)
        .args(arguments);
    shell.envs(
        limited
            .get_envs()
            .filter_map(|(key, value)| Some((key, value?))),
    );
    shell.stdin(std::process::Stdio::null());
    shell
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped());
    let mut child = shell.spawn().unwrap();
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
    client.release();
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
    std::thread::sleep(Duration::from_millis(300));
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
fn a_robot_file_that_has_changed_since_is_told() {
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

//! Recorders, replays, and a run in which everything that a client can ask for comes.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Output};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use sim_protocol::{Client, Command, Values, keep_waiting};

use crate::common::noise;
use crate::daemon::{Daemon, scene, send, tightloop, unique};

pub const WORLDS: usize = 64;
pub const DOFS: usize = 9;

/// A folder of a test, which goes with it.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("tightloop-{}", unique(test)));
        std::fs::create_dir(&path).unwrap();
        Folder(path)
    }

    pub fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap();
    }
}

/// A recorder that has begun.
pub struct Recorder {
    pub child: Child,
    pub news: BufReader<std::process::ChildStderr>,
}

impl Recorder {
    pub fn start(name: &str, out: &str, flags: &[&str]) -> Recorder {
        let line = [&["record", name, out], flags].concat();
        let mut child = tightloop(&line).spawn().unwrap();
        let mut news = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        news.read_line(&mut said).unwrap();
        assert!(said.contains("recording "), "{said}");
        Recorder { child, news }
    }

    /// Waits for its end; what it said on both streams, and its exit code.
    pub fn finish(mut self) -> (String, i32) {
        let mut said = String::new();
        let mut stdout = self.child.stdout.take().unwrap();
        stdout.read_to_string(&mut said).unwrap();
        self.news.read_to_string(&mut said).unwrap();
        let code = self.child.wait().unwrap().code().unwrap_or(-1);
        (said, code)
    }

    /// Asks it to end, and waits for that.
    pub fn stop(self) -> (String, i32) {
        send(self.child.id(), Signal::TERM);
        self.finish()
    }

    pub fn kill(&mut self) {
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
pub fn run(line: &[&str]) -> (String, i32) {
    let Output {
        status,
        stdout,
        stderr,
    } = tightloop(line).output().unwrap();
    let said = String::from_utf8(stdout).unwrap() + &String::from_utf8(stderr).unwrap();
    (said, status.code().unwrap_or(-1))
}

/// Replays a file that must be equal; what it said.
pub fn replay(file: &str) -> String {
    let (said, code) = run(&["replay", file]);
    assert!(
        code == 0 && said.contains("equal, bit for bit"),
        "{code}: {said}"
    );
    said
}

/// The number of frames in "FILE: 123 frames …".
pub fn frames(said: &str) -> u64 {
    let before = said.split_once(" frames").expect(said).0;
    before.rsplit(' ').next().unwrap().parse().expect(said)
}

/// Numbers between -1 and 1, `(WORLDS, columns)`, another set for each `key`.
pub fn numbers(columns: usize, key: usize) -> Vec<f32> {
    let rows =
        (0..WORLDS).flat_map(|w| (0..columns).map(move |k| noise(w + 1, k + 64 * key) as f32));
    rows.collect()
}

pub fn array<'a>(field: &'a str, columns: usize, values: &'a [f32]) -> Command<'a> {
    Command {
        field,
        columns: 0..columns,
        values: Values::F32(values),
    }
}

pub fn step(client: &Client, key: usize) {
    let targets = numbers(DOFS, key);
    client
        .step(
            &[array("joint_target_q", DOFS, &targets)],
            &mut keep_waiting(),
        )
        .unwrap();
}

/// The `key`th command of a run in which everything that a client can ask for comes.
pub fn act(client: &Client, folder: &Folder, key: usize) {
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
pub fn drawn() -> String {
    format!(
        "{}[randomize.joint_q]\narm = {{ uniform = [-0.1, 0.1] }}\n",
        scene()
    )
}

/// A daemon of 64 worlds in which [`act`] may do everything, and a client that has done some of it.
pub fn under_way(name: &str, folder: &Folder) -> (Daemon, Client) {
    let flags = [
        "--worlds",
        "64",
        "--params",
        "joint_target_ke,body_f",
        "--joint-qd-max",
        "20",
        "--on-fault",
        "reset",
        "--draws",
        "seed",
    ];
    let daemon = Daemon::start_scene(name, &drawn(), &flags);
    let client = daemon.attach();
    for key in 0..120 {
        act(&client, folder, key);
    }
    (daemon, client)
}

/// Tries until it works or some seconds are over.
pub fn soon<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
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
pub fn files(daemon: &Daemon) -> usize {
    daemon.leftovers().len()
}

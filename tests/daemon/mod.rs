//! Daemons for tests and benches: processes of this very program, each with a name of its own.
#![allow(dead_code)] // each test binary uses its part

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use sim_protocol::{
    AttachOptions, Client, ProtocolError, cleanup_after_death, keep_waiting, paths,
};

/// Holds the command line of a daemon, separated by line breaks, in the process that is to be one.
const COMMAND_LINE: &str = "TIGHTLOOP_TEST_COMMAND_LINE";

/// Becomes a daemon when this process was started to be one; else returns at once.
pub fn serve_if_asked() {
    if let Ok(line) = std::env::var(COMMAND_LINE) {
        std::process::exit(sim_daemon::serve(line.split('\n').map(Into::into)));
    }
}

/// A daemon process. Dropping it kills it and removes what it leaves.
pub struct Daemon {
    pub child: Child,
    pub name: String,
    /// The line it printed: `{"ready": …}` or `{"error": …}`.
    pub said: serde_json::Value,
}

/// The FR3 with its hand, position-driven, as a scene.
pub fn scene() -> String {
    let urdf =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples/assets/fr3/fr3_franka_hand.urdf");
    format!(
        "dt = {}\nsubsteps = 8\n[[robot]]\nname = \"arm\"\nurdf = {urdf:?}\n\
         joint_target_ke = [4500, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100]\n\
         joint_target_kd = [450, 450, 350, 350, 200, 200, 200, 10, 10]\n",
        1.0 / 480.0
    )
}

/// This very program, under the emulator that `TIGHTLOOP_RUNNER` names where it is for another processor.
fn this_program() -> Command {
    let program = std::env::current_exe().unwrap();
    let runner = std::env::var("TIGHTLOOP_RUNNER").unwrap_or_default();
    let mut words = runner.split_whitespace();
    match words.next() {
        None => Command::new(program),
        Some(emulator) => {
            let mut command = Command::new(emulator);
            command.args(words).arg(program);
            command
        }
    }
}

/// A process of this very program that runs a command line, its name left out.
pub fn tightloop(line: &[&str]) -> Command {
    let mut command = this_program();
    command
        .args([
            "daemon_process",
            "--exact",
            "--nocapture",
            "--test-threads=1",
        ])
        .env(COMMAND_LINE, format!("tightloop\n{}", line.join("\n")))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

impl Daemon {
    /// Starts a daemon of [`scene`] and waits for its line. In a test binary, a test named `daemon_process` must call
    /// [`serve_if_asked`]; in a bench, `main` must.
    pub fn start(name: &str, flags: &[&str]) -> Daemon {
        Daemon::start_scene(name, &scene(), flags)
    }

    /// As [`Daemon::start`], of another scene.
    pub fn start_scene(name: &str, scene: &str, flags: &[&str]) -> Daemon {
        let name = unique(name);
        Daemon::start_as(&name, scene, flags)
    }

    /// As [`Daemon::start_scene`], under exactly this name.
    pub fn start_as(name: &str, scene: &str, flags: &[&str]) -> Daemon {
        let mut line = vec!["serve", "-", "--name", name];
        line.extend(flags);
        let mut child = tightloop(&line)
            .stdin(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // a daemon that refuses its arguments does not read the scene
        let _ = child.stdin.take().unwrap().write_all(scene.as_bytes());
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        // the test harness writes before and after it, also in its line
        let said = lines.find_map(|line| {
            let line = line.unwrap();
            serde_json::from_str(&line[line.find('{')?..]).ok()
        });
        Daemon {
            child,
            name: name.to_owned(),
            said: said.unwrap_or_default(),
        }
    }

    /// Kind and message of the error that kept it from starting.
    pub fn error(&self) -> (&str, &str) {
        let part = |key: &str| self.said["error"][key].as_str().unwrap_or("no error");
        (part("kind"), part("message"))
    }

    /// A client of it.
    pub fn attach(&self) -> Client {
        attach(&self.name).unwrap()
    }

    /// Kills it as nothing else does: it cannot clean up.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: rustix::process::Signal) {
        send(self.child.id(), signal);
    }

    /// Files in shared memory that are of this daemon.
    pub fn leftovers(&self) -> Vec<String> {
        leftovers(&self.name)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = cleanup_after_death(None, &self.name);
    }
}

/// Attaches to a daemon.
pub fn attach(name: &str) -> Result<Client, ProtocolError> {
    Client::attach(name, &AttachOptions::default(), &mut keep_waiting())
}

/// Sends a signal to a process that the caller started.
pub fn send(pid: u32, signal: rustix::process::Signal) {
    let pid = rustix::process::Pid::from_raw(pid as i32).unwrap();
    rustix::process::kill_process(pid, signal).unwrap();
}

/// Stops a process that the caller started, and returns once it stands.
pub fn freeze(pid: u32) {
    send(pid, rustix::process::Signal::STOP);
    let stands = || {
        std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| stat.contains(") T "))
    };
    while !stands() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// A name that no other test uses.
pub fn unique(name: &str) -> String {
    use std::sync::atomic::{AtomicU32, Ordering};
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!(
        "{name}-{}-{}",
        std::process::id(),
        COUNT.fetch_add(1, Ordering::Relaxed)
    )
}

/// Files of a name: its lock, and what begins with its stem in shared memory.
pub fn leftovers(name: &str) -> Vec<String> {
    let daemon = paths::DaemonPaths::new(None, name).unwrap();
    let mut files: Vec<String> = std::fs::read_dir(paths::shared_memory())
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().into_string().ok())
        .filter(|file| file.starts_with(daemon.stem()))
        .collect();
    files.extend(
        daemon
            .lock_path()
            .exists()
            .then(|| daemon.lock_path().display().to_string()),
    );
    files
}

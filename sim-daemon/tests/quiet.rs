//! `tightloop serve` as a process: what it prints besides its one line, and which drivers it loads.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};

const SWING: &str = r#"<robot name="swing">
<link name="base"/>
<link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
</robot>"#;

/// A daemon that is ready.
struct Daemon {
    process: Child,
    stderr: ChildStderr,
    folder: PathBuf,
    ready: serde_json::Value,
}

/// What was left when a daemon had ended.
struct Left {
    stderr: String,
    code: Option<i32>,
}

impl Daemon {
    /// With these arguments, in an environment without `XDG_RUNTIME_DIR`.
    fn serve(name: &str, arguments: &[&str]) -> Daemon {
        let name = format!("quiet-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(&name);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("swing.urdf"), SWING).unwrap();
        let scene = "dt = 0.01\nsubsteps = 1\n[[robot]]\nname = \"swing\"\nurdf = \"swing.urdf\"\n";
        std::fs::write(folder.join("scene.toml"), scene).unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_tightloop"))
            .args(["serve", "scene.toml", "--log", "log", "--name", &name])
            .args(arguments)
            // it ends with us, also where a test fails
            .args(["--parent", &std::process::id().to_string()])
            .current_dir(&folder)
            .env_remove("XDG_RUNTIME_DIR")
            .env_remove("TIGHTLOOP_ROOT")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let stdout = process.stdout.take().unwrap();
        BufReader::new(stdout).read_line(&mut line).unwrap();
        let said: serde_json::Value = serde_json::from_str(&line).unwrap();
        Daemon {
            stderr: process.stderr.take().unwrap(),
            process,
            folder,
            ready: said["ready"].clone(),
        }
    }

    /// Whether a library is mapped into the process.
    fn has_loaded(&self, library: &str) -> bool {
        let maps = format!("/proc/{}/maps", self.process.id());
        std::fs::read_to_string(maps).unwrap().contains(library)
    }

    fn end(mut self) -> Left {
        let pid = rustix::process::Pid::from_child(&self.process);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        let code = self.process.wait().unwrap().code();
        let mut stderr = String::new();
        self.stderr.read_to_string(&mut stderr).unwrap();
        std::fs::remove_dir_all(&self.folder).unwrap();
        Left { stderr, code }
    }
}

#[test]
fn on_the_processor_it_prints_nothing_on_stderr_and_loads_no_vulkan() {
    for device in ["cpu", "auto"] {
        let daemon = Daemon::serve(device, &["--device", device, "--worlds", "8"]);
        let chosen = daemon.ready["device"].as_str().unwrap();
        assert!(chosen.starts_with("cpu"), "{chosen}");
        assert!(!daemon.has_loaded("vulkan"));
        let left = daemon.end();
        assert_eq!((left.stderr.as_str(), left.code), ("", Some(0)));
    }
}

#[test]
fn on_a_gpu_it_prints_nothing_on_stderr_and_its_root_folder_is_the_usual_one() {
    let daemon = Daemon::serve("gpu", &["--device", "gpu"]);
    assert!(daemon.has_loaded("libvulkan"), "{}", daemon.ready);
    let user = rustix::process::getuid().as_raw();
    let root = Path::new("/dev/shm").join(format!("tightloop-{user}"));
    assert_eq!(daemon.ready["root"], root.to_str().unwrap());
    let left = daemon.end();
    assert_eq!((left.stderr.as_str(), left.code), ("", Some(0)));
}

#[test]
fn devices_prints_nothing_on_stderr() {
    let said = Command::new(env!("CARGO_BIN_EXE_tightloop"))
        .arg("devices")
        .env_remove("XDG_RUNTIME_DIR")
        .output()
        .unwrap();
    assert!(said.status.success() && !said.stdout.is_empty());
    assert_eq!(String::from_utf8_lossy(&said.stderr), "");
}

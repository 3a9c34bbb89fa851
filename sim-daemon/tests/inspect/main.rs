//! `tightloop inspect` as a process: what it prints, what it draws, what it refuses.

mod picture;
mod report;

use std::path::{Path, PathBuf};
use std::process::Command;

/// What a run said.
struct Said {
    code: i32,
    out: String,
    err: String,
}

/// A folder of its own for a test, empty, removed with it.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// Names of the files in it.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// `tightloop inspect` with these arguments, in this folder.
fn inspect(folder: &Path, arguments: &[&str]) -> Said {
    let output = Command::new(env!("CARGO_BIN_EXE_tightloop"))
        .arg("inspect")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    Said {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The root of the repository.
fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap().to_owned()
}

const FR3: &str = "examples/assets/fr3/fr3_franka_hand.urdf";

/// A robot of one fixed link with this in it.
fn one_link(name: &str, inside: &str) -> String {
    format!("<robot name=\"{name}\"><link name=\"only\">{inside}</link></robot>")
}

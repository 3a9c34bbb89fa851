//! The folder `tests/malformed`: each `name.urdf` is refused with the message in `name.txt`, word for word.

use crate::measure::measure;
use sim_model::{Robot, UrdfOptions};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Memory for a file of a page [bytes]: XML, numbers and messages take some ten times its size.
const MEMORY_MAX: usize = 1 << 20;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed")
}

fn files(ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder()).unwrap();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|found| found == ending))
        .collect();
    files.sort();
    files
}

#[test]
fn every_malformed_file_is_refused_with_its_message() {
    let root = format!("{}/", folder().display());
    let files = files("urdf");
    assert!(files.len() >= 100, "{} files", files.len());
    let mut wrong = Vec::new();
    for file in &files {
        let name = file.file_name().unwrap().to_str().unwrap();
        let expected = std::fs::read_to_string(file.with_extension("txt")).expect(name);
        let reading = measure(|| Robot::from_urdf(file, UrdfOptions::default()));
        let message = match reading.result {
            Ok(_) => "it is accepted".to_owned(),
            Err(error) => error.to_string().replace(&root, ""),
        };
        if message != expected.trim_end() {
            wrong.push(format!(
                "{name}\n  says   {message}\n  not    {}",
                expected.trim_end()
            ));
        }
        if reading.time > Duration::from_secs(1) || reading.memory > MEMORY_MAX {
            wrong.push(format!(
                "{name} takes {:?} and {} bytes",
                reading.time, reading.memory
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_message_stands_beside_its_file_and_names_it() {
    for text in files("txt") {
        let file = text.with_extension("urdf");
        assert!(file.is_file(), "{} is missing", file.display());
        let name = file.file_name().unwrap().to_str().unwrap();
        let message = std::fs::read_to_string(&text).unwrap();
        assert!(
            message.starts_with(&format!("{name}:")),
            "{name}: {message}"
        );
        // what is wrong, then the cure, if not both in one
        let has_cure = message.contains("; ") || message.contains(" must be ");
        assert!(has_cure, "{name}: {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{name}: {message}");
        assert!(message.len() < 600, "{name}: {} bytes", message.len());
    }
}

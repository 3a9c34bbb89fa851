//! Every seed of the fuzz targets, and every input that once broke a reader, goes through its reader on any toolchain.

// each of the two fuzz packages has the module that writes files
#![allow(clippy::duplicate_mod)]

#[path = "fuzz/src/lib.rs"]
mod readers;
#[path = "fuzz/simulation/src/lib.rs"]
mod simulation;

use std::path::Path;
use std::time::{Duration, Instant};

use readers::Reader;

/// Time for an input, on a machine under load: none takes a tenth of it.
const PATIENCE: Duration = Duration::from_secs(10);

/// All readers, with the folder of their targets.
fn readers() -> impl Iterator<Item = (&'static str, &'static str, Reader)> {
    let light = readers::READERS.map(|(target, reader)| ("tests/fuzz", target, reader));
    let others =
        simulation::READERS.map(|(target, reader)| ("tests/fuzz/simulation", target, reader));
    light.into_iter().chain(others)
}

/// Reads all inputs of a corpus; says how many there are.
fn read_all(target: &str, reader: Reader) -> usize {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("tests/fuzz/corpus").join(target);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{folder:?}: {e}"));
    let inputs: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    for input in &inputs {
        let bytes = std::fs::read(input).unwrap();
        assert!(bytes.len() < 8000, "{input:?} has {} bytes", bytes.len());
        // the name of the input stands above a panic
        println!("{}", input.display());
        let start = Instant::now();
        reader(&bytes);
        assert!(start.elapsed() < PATIENCE, "{input:?}");
    }
    inputs.len()
}

#[test]
fn every_input_of_every_corpus_is_read_or_refused() {
    for (_, target, reader) in readers() {
        assert!(read_all(target, reader) > 0, "{target} has no inputs");
    }
}

#[test]
fn every_reader_has_a_target_and_no_corpus_is_of_none() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (folder, target, _) in readers() {
        let file = root.join(folder).join(format!("fuzz_targets/{target}.rs"));
        assert!(file.is_file(), "{file:?}");
    }
    for folder in std::fs::read_dir(root.join("tests/fuzz/corpus")).unwrap() {
        let name = folder.unwrap().file_name();
        let is_read = readers().any(|(_, target, _)| name == *target);
        assert!(is_read, "{name:?}");
    }
}

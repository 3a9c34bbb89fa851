//! The files of the machine beside those of Linux: random calls give the same on both.
#![cfg(target_os = "linux")]

mod common;

use std::path::Path;
use std::sync::{Arc, Mutex};

use common::run;

/// Calls of one run.
const CALLS: usize = 300;
const PATHS: [&str; 7] = ["a", "b", "a/x", "a/y", "a/x/z", "b/x", "b/x/z/../w"];
/// Files that are open at once.
const OPEN: usize = 4;

/// The calls of `std` that have other names on the machine.
mod real {
    use std::fs::{File, TryLockError};
    use std::io;
    use std::os::unix::fs::{FileExt, MetadataExt};
    use std::path::Path;

    pub use std::fs;

    pub fn taken(lock: Result<(), TryLockError>) -> io::Result<bool> {
        match lock {
            Ok(()) => Ok(true),
            Err(TryLockError::WouldBlock) => Ok(false),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    pub fn try_lock(file: &File) -> io::Result<bool> {
        taken(file.try_lock())
    }

    pub fn try_lock_shared(file: &File) -> io::Result<bool> {
        taken(file.try_lock_shared())
    }

    pub fn unlock(file: &File) -> io::Result<()> {
        file.unlock()
    }

    pub fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
        file.read_at(bytes, at)
    }

    pub fn write_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
        file.write_all_at(bytes, at)
    }

    pub fn is_nameless(status: &fs::Metadata) -> bool {
        status.nlink() == 0
    }

    pub fn absolute(path: &Path) -> io::Result<std::path::PathBuf> {
        fs::canonicalize(path)
    }

    pub fn is_at(file: &File, path: &Path) -> io::Result<bool> {
        let (status, there) = (file.metadata()?, fs::metadata(path));
        Ok(there.is_ok_and(|there| there.ino() == status.ino()))
    }
}

mod machine {
    pub use sim_machine::fs;
    pub use sim_machine::system::files::*;
}

/// A function that makes random calls, and returns what they gave.
macro_rules! calls {
    ($name:ident, $on:ident) => {
        fn $name(root: &Path, seed: u64) -> Vec<String> {
            use std::io::{Read, Write};
            use $on::fs::{self, File, OpenOptions};

            fn said<T: std::fmt::Debug>(result: std::io::Result<T>) -> String {
                format!("{:?}", result.map_err(|error| error.kind()))
            }
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut open: [Option<File>; OPEN] = Default::default();
            let mut lines = Vec::new();
            for _ in 0..CALLS {
                let [path, other] = [(); 2].map(|()| PATHS[rng.usize(0..PATHS.len())]);
                let (path, other) = (root.join(path), root.join(other));
                let (slot, length) = (rng.usize(0..OPEN), rng.usize(0..3000));
                let bits: [bool; 5] = std::array::from_fn(|_| rng.bool());
                let (call, at) = (rng.u32(0..24), rng.u64(0..5000));
                let bytes = vec![call as u8; length];
                let mut buffer = vec![0; length];
                let given = match (call, &mut open[slot]) {
                    (0..4, file) => {
                        let [read, write, create, create_new, truncate] = bits;
                        let mut options = OpenOptions::new();
                        options.read(read).write(write).create(create);
                        let opened = options
                            .create_new(create_new && at < 1000)
                            .truncate(truncate);
                        let opened = opened.open(&path);
                        let given = said(
                            opened
                                .as_ref()
                                .map(drop)
                                .map_err(|error| error.kind().into()),
                        );
                        *file = opened.ok();
                        given
                    }
                    (4, _) => said(fs::remove_file(&path)),
                    (5, _) => said(fs::remove_dir(&path)),
                    (6, _) => said(fs::create_dir(&path)),
                    (7, _) => said(fs::create_dir_all(&path)),
                    (8, _) if bits[0] && bits[1] => said(fs::remove_dir_all(&path)),
                    (9, _) => said(fs::rename(&path, &other)),
                    (10, _) if path != other => said(fs::copy(&path, &other)),
                    (11, _) => said(
                        fs::metadata(&path)
                            .map(|is| (is.is_dir(), is.is_file(), is.is_dir() || is.len() == at)),
                    ),
                    (12, _) => said(fs::read(&path)),
                    (13, _) => said(fs::read_dir(&path).map(|entries| {
                        let entries = entries.map(|entry| entry.unwrap());
                        let mut names: Vec<_> = entries
                            .map(|entry| (entry.file_name(), entry.file_type().unwrap().is_dir()))
                            .collect();
                        names.sort();
                        names
                    })),
                    (14, _) => said(
                        $on::absolute(&path)
                            .map(|path| path.strip_prefix(root).map(Path::to_owned)),
                    ),
                    (15, Some(file)) => said($on::try_lock(file)),
                    (16, Some(file)) => said($on::try_lock_shared(file)),
                    (17, Some(file)) => said($on::unlock(file)),
                    (18, Some(file)) => said(file.set_len(at)),
                    (19, Some(file)) => {
                        // folders have a length of their own on each file system
                        let given = file.metadata().map(|is| {
                            (
                                is.is_dir(),
                                is.is_file().then(|| is.len()),
                                $on::is_nameless(&is),
                            )
                        });
                        said(given) + &said($on::is_at(file, &path))
                    }
                    (20, Some(file)) => said($on::write_at(file, &bytes, at)),
                    (21, Some(file)) => {
                        said($on::read_at(file, &mut buffer, at)) + &format!("{buffer:?}")
                    }
                    (22, Some(file)) => said(file.write_all(&bytes)),
                    (23, Some(file)) => said(file.read(&mut buffer)) + &format!("{buffer:?}"),
                    _ => String::new(),
                };
                lines.push(format!(
                    "{call} {} {} {bits:?} {slot} {length} {at}: {given}",
                    path.display(),
                    other.display()
                ));
            }
            lines
        }
    };
}

calls!(on_linux, real);
calls!(on_the_machine, machine);

#[test]
fn random_calls_give_what_they_give_on_linux() {
    let root = std::env::temp_dir().join(format!("sim-machine-{}", std::process::id()));
    for seed in 0..200 {
        std::fs::create_dir_all(&root).unwrap();
        let wanted = on_linux(&root, seed);
        std::fs::remove_dir_all(&root).unwrap();
        let given: Arc<Mutex<Vec<String>>> = Arc::default();
        let (lines, folder) = (Arc::clone(&given), root.clone());
        let outcome = run(seed, 0).play(move || {
            sim_machine::fs::create_dir_all(&folder).unwrap();
            *lines.lock().unwrap() = on_the_machine(&folder, seed);
        });
        assert_eq!(outcome.failure, None, "{seed}");
        for (k, (given, wanted)) in given.lock().unwrap().iter().zip(&wanted).enumerate() {
            assert_eq!(given, wanted, "call {k} of {seed}");
        }
        assert_eq!(given.lock().unwrap().len(), CALLS);
    }
}

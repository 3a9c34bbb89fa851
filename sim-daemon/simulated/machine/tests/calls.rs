//! Calls of the system: their errors, and what a process asks about itself and others.

mod common;

use std::collections::BTreeSet;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use sim_machine::fs::{self, File, OpenOptions};
use sim_machine::system::files::{self, private};
use sim_machine::system::{cores, memory, open_files, signals, storage};
use sim_machine::{Run, process, thread};

use common::{kind, run, with_seeds};

#[test]
fn errors_are_those_of_linux() {
    with_seeds(|| {
        fs::create_dir_all("/tmp/folder/inner").unwrap();
        let file = Path::new("/tmp/folder/file");
        File::create(file).unwrap();
        let codes = [
            (fs::metadata("/tmp/none").err(), 2),
            (fs::metadata("/tmp/none/none").err(), 2),
            (fs::metadata("").err(), 2),
            (fs::metadata(file.join("none")).err(), 20),
            (fs::read_dir(file).err(), 20),
            (fs::remove_dir(file).err(), 20),
            (fs::remove_file("/tmp/folder/inner").err(), 21),
            (fs::remove_dir("/tmp/folder").err(), 39),
            (fs::create_dir("/tmp/folder").err(), 17),
            (fs::create_dir_all(file).err(), 17),
            (private().create_new(true).open(file).err(), 17),
            (private().open("/tmp/folder").err(), 21),
            (File::create("/tmp/none/file").err(), 2),
            (fs::read("/tmp/folder").err(), 21),
            (File::open(file).unwrap().set_len(0).err(), 22),
            (
                OpenOptions::new().read(true).create(true).open(file).err(),
                22,
            ),
            (
                fs::rename("/tmp/folder", "/tmp/folder/inner/folder").err(),
                22,
            ),
            (fs::rename("/tmp/none", "/tmp/other").err(), 2),
        ];
        for (k, (error, code)) in codes.into_iter().enumerate() {
            assert_eq!(error.unwrap().raw_os_error(), Some(code), "{k}");
        }
        assert!(File::open("/tmp/folder").is_ok());
        assert_eq!(
            files::absolute(Path::new("/tmp/folder/../folder/./file")).unwrap(),
            file
        );

        // rights: a folder that takes no files, and who may use what is made
        assert!(files::exposed(&fs::metadata("/tmp").unwrap()).is_some());
        files::make_private_folder(Path::new("/run/own/tl")).unwrap();
        assert_eq!(files::exposed(&fs::metadata("/run/own").unwrap()), None);
        assert!(fs::set_mode(Path::new("/run/own/tl"), 0o500));
        assert!(!files::is_writable(Path::new("/run/own/tl")));
        assert_eq!(
            kind(private().create(true).open("/run/own/tl/a")),
            Some(ErrorKind::PermissionDenied)
        );
        files::close_to_others(Path::new("/run/own/tl"));
        assert_eq!(fs::copy(file, "/run/own/tl/a").unwrap(), 0);
        assert!(fs::set_mode(Path::new("/run/own/tl/a"), 0o200));
        assert!(files::is_write_only(
            &fs::metadata("/run/own/tl/a").unwrap()
        ));
    });
}

type Call = (&'static str, fn() -> bool);

/// Each makes one call, and says whether it went well.
const CALLS: [Call; 24] = [
    ("open", || File::open("/tmp/file").is_ok()),
    ("create", || File::create("/tmp/new").is_ok()),
    ("metadata", || fs::metadata("/tmp/file").is_ok()),
    ("exists", || fs::exists(Path::new("/tmp/file"))),
    ("metadata of a file", || opened().metadata().is_ok()),
    ("set_len", || opened().set_len(1000).is_ok()),
    ("reserve", || storage::reserve(&opened(), 1000).is_ok()),
    ("read", || opened().read(&mut [0; 9]).is_ok()),
    ("write", || opened().write(&[0; 9]).is_ok()),
    ("read_at", || {
        files::read_at(&opened(), &mut [0; 9], 0).is_ok()
    }),
    ("write_at", || {
        files::write_at(&opened(), &[0; 9], 0).is_ok()
    }),
    ("lock", || files::try_lock(&opened()).is_ok()),
    ("lock_shared", || files::try_lock_shared(&opened()).is_ok()),
    ("unlock", || files::unlock(&opened()).is_ok()),
    ("absolute", || files::absolute(Path::new("/tmp")).is_ok()),
    ("free_bytes", || files::free_bytes(Path::new("/tmp")) > 0),
    ("available", || memory::available() < u64::MAX),
    ("count", || open_files::count().is_some()),
    ("try_one", || open_files::try_one().is_ok()),
    ("is_at", || {
        files::is_at(&opened(), Path::new("/tmp/file")).is_ok_and(|is_at| is_at)
    }),
    ("make a folder", || {
        let is_there = |error: std::io::Error| error.kind() == ErrorKind::AlreadyExists;
        fs::create_dir("/tmp/folder").is_ok_and(|()| true)
            || fs::create_dir("/tmp/folder").is_err_and(is_there)
    }),
    ("remove", || {
        fs::remove_file("/tmp/none").is_err_and(|error| error.kind() == ErrorKind::NotFound)
    }),
    ("rename", || {
        fs::rename("/tmp/none", "/tmp/no").is_err_and(|error| error.kind() == ErrorKind::NotFound)
    }),
    ("list", || {
        fs::read_dir("/tmp").is_ok_and(|mut entries| {
            entries.all(|entry| entry.is_ok_and(|entry| entry.metadata().is_ok()))
        })
    }),
];

fn opened() -> File {
    loop {
        if let Ok(file) = private().create(true).truncate(false).open("/tmp/file") {
            return file;
        }
    }
}

#[test]
fn every_call_fails_once_in_a_while() {
    for seed in 0..20 {
        let outcome = run(seed, 300_000).play(|| {
            for (name, call) in CALLS {
                drop(opened());
                let outcomes: BTreeSet<bool> = (0..100).map(|_| call()).collect();
                assert_eq!(outcomes.len(), 2, "{name} fails always or never");
            }
            // nothing is left open by a call that failed
            while open_files::count().is_none_or(|count| count > 1) {}
        });
        assert_eq!(outcome.failure, None, "{seed}");
    }
}

#[test]
fn a_seed_gives_the_same_run_of_files() {
    let racing = || {
        for _ in 0..3 {
            process::spawn(|| {
                for (_, call) in CALLS {
                    call();
                    cores::current().map(cores::leave);
                }
            });
        }
        thread::sleep(Duration::from_secs(1));
    };
    let traced = |seed| {
        Run {
            trace: true,
            ..run(seed, 100_000)
        }
        .play(racing)
    };
    let [one, same, other] = [7, 7, 8].map(traced);
    assert_eq!(one.failure, None);
    assert_eq!(one.trace, same.trace);
    assert_ne!(one.trace, other.trace);
    assert!(
        one.trace
            .iter()
            .any(|line| line.contains("opens /tmp/file"))
    );
}

#[test]
fn a_process_has_a_limit_of_open_files_of_its_own() {
    with_seeds(|| {
        open_files::set_limits(4, 8);
        let files: Vec<_> = (0..5).map(|_| File::open("/tmp")).collect();
        assert!(files[3].is_ok());
        let error = files[4].as_ref().unwrap_err();
        assert!(open_files::is_exhausted(error), "{error}");
        assert!(open_files::try_one().is_err() && open_files::count().is_none());
        let pid = process::spawn(|| {
            assert_eq!(open_files::count(), Some(1));
            open_files::raise_limit();
            assert_eq!(open_files::limit(), 8);
        });
        thread::sleep(Duration::from_millis(10));
        assert!(!process::is_alive(pid));
        assert_eq!(open_files::limit(), 4);
        drop(files);
        assert_eq!(open_files::count(), Some(1));
    });
}

#[test]
fn a_request_to_stop_sets_flags_or_kills() {
    use sim_machine::sync::Arc;
    use sim_machine::sync::atomic::{AtomicBool, Ordering};
    use sim_machine::system::process::{exists, is_gone, is_orphan};

    with_seeds(|| {
        let ended = std::sync::Arc::new(AtomicUsize::new(0));
        let (end, parent) = (std::sync::Arc::clone(&ended), process::id());
        let heeding = process::spawn(move || {
            let flag = Arc::new(AtomicBool::new(false));
            signals::on_stop(&flag).unwrap();
            while !flag.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(1));
            }
            assert!(!is_orphan(parent));
            end.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        });
        let other = process::spawn(|| thread::sleep(Duration::from_secs(1000)));
        thread::sleep(Duration::from_millis(10));
        assert!(exists(heeding) && !is_gone(heeding, other));
        [heeding, other].into_iter().for_each(signals::send);
        assert!(!exists(other) && !is_gone(heeding, other) && is_gone(other, parent));
        thread::sleep(Duration::from_millis(10));
        assert_eq!(ended.load(std::sync::atomic::Ordering::Relaxed), 1);
        assert!(!exists(heeding));
    });
}

#[test]
fn a_file_that_outlives_its_run_is_dropped_in_silence() {
    let kept: Arc<Mutex<Vec<File>>> = Arc::default();
    let keeper = Arc::clone(&kept);
    let outcome = run(1, 0).play(move || {
        keeper.lock().unwrap().push(File::open("/tmp").unwrap());
    });
    assert_eq!(outcome.failure, None);
    let panicking = run(1, 0).play(|| {
        let _file = File::open("/tmp").unwrap();
        panic!("on purpose");
    });
    let said = panicking.failure.unwrap();
    assert!(said.ends_with("on purpose"), "{said}");
    assert_eq!(std::mem::take(&mut *kept.lock().unwrap()).len(), 1);
}

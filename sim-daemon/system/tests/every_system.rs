//! What each system's module promises, on whichever of them these tests run.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use sim_system::files::{self, private};
use sim_system::storage::NewFile;
use sim_system::{clock, cores, memory, open_files, process, signals, streams};

/// A folder of a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let name = format!("tightloop-system-{test}-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        files::make_private_folder(&path).unwrap();
        Folder(path)
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<String> = entries
            .map(|entry| name(entry).into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A process that ends by itself.
fn child() -> std::process::Child {
    let mut command = Command::new(if cfg!(windows) { "hostname" } else { "true" });
    command.stdout(Stdio::null()).spawn().unwrap()
}

#[test]
fn the_clock_goes_on_and_a_sleep_does_not_end_early() {
    let before = clock::now();
    let until = before + 20_000_000;
    clock::sleep_until(until);
    let after = clock::now();
    assert!(after >= until && after > before, "{before} {after}");
    // a time that is over is not waited for
    clock::sleep_until(before);
    assert!(clock::now() - after < 1_000_000_000);
}

#[test]
fn a_process_is_there_until_it_ends_and_tells_its_age_and_memory() {
    let pid = std::process::id();
    assert!(process::exists(pid) && !process::is_gone(pid, pid));
    let mut ended = child();
    ended.wait().unwrap();
    assert!(!process::exists(ended.id()) && process::is_gone(ended.id(), pid));
    // nobody has asked for the exit code of this one
    let mut unasked = child();
    let mut tries = 0;
    while !process::is_gone(unasked.id(), pid) && tries < 500 {
        std::thread::sleep(Duration::from_millis(20));
        tries += 1;
    }
    assert!(process::is_gone(unasked.id(), pid));
    unasked.wait().unwrap();
    let age = process::age(pid).unwrap();
    assert!(age < Duration::from_secs(3600), "{age:?}");
    let all = process::memory(pid).unwrap();
    assert!(all > 100_000 && process::memory_shared(pid).is_none_or(|shared| shared < all));
    assert_eq!(process::missing(), None);
}

#[test]
fn a_lock_is_for_one_or_shared_and_keeps_nobody_from_reading() {
    let folder = Folder::new("locks");
    let path = folder.0.join("file");
    let open = || private().create(true).truncate(false).open(&path).unwrap();
    let (first, second) = (open(), open());
    files::write_at(&first, b"a line", 0).unwrap();
    assert!(files::try_lock(&first).unwrap());
    assert!(!files::try_lock(&second).unwrap() && !files::try_lock_shared(&second).unwrap());
    let mut bytes = [0; 16];
    assert_eq!(files::read_at(&second, &mut bytes, 2).unwrap(), 4);
    assert_eq!(&bytes[..4], b"line");
    assert_eq!(fs::read(&path).unwrap(), b"a line");
    files::unlock(&first).unwrap();
    let third = open();
    assert!(files::try_lock_shared(&second).unwrap() && files::try_lock_shared(&third).unwrap());
    assert!(!files::try_lock(&first).unwrap());
    // a lock ends with its file
    drop((second, third));
    assert!(files::try_lock(&first).unwrap());
}

#[test]
fn a_path_names_an_open_file_until_another_one_takes_its_place() {
    let folder = Folder::new("places");
    let (path, other) = (folder.0.join("file"), folder.0.join("other"));
    let file = private().create_new(true).open(&path).unwrap();
    assert!(files::is_at(&file, &path).unwrap());
    assert!(!files::is_at(&file, &other).unwrap());
    File::create(&other).unwrap();
    assert!(!files::is_at(&file, &other).unwrap());
    let bytes = files::path_to_bytes(&path);
    assert_eq!(files::path_from_bytes(&bytes).unwrap(), path);
    let metadata = fs::metadata(&folder.0).unwrap();
    assert!(files::is_own(&metadata) && files::exposed(&metadata).is_none());
    assert!(files::absolute(&folder.0).unwrap().is_absolute() && files::is_writable(&folder.0));
    assert!(files::free_bytes(&folder.0) > 0);
}

#[test]
fn a_file_has_its_name_when_it_is_complete_and_replaces_none() {
    let folder = Folder::new("storage");
    let path = folder.0.join("segment");
    let bytes = 1 << 16;
    for ends in [None, Some(4096)] {
        let new = NewFile::create(&folder.0, bytes, ends).unwrap();
        assert_eq!(new.file().metadata().unwrap().len(), bytes);
        assert!(!path.exists());
        files::write_at(new.file(), b"complete", 0).unwrap();
        sim_system::storage::reserve(new.file(), bytes).unwrap();
        new.publish(&path).unwrap();
        drop(new);
        assert_eq!(folder.names(), ["segment"]);
        let second = NewFile::create(&folder.0, bytes, ends).unwrap();
        let refused = second.publish(&path).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::AlreadyExists, "{refused}");
        drop(second);
        assert_eq!(folder.names(), ["segment"]);
        assert_eq!(&fs::read(&path).unwrap()[..8], b"complete");
        fs::remove_file(&path).unwrap();
    }
}

#[test]
fn streams_files_and_memory_are_there() {
    streams::stdout().unwrap().flush().unwrap();
    streams::stderr().unwrap().flush().unwrap();
    open_files::try_one().unwrap();
    open_files::raise_limit();
    assert!(open_files::limit() >= 256 && open_files::count() != Some(0));
    assert!(memory::available() > 1 << 20);
    let shared = std::path::Path::new(files::shared_memory());
    assert!(shared.is_dir() && files::is_writable(shared), "{shared:?}");
    assert_eq!(files::transport_problem(), None);
}

#[test]
fn a_core_that_is_not_there_is_refused_and_a_request_to_stop_is_heard() {
    assert!(cores::keep_to(&[1 << 20]).is_err());
    let flag = Arc::new(AtomicBool::new(false));
    signals::on_stop(&flag).unwrap();
    signals::survive_full_files();
    assert!(signals::set_priority(200).unwrap_err().contains("above 99"));
    assert!(!flag.load(std::sync::atomic::Ordering::Relaxed));
    #[cfg(unix)]
    {
        let pid = rustix::process::Pid::from_raw(std::process::id() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        // another thread may handle it
        let heard = || flag.load(std::sync::atomic::Ordering::Relaxed);
        let until = clock::now() + 5_000_000_000;
        while !heard() && clock::now() < until {
            std::thread::yield_now();
        }
        assert!(heard());
    }
}

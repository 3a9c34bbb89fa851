//! The files of the machine.

mod common;

use std::collections::BTreeSet;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use sim_machine::fs::{self, File};
use sim_machine::system::files::{self, private};
use sim_machine::system::{memory, storage};
use sim_machine::time::{SystemTime, jump};
use sim_machine::{process, thread};

use common::{kind, with_seeds};

const PAGE: u64 = 4096;

fn shared(name: &str) -> PathBuf {
    Path::new(files::shared_memory()).join(name)
}

fn made(path: &Path) -> File {
    private()
        .create(true)
        .truncate(false)
        .open(path)
        .expect("it can be made")
}

fn short_sleep() {
    thread::sleep(Duration::from_micros(sim_machine::random() % 200));
}

#[test]
fn one_process_at_a_time_has_a_lock_also_when_some_die() {
    with_seeds(|| {
        let holders = Arc::new(AtomicUsize::new(0));
        let taken = Arc::new(AtomicUsize::new(0));
        let holder = Arc::new(Mutex::new(None));
        for _ in 0..3 {
            let (holders, taken, holder) = (holders.clone(), taken.clone(), holder.clone());
            let enter = move || {
                let file = made(&shared("lock"));
                while !files::try_lock(&file).unwrap() {
                    short_sleep();
                }
                assert_eq!(holders.fetch_add(1, Ordering::Relaxed), 0);
                taken.fetch_add(1, Ordering::Relaxed);
                *holder.lock().unwrap() = Some(process::id());
                thread::sleep(Duration::from_millis(10));
                holders.fetch_sub(1, Ordering::Relaxed);
                *holder.lock().unwrap() = None;
            };
            process::spawn(enter);
        }
        let victim = loop {
            short_sleep();
            let present = *holder.lock().unwrap();
            if let Some(pid) = present {
                break pid;
            }
        };
        // it lets go of the lock without a word
        process::kill(victim);
        holders.store(0, Ordering::Relaxed);
        thread::sleep(Duration::from_millis(100));
        assert_eq!(taken.load(Ordering::Relaxed), 3);
        assert_eq!(process::living(), Vec::<u32>::new());
    });
}

#[test]
fn a_lock_belongs_to_an_open_file_and_ends_with_it() {
    with_seeds(|| {
        let path = shared("lock");
        let (one, two, three) = (made(&path), made(&path), made(&path));
        assert!(files::try_lock(&one).unwrap());
        assert!(files::try_lock(&one).unwrap(), "it has it");
        assert!(!files::try_lock(&two).unwrap());
        assert!(!files::try_lock_shared(&two).unwrap());
        files::unlock(&one).unwrap();
        assert!(files::try_lock_shared(&two).unwrap());
        assert!(files::try_lock_shared(&three).unwrap());
        assert!(!files::try_lock(&one).unwrap());
        drop(two);
        assert!(!files::try_lock(&one).unwrap());
        drop(three);
        assert!(files::try_lock(&one).unwrap());

        // as on Linux, a share that cannot become a lock is lost
        let (two, three) = (made(&path), made(&path));
        files::unlock(&one).unwrap();
        assert!(files::try_lock_shared(&one).unwrap() && files::try_lock_shared(&two).unwrap());
        assert!(!files::try_lock(&one).unwrap());
        drop(two);
        assert!(files::try_lock(&three).unwrap());
    });
}

#[test]
fn a_file_without_a_name_lives_until_it_is_closed_or_its_process_is_dead() {
    with_seeds(|| {
        let path = shared("file");
        let before = files::free_bytes(Path::new(files::shared_memory()));
        let free = || files::free_bytes(Path::new(files::shared_memory()));
        let mut file = made(&path);
        file.write_all(b"first").unwrap();
        assert!(files::is_at(&file, &path).unwrap());
        fs::remove_file(&path).unwrap();
        assert!(!fs::exists(&path) && files::is_nameless(&file.metadata().unwrap()));
        let second = made(&path);
        assert!(!files::is_at(&file, &path).unwrap() && files::is_at(&second, &path).unwrap());
        assert!(files::try_lock(&file).unwrap() && files::try_lock(&second).unwrap());
        let mut bytes = [0; 8];
        assert_eq!(files::read_at(&file, &mut bytes, 0).unwrap(), 5);
        assert_eq!(&bytes[..5], b"first");
        assert_eq!(free(), before - PAGE);
        drop(file);
        assert_eq!(free(), before);

        let pid = process::spawn(move || {
            let mut file = made(&shared("other"));
            file.write_all(&[1; 100]).unwrap();
            fs::remove_file(shared("other")).unwrap();
            thread::sleep(Duration::from_secs(1));
        });
        thread::sleep(Duration::from_millis(100));
        assert_eq!(free(), before - PAGE);
        process::kill(pid);
        assert_eq!(free(), before);
    });
}

#[test]
fn a_file_that_is_renamed_replaces_another_at_once() {
    with_seeds(|| {
        let path = shared("file");
        fs::create_dir_all(shared("folder")).unwrap();
        made(&path).write_all(&[0; 1000]).unwrap();
        let done = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&done);
        process::spawn(move || {
            for round in 1..5 {
                let new = shared("new");
                private()
                    .create_new(true)
                    .open(&new)
                    .and_then(|mut file| file.write_all(&[round; 1000]))
                    .unwrap();
                fs::rename(&new, shared("file")).unwrap();
            }
            ended.store(true, Ordering::Relaxed);
        });
        let mut last = 0;
        while !done.load(Ordering::Relaxed) {
            let bytes = fs::read(&path).unwrap();
            assert!(bytes.len() == 1000 && bytes.iter().all(|byte| *byte == bytes[0]));
            assert!(bytes[0] >= last);
            last = bytes[0];
        }
        assert_eq!(fs::read(&path).unwrap(), [4; 1000]);
        let onto_folder = fs::rename(&path, shared("folder"));
        assert_eq!(kind(onto_folder), Some(ErrorKind::IsADirectory));
        let elsewhere = fs::rename(&path, "/tmp/file");
        assert_eq!(kind(elsewhere), Some(ErrorKind::CrossesDevices));
        fs::rename(shared("folder"), shared("moved")).unwrap();
        assert_eq!(fs::list(&shared("")), [shared("file"), shared("moved")]);
    });
}

#[test]
fn a_kill_tears_long_writes_and_no_short_ones() {
    let torn: Arc<Mutex<BTreeSet<bool>>> = Arc::default();
    let seen = Arc::clone(&torn);
    with_seeds(move || {
        for (name, bytes) in [("short", 512_u64), ("long", 20_000)] {
            let pid = process::spawn(move || {
                let mut file = made(&shared(name));
                file.write_all(&vec![1; bytes as usize]).unwrap();
                files::write_at(&file, &vec![2; bytes as usize], 0).unwrap();
            });
            (0..sim_machine::random() % 10).for_each(|_| sim_machine::step("waits"));
            process::kill(pid);
            let Ok(written) = fs::read(shared(name)) else {
                continue;
            };
            let is_whole =
                written.len() as u64 == bytes && written[0] == written[written.len() - 1];
            let is_torn = !written.is_empty() && !is_whole;
            assert!(name == "long" || !is_torn, "{}", written.len());
            seen.lock().unwrap().insert(is_torn);
        }
    });
    assert_eq!(torn.lock().unwrap().len(), 2, "some are torn");
}

#[test]
fn shared_memory_ends_where_its_room_does() {
    with_seeds(|| {
        fs::set_capacity(4 * PAGE);
        let free = || files::free_bytes(Path::new(files::shared_memory())) / PAGE;
        let full = Some(ErrorKind::StorageFull);
        let mut file = made(&shared("file"));
        file.write_all(&[1; 10]).unwrap();
        assert_eq!(free(), 3);
        assert_eq!(kind(file.set_len(5 * PAGE)), full);
        assert_eq!(kind(storage::reserve(&file, 4 * PAGE + 1)), full);
        assert_eq!(file.metadata().unwrap().len(), 10);
        storage::reserve(&file, 2 * PAGE).unwrap();
        assert_eq!((free(), file.metadata().unwrap().len()), (2, 2 * PAGE));
        let mut other = made(&shared("other"));
        assert_eq!(kind(other.write_all(&[1; 9000])), full);
        // what there was room for is written
        assert_eq!((free(), other.metadata().unwrap().len()), (0, 2 * PAGE));
        assert_eq!(kind(files::write_at(&file, &[1; 1], 2 * PAGE)), full);
        files::write_at(&file, &[1; 1], 2 * PAGE - 1).unwrap();
        other.set_len(1).unwrap();
        assert_eq!(free(), 1);
        fs::remove_file(shared("file")).unwrap();
        assert_eq!(free(), 1);
        drop(file);
        assert_eq!(free(), 3);
        made(Path::new("/tmp/file")).set_len(1 << 20).unwrap();
        memory::set_available(10 * PAGE);
        assert_eq!(memory::available(), 9 * PAGE);
    });
}

#[test]
fn folders_are_listed_in_an_order_of_the_seed() {
    let orders: Arc<Mutex<BTreeSet<Vec<String>>>> = Arc::default();
    let seen = Arc::clone(&orders);
    with_seeds(move || {
        for name in ["a", "b", "c", "d"] {
            made(&shared(name)).write_all(name.as_bytes()).unwrap();
        }
        fs::create_dir_all(shared("folder/inner")).unwrap();
        let names = || -> Vec<String> {
            let entries = fs::read_dir(shared("")).unwrap().flatten();
            entries
                .map(|entry| entry.file_name().into_string().unwrap())
                .collect()
        };
        let mut listed = names();
        assert_eq!(listed, names());
        seen.lock().unwrap().insert(listed.clone());
        listed.sort();
        assert_eq!(listed, ["a", "b", "c", "d", "folder"]);
        for entry in fs::read_dir(shared("")).unwrap().flatten() {
            let (status, of_entry) = (fs::metadata(entry.path()).unwrap(), entry.metadata());
            let is_dir = entry.file_type().unwrap().is_dir();
            assert_eq!(status.is_dir(), is_dir);
            assert_eq!(status.len(), of_entry.unwrap().len());
            assert_eq!(is_dir, entry.file_name() == "folder");
            if !is_dir {
                fs::remove_file(entry.path()).unwrap();
                assert_eq!(kind(entry.metadata()), Some(ErrorKind::NotFound));
            }
        }
        assert_eq!(
            fs::list(&shared("")),
            [shared("folder"), shared("folder/inner")]
        );
        fs::remove_dir_all(shared("folder")).unwrap();
        assert_eq!(fs::list(&shared("")), Vec::<PathBuf>::new());
    });
    assert!(orders.lock().unwrap().len() > 10);
}

#[test]
fn what_was_written_is_read_and_copied() {
    with_seeds(|| {
        let (path, copied) = (shared("file"), shared("copy"));
        let bytes: Vec<u8> = (0..10_000_u32).map(|k| k as u8).collect();
        let mut file = made(&path);
        file.write_all(&bytes[..5000]).unwrap();
        file.write_all(&bytes[5000..]).unwrap();
        assert_eq!(fs::read(&path).unwrap(), bytes);
        assert_eq!(fs::copy(&path, &copied).unwrap(), 10_000);
        let mut text = Vec::new();
        let taken = File::open(&copied).unwrap().take(7000);
        { taken }.read_to_end(&mut text).unwrap();
        assert_eq!(text, bytes[..7000]);
        file.set_len(2).unwrap();
        file.set_len(4).unwrap();
        assert_eq!(fs::read(&path).unwrap(), [0, 1, 0, 0]);
        assert_eq!(fs::read(&copied).unwrap(), bytes);
    });
}

#[test]
fn times_of_files_follow_a_calendar_that_jumps() {
    with_seeds(|| {
        let modified = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
        let (folder, path) = (shared("folder"), shared("folder/file"));
        fs::create_dir_all(&folder).unwrap();
        let first = modified(&folder);
        thread::sleep(Duration::from_secs(2));
        let mut file = made(&path);
        assert!(modified(&folder) > first);
        let (second, created) = (modified(&folder), modified(&path));
        thread::sleep(Duration::from_secs(2));
        file.write_all(b"1").unwrap();
        assert_eq!(modified(&folder), second);
        assert!(modified(&path) > created);
        let age = modified(&path).elapsed().unwrap();
        assert!(age < Duration::from_secs(1), "{age:?}");
        jump(60_000_000_000);
        assert!(modified(&path).elapsed().unwrap() > Duration::from_secs(59));
        file.write_all(b"1").unwrap();
        jump(-120_000_000_000);
        assert!(modified(&path) > SystemTime::now() && modified(&path).elapsed().is_err());
    });
}

#[test]
fn folders_can_be_made_while_others_remove_them() {
    with_seeds(|| {
        let done = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&done);
        let remover = process::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                let removed = fs::remove_dir_all(shared("a"));
                let kind = kind(removed);
                assert!(
                    matches!(
                        kind,
                        None | Some(ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty)
                    ),
                    "{kind:?}"
                );
            }
        });
        let mut made_some = 0;
        for _ in 0..50 {
            match files::make_private_folder(&shared("a/b/c")) {
                Ok(()) => made_some += 1,
                Err(error) => assert!(files::is_passing(&error), "{error}"),
            }
            let _ = private().create(true).open(shared("a/b/c/file"));
        }
        done.store(true, Ordering::Relaxed);
        thread::sleep(Duration::from_millis(10));
        assert!(made_some > 0 && !process::is_alive(remover));
    });
}

//! The machine by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sim_machine::sync::{Condvar, Mutex, mpsc};
use sim_machine::thread;
use sim_machine::time::Instant;
use sim_machine::{Run, process};

fn run(seed: u64) -> Run {
    Run {
        seed,
        failing: 0,
        dropping: 0,
        preempting: 0,
        longest: 14,
        lateness: 1_000_000,
        steps_max: 100_000,
        trace: true,
    }
}

#[test]
fn a_seed_is_a_run_and_another_seed_another_run() {
    let racing = || {
        let shared = Arc::new(Mutex::new(Vec::new()));
        let threads: Vec<_> = (0..4)
            .map(|number| {
                let shared = Arc::clone(&shared);
                thread::Builder::new().spawn(move || {
                    for _ in 0..20 {
                        shared.lock().unwrap().push(number);
                        thread::sleep(Duration::from_micros(10 * number));
                    }
                })
            })
            .collect();
        for thread in threads {
            thread.unwrap().join().unwrap();
        }
        sim_machine::note(|| format!("{:?}", shared.lock().unwrap()));
    };
    let [one, same, other] = [1, 1, 2].map(|seed| run(seed).play(racing));
    assert_eq!(one.failure, None);
    assert_eq!(one.trace, same.trace);
    assert_ne!(one.trace.last(), other.trace.last());
}

#[test]
fn waits_end_by_the_clock_of_the_machine_and_by_a_word() {
    for seed in 0..200 {
        let outcome = run(seed).play(|| {
            let begin = Instant::now();
            let shared = Arc::new((Mutex::new(false), Condvar::new()));
            let (other, (sender, receiver)) = (Arc::clone(&shared), mpsc::channel());
            let notifier = thread::Builder::new().spawn(move || {
                thread::sleep(Duration::from_secs(100));
                *other.0.lock().unwrap() = true;
                other.1.notify_all();
                sender.send(7).unwrap();
            });
            let (mut guard, hour) = (shared.0.lock().unwrap(), Duration::from_secs(3600));
            while !*guard {
                guard = shared.1.wait_timeout(guard, hour).unwrap().0;
            }
            drop(guard);
            assert_eq!(receiver.recv_timeout(hour), Ok(7));
            assert!(receiver.recv_timeout(hour).is_err());
            let passed = begin.elapsed();
            assert!(
                passed >= Duration::from_secs(100) && passed < Duration::from_secs(101),
                "{passed:?}"
            );
            notifier.unwrap().join().unwrap();
        });
        assert_eq!(outcome.failure, None, "{seed}");
    }
}

#[test]
fn a_killed_process_takes_no_further_step() {
    for seed in 0..200 {
        let outcome = run(seed).play(|| {
            let count = Arc::new(AtomicU64::new(0));
            let counter = Arc::clone(&count);
            let pid = process::spawn(move || {
                loop {
                    counter.fetch_add(1, Ordering::Relaxed);
                    thread::sleep(Duration::from_millis(1));
                }
            });
            thread::sleep(Duration::from_millis(50));
            process::stop(pid);
            let stopped = count.load(Ordering::Relaxed);
            thread::sleep(Duration::from_millis(50));
            assert_eq!(count.load(Ordering::Relaxed), stopped);
            process::resume(pid);
            thread::sleep(Duration::from_millis(50));
            assert!(count.load(Ordering::Relaxed) > stopped);
            process::kill(pid);
            let last = count.load(Ordering::Relaxed);
            thread::sleep(Duration::from_millis(50));
            assert_eq!(count.load(Ordering::Relaxed), last);
            assert!(!process::is_alive(pid));
        });
        assert_eq!(outcome.failure, None, "{seed}");
    }
}

#[test]
fn a_process_is_killed_at_the_door_that_was_named() {
    let outcome = run(3).play(|| {
        let passed = Arc::new(AtomicU64::new(0));
        let inside = Arc::clone(&passed);
        let doomed = process::start(move || {
            process::Handle::this().kill_at_door(3);
            loop {
                sim_machine::step("goes on");
                inside.fetch_add(1, Ordering::Relaxed);
            }
        });
        while doomed.is_alive() {
            thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(passed.load(Ordering::Relaxed), 2);
        assert!(process::dead_since(doomed.pid).is_some());
    });
    assert_eq!(outcome.failure, None);
}

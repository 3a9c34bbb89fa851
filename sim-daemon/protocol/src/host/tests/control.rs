//! A client whose lease or daemon goes, and a host that answers when a test lets it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::fake::{Counted, Fake, STATE, alone, connect};
use crate::host::journal::RECORDERS_MAX;
use crate::host::{Host, Next};
use crate::memory::service::AnyThread;
use crate::presence::daemon_lock::DaemonLock;
use crate::presence::paths::{DaemonPaths, Presence};
use crate::transport;
use crate::waiting::waiter::Awaited;
use crate::wire::control::Request;
use crate::{AttachOptions, Client, Op, PROTOCOL_VERSION, ProtocolError, keep_waiting};

/// Longer than anything here takes, and than a holder may be silent.
const LONG: Duration = Duration::from_millis(2500);

/// Lets a client call while `look` looks after the host, again and again.
fn beside<T: Send>(
    host: &mut Host,
    call: impl FnOnce(Client) -> T + Send,
    mut look: impl FnMut(&mut Host),
) -> T {
    let root = host.daemon_lock().paths().root().to_owned();
    std::thread::scope(|scope| {
        let calls = scope.spawn(move || {
            let options = AttachOptions {
                root: Some(root),
                ..AttachOptions::default()
            };
            call(Client::attach("fake", &options, &mut keep_waiting()).unwrap())
        });
        while !calls.is_finished() {
            look(host);
            host.state.poll_services();
            std::thread::sleep(Duration::from_millis(1));
        }
        calls.join().unwrap()
    })
}

/// Whether somebody has been granted the lease of that number.
fn is_granted(host: &Host, epoch: u64) -> bool {
    let lease = host.state.lease.as_ref();
    lease.is_some_and(|lease| lease.epoch == epoch && lease.holder.is_some())
}

/// Time in which a client opens the ports of its lease.
const OPENING: Duration = Duration::from_millis(50);

#[test]
fn a_lease_that_goes_while_its_ports_are_opened_is_asked_for_again() {
    for opening in [Duration::ZERO, OPENING] {
        alone("taken-back", |host| {
            let acquire = |client: Client| client.acquire(&mut keep_waiting()).map(|()| client);
            let acquired = beside(host, acquire, |host| {
                if is_granted(host, 1) {
                    std::thread::sleep(opening);
                    host.state.renew();
                }
            });
            assert!(acquired.is_ok(), "{:?}", acquired.err());
            assert!(is_granted(host, 2), "after {opening:?}");
        });
    }
}

#[cfg(unix)] // Windows keeps files that are open
#[test]
fn a_lease_whose_ports_cannot_be_opened_is_given_back_at_once() {
    alone("unopenable", |host| {
        let services = host.daemon_lock().paths().shared_folder().join("services");
        let list = || {
            let entries = std::fs::read_dir(&services).unwrap();
            let files = entries.map(|entry| entry.unwrap().path());
            files.collect::<std::collections::BTreeSet<_>>()
        };
        let before = list();
        host.state.renew();
        let made = list();
        for file in made.difference(&before) {
            std::fs::remove_file(file).unwrap();
        }
        let acquire = |client: Client| client.acquire(&mut keep_waiting()).map(|()| client);
        let acquired = beside(host, acquire, |_| ());
        assert!(acquired.is_ok(), "{:?}", acquired.err());
        assert!(is_granted(host, 3));
    });
}

#[test]
fn a_lease_that_another_client_of_the_process_got_meanwhile_is_held() {
    alone("of-process", |host| {
        let other = transport::requester(&host.state.node).unwrap();
        let acquire = |client: Client| client.acquire(&mut keep_waiting());
        let acquired = beside(host, acquire, |host| {
            if is_granted(host, 1) {
                std::thread::sleep(OPENING);
                host.state.renew();
                let lease = host.state.lease.as_mut().unwrap();
                lease.grant(std::process::id(), other.id());
            }
        });
        assert!(
            matches!(acquired, Err(ProtocolError::LeaseHeld { .. })),
            "{acquired:?}"
        );
    });
}

#[test]
fn who_waits_for_a_frame_hears_that_the_lease_has_gone() {
    alone("gone-lease", |host| {
        let step = |client: Client| {
            let begin = Instant::now();
            let mut hook = || match begin.elapsed() < LONG {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            client.step(&[], &mut hook).map(drop)
        };
        let stepped = beside(host, step, |host| {
            if host.state.poll().unwrap() == Some(Next::Command) {
                host.state.renew();
            }
        });
        assert!(
            matches!(stepped, Err(ProtocolError::LeaseLost { .. })),
            "{stepped:?}"
        );
    });
}

#[test]
fn a_step_after_one_that_was_interrupted_gets_its_own_frame() {
    alone("own-frame", |host| {
        let (answers, mut owned) = (AtomicBool::new(false), Vec::new());
        let step = |client: Client| {
            client.acquire(&mut keep_waiting()).unwrap();
            let interrupted = client.step(&[], &mut || ControlFlow::Break(()));
            assert!(
                matches!(interrupted, Err(ProtocolError::Interrupted)),
                "{interrupted:?}"
            );
            answers.store(true, Ordering::Relaxed);
            let frame = client.step(&[], &mut keep_waiting()).unwrap();
            frame.header().ack_seq
        };
        let acknowledged = beside(host, step, |host| {
            if answers.load(Ordering::Relaxed) && host.state.poll().unwrap().is_some() {
                let mut worlds = Counted(1, Duration::ZERO, &mut owned);
                host.answer(Instant::now(), &mut worlds);
            }
        });
        assert_eq!(acknowledged, 2);
    });
}

#[test]
fn a_client_that_ends_a_daemon_asks_by_a_message_and_by_a_file() {
    alone("asked", |host| {
        let (connection, is_heard) = (connect(host), AtomicBool::new(false));
        let (begin, mut next) = (Instant::now(), None);
        let is_asked = std::thread::scope(|scope| {
            scope.spawn(|| {
                connection.shut_down(&mut || match is_heard.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                })
            });
            while next.is_none() && begin.elapsed() < LONG {
                next = host.state.poll_services();
            }
            let is_asked = host.daemon_lock().paths().is_asked_to_stop();
            is_heard.store(true, Ordering::Relaxed);
            is_asked
        });
        assert_eq!((next, is_asked), (Some(Next::End), true));
    });
}

#[test]
fn who_ends_a_daemon_that_has_ended_asks_nothing_of_the_next_one() {
    let fake = Fake::start("ended");
    let client = fake.attach();
    let paths = DaemonPaths::new(Some(&fake.root), &fake.name).unwrap();
    drop(fake);
    let next = DaemonLock::take(&paths).unwrap();
    // in another process
    let line = format!("tightloop {PROTOCOL_VERSION} 1 0000000000000008\n");
    std::fs::write(paths.lock_path(), line).unwrap();
    assert!(matches!(paths.presence(), Ok(Presence::Running(_))));
    client.shutdown(&mut keep_waiting()).unwrap();
    assert!(!paths.is_asked_to_stop());
    drop((next, client));
    std::fs::remove_dir(paths.root()).unwrap();
}

#[test]
fn a_client_that_rests_keeps_its_lease() {
    let fake = Fake::start("rests");
    let (client, other) = (fake.attach(), fake.attach());
    client.acquire(&mut keep_waiting()).unwrap();
    std::thread::sleep(LONG);
    let refused = other.acquire(&mut keep_waiting()).unwrap_err();
    assert!(
        matches!(refused, ProtocolError::LeaseHeld { .. }),
        "{refused}"
    );
    client.step(&[], &mut keep_waiting()).unwrap();
}

#[test]
fn a_client_is_refused_more_frames_than_it_may_hold() {
    let fake = Fake::start("holds");
    let (client, observer) = (fake.attach(), fake.attach());
    let held = client.description().frames_held;
    let (mut stepped, mut seen) = (Vec::new(), Vec::new());
    for _ in 0..held {
        stepped.push(client.step(&[], &mut keep_waiting()).unwrap());
        seen.extend(observer.wait_newer(None, &mut keep_waiting()).unwrap());
    }
    assert_eq!(seen.len(), held);
    let refused = [
        client.step(&[], &mut keep_waiting()).map(drop),
        observer.latest(&mut keep_waiting()).map(drop),
    ];
    for refused in refused {
        assert!(
            matches!(refused, Err(ProtocolError::FramesHeld { held: 2 })),
            "{refused:?}"
        );
    }
    drop((stepped, seen));
    client.step(&[], &mut keep_waiting()).unwrap();
    observer.latest(&mut keep_waiting()).unwrap();
}

#[cfg(unix)] // Windows keeps files that are open
#[test]
fn a_client_goes_on_with_its_daemon_after_a_logout() {
    let fake = Fake::start("went");
    let client = fake.attach();
    client.step(&[], &mut keep_waiting()).unwrap();
    std::fs::remove_dir_all(&fake.root).unwrap();
    client.step(&[], &mut keep_waiting()).unwrap();
    client.timing(false, &mut keep_waiting()).unwrap();
    client.check_alive().unwrap();
    std::fs::create_dir(&fake.root).unwrap();
}

#[test]
fn ports_that_cannot_be_opened_at_once_are_tried_again() {
    alone("ports", |host| {
        let (connection, tries) = (connect(host), std::cell::Cell::new(0));
        let opened = connection.ports(&mut keep_waiting(), |_| {
            tries.set(tries.get() + 1);
            match tries.get() {
                1 => Err(ProtocolError::transport("open a port", "not there yet")),
                tried => Ok(tried),
            }
        });
        assert_eq!(opened.unwrap(), 2);
    });
}

#[cfg(unix)] // Windows keeps files that are open
#[test]
fn a_request_that_the_daemon_cannot_read_ends_with_its_reason() {
    alone("unread", |host| {
        let folder = host.daemon_lock().paths().shared_folder();
        let data = || {
            let entries = std::fs::read_dir(&folder).unwrap();
            let files = entries.map(|entry| entry.unwrap().path());
            let is_data =
                |path: &std::path::PathBuf| path.extension().is_some_and(|kind| kind == "data");
            files.filter(is_data).collect::<Vec<_>>()
        };
        let before = data();
        let connection = connect(host);
        let segment = data().into_iter().find(|file| !before.contains(file));
        // before the daemon has opened it
        std::fs::remove_file(segment.unwrap()).unwrap();
        let timing = Request::Timing { clear: false };
        let refused = std::thread::scope(|scope| {
            let asks = scope.spawn(|| connection.ask_within(LONG, &timing, &mut keep_waiting()));
            while !asks.is_finished() {
                host.state.poll_services();
                std::thread::sleep(Duration::from_millis(1));
            }
            asks.join().unwrap()
        });
        assert!(
            matches!(refused, Err(ProtocolError::Unreached { .. })),
            "{refused:?}"
        );
    });
}

#[test]
fn a_recorder_gets_the_inputs_of_a_step_whose_client_has_gone() {
    alone("inputs", |host| {
        let record = |client: Client| {
            let mut journal = client.journal(&[], &mut keep_waiting()).unwrap();
            client.send(&[], &mut keep_waiting()).unwrap();
            loop {
                let entry = journal.next(LONG, &mut keep_waiting()).unwrap();
                let header = entry.map(|entry| *entry.header());
                if header.is_none_or(|header| !header.is_state()) {
                    return header.map(|header| (header.op, header.digests));
                }
            }
        };
        let recorded = beside(host, record, |host| {
            host.record_state(&[1; STATE], false);
            if host.is_recorded() && host.state.poll().unwrap() == Some(Next::Command) {
                host.state.lease = None;
                let mut worlds = Counted(1, Duration::ZERO, &mut Vec::new());
                host.answer(Instant::now(), &mut worlds);
            }
        });
        assert_eq!(recorded, Some((Op::Step as u32, 0)));
    });
}

#[test]
fn a_recorder_that_goes_makes_room_at_once() {
    let fake = Fake::start("room");
    let record = |client: Client| {
        let journal = client.journal(&[], &mut keep_waiting());
        journal.map(|journal| (journal, client))
    };
    let clients: Vec<_> = (0..=RECORDERS_MAX).map(|_| fake.attach()).collect();
    let mut recorders: Vec<_> = clients.into_iter().map(record).collect();
    assert!(recorders.pop().unwrap().is_err(), "all are at work");
    let next = fake.attach();
    drop(recorders.pop());
    assert!(next.ask_for_journal());
}

#[test]
fn a_client_that_comes_while_the_last_place_is_given_back_gets_it() {
    alone("crowded", |host| {
        let session = host.state.description.session;
        let config = host.daemon_lock().paths().transport_config(session);
        let mut crowd = Vec::new();
        loop {
            let node = transport::node::<AnyThread>(&config, "client").unwrap();
            match transport::open_wake(&node, "fake") {
                Ok(wake) => crowd.push((wake, node)),
                Err(ProtocolError::TooManyClients { .. }) => break,
                Err(error) => panic!("{error}"),
            }
        }
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(OPENING);
                drop(crowd.pop());
            });
            connect(host)
        });
    });
}

//! A host without physics against clients that send nonsense.

mod control;
mod fake;
mod leases;
mod unreached;

use std::process::Stdio;

use super::journal::RECORDERS_MAX;
use super::*;
use crate::PROTOCOL_VERSION;
use crate::presence::paths::DaemonPaths;
use crate::transport::CommandPublisher;
use crate::{AttachOptions, Client, CommandHeader, Dtype, Frame, Hook, Op, keep_waiting};
use fake::{Fake, STATE};

type Clients = crate::memory::service::AnyThread;

fn count(frame: &Frame) -> u64 {
    frame.field("count").unwrap().as_slice::<u64>().unwrap()[0]
}

/// Puts a command together by hand and sends it through the client's own port.
fn send(publisher: &CommandPublisher<Clients>, header: CommandHeader, payload: &[u64]) {
    let mut loan = publisher
        .loan_slice_uninit(payload.len().div_ceil(crate::Line::WORDS))
        .unwrap();
    *loan.user_header_mut() = header;
    crate::memory::loaned::words(loan.payload_mut())[..payload.len()].copy_from_slice(payload);
    crate::memory::loaned::send(loan).unwrap();
}

#[test]
fn hostile_commands_are_refused_with_a_reason_and_the_host_goes_on() {
    let fake = Fake::start("hostile");
    let client = fake.attach();
    let hook: Hook<'_> = &mut keep_waiting();
    assert_eq!(count(&client.step(&[], hook).unwrap()), 1);
    let session = client.description().session;
    let good = Table::lay_out([("joint_f".to_owned(), Dtype::F32, vec![2, 3], 0)]);
    let mut payload = vec![0; good.total_bytes() / 8];
    payload[..good.words().len()].copy_from_slice(good.words());
    let with = |word: usize, value: u64| {
        let mut payload = payload.clone();
        payload[word] = value;
        payload
    };
    let header = CommandHeader {
        session,
        epoch: 1,
        seq: 0,
        op: Op::Step as u32,
        rows: 1,
        core: 0,
    };
    let left = Table::lay_out([("on_device".to_owned(), Dtype::U64, vec![1], 0)]);
    let mut short = vec![0; left.total_bytes() / 8];
    short[..left.words().len()].copy_from_slice(left.words());
    let cases: [(&str, CommandHeader, Vec<u64>, &str); 13] = [
        (
            "device memory without its commands",
            header,
            short,
            "on_device: 1 entries; 2 are needed",
        ),
        (
            "a truncated table",
            header,
            payload[..8].to_vec(),
            "field table of 1 rows",
        ),
        (
            "many rows",
            CommandHeader {
                rows: u32::MAX,
                ..header
            },
            payload.clone(),
            "rows in the field table",
        ),
        ("an offset outside", header, with(10, 1 << 40), "do not lie"),
        ("a huge shape", header, with(5, u64::MAX), "does not make"),
        (
            "a shape that overflows",
            header,
            with(6, 1 << 63),
            "does not make",
        ),
        (
            "an unknown type",
            header,
            with(4, 77 | 2 << 32),
            "unknown dtype 77",
        ),
        ("no name", header, with(0, 0), "a name is empty"),
        (
            "a mask of floats",
            header,
            with(0, u64::from_le_bytes(*b"mask\0\0\0\0")),
            "mask: float32 of 2 axes; uint8 of one is needed",
        ),
        (
            "a path of floats",
            header,
            with(0, u64::from_le_bytes(*b"path\0\0\0\0")),
            "path: float32",
        ),
        (
            "a world of floats",
            header,
            with(0, u64::from_le_bytes(*b"from_wor"))
                .iter()
                .enumerate()
                .map(|(i, &word)| {
                    if i == 1 {
                        u64::from(b'l') | u64::from(b'd') << 8
                    } else {
                        word
                    }
                })
                .collect(),
            "from_world: float32 of 2 axes; uint64 of one is needed",
        ),
        (
            "an unknown operation",
            CommandHeader { op: 9, ..header },
            payload.clone(),
            "unknown operation 9",
        ),
        (
            "another session",
            CommandHeader {
                session: 1,
                ..header
            },
            payload.clone(),
            "stale",
        ),
    ];
    for (what, header, payload, words) in cases {
        let refusal =
            client.raw(|publisher, seq| send(publisher, CommandHeader { seq, ..header }, &payload));
        let error = refusal.unwrap_err();
        assert!(
            matches!(error, ProtocolError::CommandRefused { .. }),
            "{what}: {error}"
        );
        assert!(
            error.to_string().contains(words),
            "{what}: {words} is not in: {error}"
        );
    }
    let old =
        client.raw(|publisher, seq| send(publisher, CommandHeader { seq, ..header }, &payload));
    assert_eq!(
        count(&old.unwrap()),
        2,
        "nothing that was refused was carried out"
    );
    assert_eq!(count(&client.step(&[], &mut keep_waiting()).unwrap()), 3);
}

#[test]
fn while_a_step_is_in_flight_every_other_command_is_refused_and_not_sent() {
    let fake = Fake::start("halves");
    let client = fake.attach();
    let hook: Hook<'_> = &mut keep_waiting();
    let early = client.recv(hook).unwrap_err();
    assert!(matches!(early, ProtocolError::NothingSent), "{early}");
    assert!(!client.holds_lease(), "recv alone takes no lease");
    client.send(&[], hook).unwrap();
    let refused = [
        ("send", client.send(&[], hook).unwrap_err()),
        ("step", client.step(&[], hook).unwrap_err()),
        ("reset", client.reset(None, None, hook).unwrap_err()),
        ("write", client.write(&[], None, hook).unwrap_err()),
        ("forward", client.forward(hook).unwrap_err()),
        ("snapshot", client.snapshot("/nowhere", hook).unwrap_err()),
        (
            "restore",
            client.restore("/nowhere", None, None, hook).unwrap_err(),
        ),
    ];
    for (command, error) in refused {
        assert!(
            matches!(error, ProtocolError::StepInFlight),
            "{command}: {error}"
        );
        assert!(error.to_string().contains("call recv first"), "{error}");
    }
    assert_eq!(count(&client.recv(hook).unwrap()), 1);
    let late = client.recv(hook).unwrap_err();
    assert!(matches!(late, ProtocolError::NothingSent), "{late}");
    assert_eq!(count(&client.step(&[], hook).unwrap()), 2);
    for n in 3..100 {
        client.send(&[], hook).unwrap();
        assert_eq!(count(&client.recv(hook).unwrap()), n);
    }
}

#[test]
fn a_client_that_goes_with_a_step_in_flight_makes_room_for_the_next() {
    let fake = Fake::start("gone");
    for _ in 0..20 {
        let client = fake.attach();
        client.send(&[], &mut keep_waiting()).unwrap();
        client.release(&mut keep_waiting()).unwrap();
        let error = client.recv(&mut keep_waiting()).unwrap_err();
        assert!(matches!(error, ProtocolError::NothingSent), "{error}");
        client.send(&[], &mut keep_waiting()).unwrap();
        drop(client);
        fake.attach().step(&[], &mut keep_waiting()).unwrap();
    }
}

#[test]
fn a_holder_that_died_before_it_came_holds_nothing() {
    let fake = Fake::start("unborn");
    let program = if cfg!(windows) { "hostname" } else { "true" };
    let mut dead = std::process::Command::new(program);
    let mut dead = dead.stdout(Stdio::null()).spawn().unwrap();
    dead.wait().unwrap();
    let client = fake.attach();
    assert!(client.ask_for_lease(dead.id()));
    fake.attach().step(&[], &mut keep_waiting()).unwrap();
}

#[test]
fn a_client_that_goes_before_it_opens_its_ports_holds_nothing() {
    let fake = Fake::start("unopened-ports");
    // as one whose call was interrupted, in a process that lives
    assert!(fake.attach().ask_for_lease(std::process::id()));
    fake.attach().step(&[], &mut keep_waiting()).unwrap();
}

#[test]
fn recorders_that_went_before_they_joined_take_no_place() {
    let fake = Fake::start("unjoined");
    for recorder in 0..3 * RECORDERS_MAX {
        assert!(fake.attach().ask_for_journal(), "{recorder}");
    }
    let stays: Vec<_> = (0..RECORDERS_MAX).map(|_| fake.attach()).collect();
    assert!(stays.iter().all(Client::ask_for_journal));
    assert!(!fake.attach().ask_for_journal(), "those are on their way");
}

#[test]
fn a_journal_tells_what_was_carried_out_and_counts_what_was_lost() {
    let fake = Fake::start("journal");
    let (client, recorder) = (fake.attach(), fake.attach());
    assert_eq!(count(&client.step(&[], &mut keep_waiting()).unwrap()), 1);
    let mut journal = recorder.journal(&[], &mut keep_waiting()).unwrap();
    let mut next = || {
        let entry = journal.next(std::time::Duration::from_secs(5), &mut keep_waiting());
        entry.unwrap().expect("an entry within seconds")
    };
    let mut state: Vec<u8> = Vec::new();
    while state.len() < STATE {
        let piece = next();
        let header = *piece.header();
        assert!(header.is_state() && header.bytes == STATE as u64 && piece.lost == 0);
        assert_eq!(header.first, state.len() as u64);
        assert!(piece.piece().len() < STATE, "in pieces");
        state.extend(piece.piece());
    }
    assert_eq!(state, [1; STATE]);
    let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let torque = crate::Command {
        field: "joint_f",
        columns: 0..3,
        values: crate::Values::F32(&numbers),
    };
    client.step(&[torque], &mut keep_waiting()).unwrap();
    let entry = next();
    assert_eq!(
        (entry.header().op, entry.header().rows),
        (Op::Step as u32, 1)
    );
    let table = Table::parse(entry.command(), 1).unwrap();
    let first = table.row("joint_f").unwrap().offset / 4;
    let sent: &[f32] = bytemuck::cast_slice(entry.command());
    assert_eq!(sent[first..first + 6], numbers);
    let digest = crate::journal::digest::checksum(&2_u64.to_le_bytes()) as u32;
    assert_eq!(entry.digests(), [digest; 2]);
    drop(entry);
    let mut left = 3000;
    for _ in 0..left {
        client.step(&[], &mut keep_waiting()).unwrap();
    }
    let first = next();
    assert!(first.lost > 0, "{}", first.lost);
    left -= first.lost + 1;
    drop(first);
    while left > 0 {
        assert_eq!(next().lost, 0, "{left}");
        left -= 1;
    }
}

/// Frames that an observer is shown while steps are made for about a second, and that time.
fn shown(fake: &Fake) -> (u32, Duration) {
    let (client, observer) = (fake.attach(), fake.attach());
    let (began, mut frames) = (Instant::now(), 0);
    while began.elapsed() < Duration::from_secs(1) {
        client.step(&[], &mut keep_waiting()).unwrap();
        frames += u32::from(observer.latest(&mut keep_waiting()).unwrap().is_some());
    }
    (frames, began.elapsed())
}

#[test]
fn observers_see_fewer_frames_where_it_takes_long_to_show_one() {
    // of both, the first is the one shown last, the second needs no wait, and one more lies on the edge
    let (frames, time) = shown(&Fake::start("shown"));
    let most = time.div_duration_f64(observers::PERIOD) as u32 + 3;
    assert!((5..=most).contains(&frames), "{frames} frames in {time:?}");
    let (frames, time) = shown(&Fake::slow("slow", Duration::from_millis(5)));
    let most = time.div_duration_f64(observers::SLOWEST) as u32 + 3;
    assert!((1..=most).contains(&frames), "{frames} frames in {time:?}");
}

#[test]
fn a_frame_that_an_observer_got_stays_as_it_was_without_its_client() {
    let fake = Fake::start("kept");
    let hook: Hook<'_> = &mut keep_waiting();
    let (client, observer, other) = (fake.attach(), fake.attach(), fake.attach());
    let newer = |client: &Client| client.wait_newer(None, &mut keep_waiting()).unwrap();
    client.step(&[], hook).unwrap();
    let frame = newer(&observer).expect("it waits for one");
    let seen = count(&frame);
    drop(observer);
    for _ in 0..20 {
        client.step(&[], hook).unwrap();
        newer(&other);
    }
    assert_eq!(count(&frame), seen);
}

#[test]
fn facts_that_differ_are_refused_with_both_named() {
    let root = std::env::temp_dir().join(format!("tightloop-facts-{}", std::process::id()));
    let paths = DaemonPaths::new(Some(&root), "facts").unwrap();
    let mut daemon_lock = DaemonLock::take(&paths).unwrap();
    let node = transport::node::<S>(&paths.transport_config(5), "daemon").unwrap();
    let attributes = [(handshake::PROTOCOL, "7".to_owned())];
    let wake = transport::create_event(&node, "wake", &attributes).unwrap();
    daemon_lock.announce(5, 1).unwrap();
    let options = AttachOptions {
        root: Some(root.clone()),
        ..AttachOptions::default()
    };
    let error = Client::attach("facts", &options, &mut keep_waiting())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains(&format!(
            "protocol version is 7 in the handshake and {PROTOCOL_VERSION}"
        )),
        "{error}"
    );
    drop((wake, node, daemon_lock));
    std::fs::remove_dir(root).expect("nothing is left in the root folder");
}

#[cfg(target_os = "linux")] // elsewhere there is no such memory
#[test]
fn a_client_that_goes_while_its_card_is_waited_for_holds_nobody_up() {
    let fake = Fake::start("card");
    let hook: Hook<'_> = &mut keep_waiting();
    let (first, second) = (fake.attach(), fake.attach());
    let refused = first.device_memory(hook).unwrap_err().to_string();
    // 2 frames that are held, one that is received, one that waits and one that is written
    assert!(refused.contains("no card for 5 slots"), "{refused}");
    let on_device = crate::OnDevice {
        ready: u64::MAX,
        commands: 0,
    };
    first.send_on_device(&[], on_device, hook).unwrap();
    // requests are served meanwhile
    assert_eq!(second.controller(hook).unwrap(), Some(std::process::id()));
    drop(first);
    assert_eq!(count(&second.step(&[], hook).unwrap()), 1);
}

#[test]
fn a_lease_waits_for_the_owner_of_the_last_one_and_clients_come_and_go() {
    let fake = Fake::start("handover");
    let hook: Hook<'_> = &mut keep_waiting();
    for round in 1..=5 {
        let client = fake.attach();
        let frame = client.step(&[], hook).unwrap();
        assert_eq!(count(&frame), round);
        assert_eq!(frame.header().epoch, round);
        drop(frame);
        client.release(hook).unwrap();
    }
}

//! Who holds a lease: holders that are silent, daemons that were held up while these were not, and what comes late.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::fake::{alone, connect};
use super::{Clients, send};
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::host::lease::Holder;
use crate::host::{AROUND_PERIOD, Host, Next};
use crate::presence::connection::Connection;
use crate::transport::{self, CommandPublisher, FrameSubscriber};
use crate::waiting::waiter::Awaited;
use crate::wire::command::command_bytes;
use crate::wire::control::{Request, Response};
use crate::{CommandHeader, Dtype, Op, RefusalKind, Table};

/// Longer than a holder may be silent.
const LONG: Duration = Duration::from_secs(3);
/// Who holds the lease, and who asks for it.
const PIDS: [u32; 2] = [1, 2];

/// Calls with a host whose lease is held, and with the client that holds it.
fn with_holder(test: &str, call: impl FnOnce(&mut Host, UniqueClientId)) {
    alone(test, |host| {
        let requester = transport::requester(&host.state.node).unwrap();
        let lease = host.state.lease.as_mut().unwrap();
        lease.grant(PIDS[0], requester.id());
        call(host, requester.id());
    });
}

fn holder(host: &mut Host) -> &mut Holder {
    host.state.lease.as_mut().unwrap().holder.as_mut().unwrap()
}

/// The present lease, and who holds it.
fn held(host: &Host) -> (u64, Option<u32>) {
    let lease = host.state.lease.as_ref().unwrap();
    (lease.epoch, lease.holder.as_ref().map(|holder| holder.pid))
}

#[test]
fn a_daemon_that_is_stopped_while_it_looks_around_takes_no_lease_back() {
    with_holder("looking", |host, client| {
        let begin = Instant::now() - LONG;
        host.state.polled = begin;
        holder(host).beat = begin;
        let answer = host.state.acquire(PIDS[1], client);
        let is_held = matches!(answer, Some(Response::Held { pid }) if pid == PIDS[0]);
        assert!(is_held, "{answer:?}");
    });
}

#[test]
fn a_daemon_that_was_stopped_between_two_looks_takes_no_lease_back() {
    with_holder("between", |host, client| {
        let begin = Instant::now() - LONG;
        host.state.polled = begin;
        holder(host).beat = begin;
        assert_eq!(host.state.poll_services(), None);
        let answer = host.state.acquire(PIDS[1], client);
        let is_held = matches!(answer, Some(Response::Held { pid }) if pid == PIDS[0]);
        assert!(is_held, "{answer:?}");
    });
}

#[test]
fn a_lease_goes_from_a_holder_that_is_silent_while_the_daemon_looks() {
    with_holder("silent", |host, client| {
        host.state.polled = Instant::now();
        holder(host).beat = host.state.polled - LONG;
        let answer = host.state.acquire(PIDS[1], client);
        let is_granted = matches!(answer, Some(Response::Granted { epoch: 2 }));
        assert!(is_granted, "{answer:?}");
    });
}

#[test]
fn a_heartbeat_that_a_stopped_daemon_read_late_counts_once() {
    with_holder("late", |host, _| {
        let begin = Instant::now() - LONG;
        host.state.polled = begin;
        // right after it went on, and still in the same look around
        holder(host).beat = begin + LONG;
        assert_eq!(host.state.poll_services(), None);
        let polled = host.state.polled;
        assert!(polled - begin >= LONG);
        assert!(holder(host).beat <= polled, "it counts in advance");
    });
}

#[test]
fn a_heartbeat_or_a_release_of_another_lease_is_none_of_the_present_one() {
    with_holder("another", |host, _| {
        let connection = connect(host);
        for (epoch, counts) in [(7, false), (1, true)] {
            let before = Instant::now() - LONG;
            host.state.polled = Instant::now();
            holder(host).beat = before;
            connection.post(&Request::Heartbeat { epoch });
            host.state.poll_services();
            assert_eq!(holder(host).beat > before, counts, "of lease {epoch}");
        }
        for (epoch, left) in [(7, (1, Some(PIDS[0]))), (1, (2, None))] {
            connection.post(&Request::Release { epoch });
            host.state.poll_services();
            assert_eq!(held(host), left, "of lease {epoch}");
        }
    });
}

#[test]
fn a_release_comes_before_a_request_for_the_lease_that_was_sent_after_it() {
    for releases in [0, 1] {
        with_holder("order", |host, _| {
            // the daemon reads those of one client first, in whatever order they came
            let clients = [connect(host), connect(host)];
            clients[releases].post(&Request::Release { epoch: 1 });
            clients[1 - releases].post(&Request::Acquire { pid: PIDS[1] });
            host.state.poll_services();
            assert_eq!(held(host), (2, Some(PIDS[1])), "{releases} releases");
        });
    }
}

/// Ports of the client of the first lease.
fn ports(
    host: &Host,
    connection: &Connection,
) -> (CommandPublisher<Clients>, FrameSubscriber<Clients>) {
    let bytes = command_bytes(&host.state.description);
    let ports = connection.with_node(|node| {
        let commands = transport::open_commands(node, 1)?;
        let publisher = transport::command_publisher(&commands, bytes)?;
        let frames = transport::frame_subscriber(&transport::open_frames(node, 1)?)?;
        Ok((publisher, frames))
    });
    ports.unwrap()
}

/// The first step of that client.
fn step(host: &Host) -> (CommandHeader, Vec<u64>) {
    let table = Table::lay_out([("joint_f".to_owned(), Dtype::F32, vec![2, 3], 0)]);
    let mut payload = vec![0; table.total_bytes() / 8];
    payload[..table.words().len()].copy_from_slice(table.words());
    let header = CommandHeader {
        session: host.state.description.session,
        epoch: 1,
        seq: 1,
        op: Op::Step as u32,
        rows: 1,
        ..CommandHeader::default()
    };
    (header, payload)
}

#[test]
fn a_command_is_carried_out_once_and_only_for_its_own_lease() {
    with_holder("once", |host, _| {
        let connection = connect(host);
        let (publisher, frames) = ports(host, &connection);
        let (step, payload) = step(host);
        for (epoch, seq, is_carried_out) in
            [(1, 1, true), (1, 1, false), (2, 2, false), (1, 2, true)]
        {
            send(&publisher, CommandHeader { epoch, seq, ..step }, &payload);
            let next = is_carried_out.then_some(Next::Command);
            assert_eq!(host.state.poll().unwrap(), next, "{epoch}, {seq}");
            let refusal = frames.receive().unwrap();
            assert_eq!(refusal.is_some(), !is_carried_out, "{epoch}, {seq}");
        }
        // a daemon that ends reports it by going
        host.state.stop.store(true, Ordering::Relaxed);
        host.state.refuse(RefusalKind::Stale, "nobody waits");
        assert!(frames.receive().unwrap().is_none());
        host.state.refuse(RefusalKind::Malformed, "no sense");
        assert!(frames.receive().unwrap().is_some());
    });
}

#[test]
fn a_request_is_heard_while_commands_come_without_a_pause() {
    with_holder("heard", |host, _| {
        let connection = connect(host);
        let (publisher, _frames) = ports(host, &connection);
        let (step, payload) = step(host);
        send(&publisher, step, &payload);
        connection.post(&Request::Shutdown);
        host.state.polled = Instant::now() - 2 * AROUND_PERIOD;
        assert_eq!(host.wait().unwrap(), Next::End);
        assert_eq!(host.wait().unwrap(), Next::Command);
    });
}

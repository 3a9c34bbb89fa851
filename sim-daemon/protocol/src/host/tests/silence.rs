//! Holders that are silent, and daemons that were held up while these were not.

use std::time::{Duration, Instant};

use super::fake::open;
use crate::doors::iceoryx2::identifiers::UniqueClientId;
use crate::host::Host;
use crate::host::lease::Holder;
use crate::presence::paths::DaemonPaths;
use crate::transport;
use crate::wire::control::Response;

/// Longer than a holder may be silent.
const LONG: Duration = Duration::from_secs(3);
/// Who holds the lease, and who asks for it.
const PIDS: [u32; 2] = [1, 2];

/// Calls with a host whose lease is held, and with the client that holds it.
fn with_holder(test: &str, call: impl FnOnce(&mut Host, UniqueClientId)) {
    let root = std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
    let paths = DaemonPaths::new(Some(&root), "fake").unwrap();
    let mut host = open(&paths, std::sync::Arc::default());
    let requester = transport::requester(&host.state.node).unwrap();
    let lease = host.state.lease.as_mut().unwrap();
    lease.grant(PIDS[0], requester.id());
    call(&mut host, requester.id());
    drop((requester, host));
    std::fs::remove_dir(&root).expect("nothing is left in the root folder");
}

fn holder(host: &mut Host) -> &mut Holder {
    host.state.lease.as_mut().unwrap().holder.as_mut().unwrap()
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

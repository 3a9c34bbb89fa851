//! How each part of a client reaches the daemon: node, control requests, wake-up.

use std::time::Duration;

use crate::doors::iceoryx2::prelude::Node;
use crate::doors::sync::Mutex;
use crate::doors::sync::atomic::AtomicBool;
use crate::doors::sync::mpsc::{self, RecvTimeoutError};
use crate::doors::time::Instant;
use crate::memory::guard::guarded;
use crate::memory::mapping;
use crate::memory::port::Port;
use crate::memory::service::AnyThread;
use crate::memory::storage;
use crate::presence::described::{self, Damage};
use crate::presence::liveness::Peer;
use crate::presence::paths::Presence;
use crate::presence::stop;
use crate::transport::{self, Requester, Waker, handshake};
use crate::waiting::SLICE;
use crate::waiting::hook::Hook;
use crate::waiting::turn::{Turn, lock};
use crate::wire::control::{Request, Response};
use crate::{PROTOCOL_VERSION, ProtocolError};

/// Clients are used from any thread.
pub(crate) type S = AnyThread;

/// How long control requests wait for a daemon that lives but is busy or stopped.
pub(crate) const ANSWER_MAX: Duration = Duration::from_secs(30);

/// How long ports that cannot be opened are tried again.
const OPEN_MAX: Duration = Duration::from_secs(1);
/// Time between two tries of anything.
const PAUSE: Duration = Duration::from_millis(10);

/// What every part of a client uses to reach the daemon.
#[derive(Debug)]
pub(crate) struct Connection {
    pub(crate) peer: Peer,
    pub(crate) wake: Waker<S>,
    /// One request is waited for at a time.
    pub(crate) asking: Turn<()>,
    /// A lease was asked for, and its answer not waited for.
    pub(crate) abandoned: AtomicBool,
    pub(crate) requester: Mutex<Requester<S>>,
    pub(crate) node: Mutex<Port<Node<S>>>,
}

/// Facts of the handshake, as the daemon announced them.
#[derive(Debug)]
pub(crate) struct Announced {
    pub(crate) schema: String,
    pub(crate) worlds: String,
    pub(crate) dofs: String,
}

impl Connection {
    /// Opens a client's ports, on a thread of its own: the transport trusts what it reads, and may not come back.
    pub(crate) fn open(
        peer: &Peer,
        hook: Hook<'_>,
    ) -> Result<(Connection, Announced), ProtocolError> {
        intact_there(peer)?;
        let (sender, receiver) = mpsc::channel();
        let thread_peer = peer.clone();
        let open = move || {
            // nobody waits any more for one that comes too late
            let _ = sender.send(Connection::open_here(thread_peer));
        };
        crate::doors::thread::Builder::new()
            .name("tightloop-attach".to_owned())
            .spawn(open)
            .map_err(|error| ProtocolError::transport("start a thread", error))?;
        let start = Instant::now();
        loop {
            match receiver.recv_timeout(SLICE) {
                // that it has ended explains more
                Ok(opened) => return opened.or_else(|error| peer.check().and(Err(error))),
                Err(RecvTimeoutError::Timeout) if start.elapsed() < ANSWER_MAX => {}
                // it waits still, or it panicked
                Err(_) => return Err(damaged(peer, "attach")),
            }
            peer.check()?;
            if hook().is_break() {
                return Err(ProtocolError::Interrupted);
            }
        }
    }

    fn open_here(peer: Peer) -> Result<(Connection, Announced), ProtocolError> {
        let node =
            transport::node::<S>(&peer.paths.transport_config(peer.beacon.session), "client")?;
        let start = Instant::now();
        let wake = loop {
            match transport::open_wake(&node, peer.paths.name()) {
                // the daemon is about to clean up after clients that were killed a moment ago
                Err(ProtocolError::TooManyClients { .. }) if start.elapsed() < OPEN_MAX => {
                    crate::doors::thread::sleep(PAUSE);
                }
                opened => break opened?,
            }
        };
        let fact = |key| transport::attribute(&wake, key);
        let (announced, described) = (fact(handshake::PROTOCOL), PROTOCOL_VERSION.to_string());
        if announced != described {
            return Err(ProtocolError::Handshake {
                name: peer.paths.name().to_owned(),
                fact: "protocol version",
                announced,
                described,
            });
        }
        let announced = Announced {
            schema: fact(handshake::SCHEMA),
            worlds: fact(handshake::WORLDS),
            dofs: fact(handshake::DOFS),
        };
        let connection = Connection {
            peer,
            wake: transport::notifier(&wake)?,
            asking: Turn::new(()),
            abandoned: AtomicBool::new(false),
            requester: Mutex::new(transport::requester(&node)?),
            node: Mutex::new(node),
        };
        Ok((connection, announced))
    }

    /// Asks and waits for the answer; control requests are rare, so waiting is by sleeping.
    pub(crate) fn ask(&self, request: &Request, hook: Hook<'_>) -> Result<Response, ProtocolError> {
        self.ask_within(ANSWER_MAX, request, hook)
    }

    /// The same for a daemon that answers within `limit`.
    pub(crate) fn ask_within(
        &self,
        limit: Duration,
        request: &Request,
        hook: Hook<'_>,
    ) -> Result<Response, ProtocolError> {
        let _turn = self.asking.take(hook)?;
        let text = serde_json::to_vec(request).expect("requests are plain data");
        let failed = |error: &dyn std::fmt::Debug| {
            ProtocolError::transport(format!("send {request:?}"), error)
        };
        let damaged = || damaged(&self.peer, "ask the daemon");
        let (port, pending) = {
            // not while waiting: the hook runs the caller's code
            let requester = lock(&self.requester);
            let loan = guarded(|| requester.loan_slice_uninit(text.len()))
                .ok_or_else(damaged)?
                .map_err(|error| failed(&error))?;
            let pending = guarded(|| loan.write_from_slice(&text).send())
                .ok_or_else(damaged)?
                .map_err(|error| failed(&error))?;
            (
                requester.id().value(),
                Port::with_owner(requester.owner(), pending),
            )
        };
        self.notify();
        let (start, mut nap, mut polled) =
            (Instant::now(), Duration::from_micros(20), Instant::now());
        loop {
            let received = guarded(|| pending.receive()).ok_or_else(damaged)?;
            if let Some(response) = received.map_err(|error| failed(&error))? {
                let response = Port::with_owner(pending.owner(), response);
                intact(&self.peer)?;
                return serde_json::from_slice(response.payload()).map_err(|error| {
                    ProtocolError::Malformed {
                        from: "the daemon",
                        problem: format!("answer to {request:?}: {error}"),
                    }
                });
            }
            if polled.elapsed() > SLICE {
                self.peer.check()?;
                intact_there(&self.peer)?;
                self.peer.check_reach(&[self.peer.reach(port)])?;
                if hook().is_break() {
                    return Err(ProtocolError::Interrupted);
                }
                if start.elapsed() > limit {
                    return Err(self.peer.timeout(limit));
                }
                polled = Instant::now();
            }
            crate::doors::thread::sleep(nap);
            nap = (nap * 3 / 2).min(Duration::from_millis(1));
        }
    }

    /// Ends the daemon, and returns when it is gone: after its groups.
    pub(crate) fn shut_down(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        let start = Instant::now();
        let (peer, daemon) = (&self.peer, self.peer.paths.daemon()?);
        // one that ends is silent until all of its files are gone
        let is_there = |presence| match presence {
            Ok(Presence::Running(beacon)) => beacon.pid == peer.beacon.pid,
            presence => matches!(presence, Ok(Presence::Silent)),
        };
        let lasts = || is_there(peer.presence()) || is_there(daemon.presence());
        // another run may have the name by now, which the file would end
        if !lasts() {
            return Ok(());
        }
        // who waits hears the request, who is busy the file
        let ends = stop::asked(&daemon)?;
        self.post(&Request::Shutdown);
        self.notify();
        while lasts() {
            if start.elapsed() > ANSWER_MAX {
                return Err(peer.timeout(ANSWER_MAX));
            }
            if hook().is_break() {
                return Err(ProtocolError::Interrupted);
            }
            crate::doors::thread::sleep(Duration::from_millis(1));
        }
        drop(ends);
        Ok(())
    }

    /// The process that holds the lease, if any, and which lease if the daemon tells it.
    pub(crate) fn holder(
        &self,
        hook: Hook<'_>,
    ) -> Result<Option<(u32, Option<u64>)>, ProtocolError> {
        match self.ask(&Request::Controller, hook)? {
            Response::Controller { pid, epoch } => Ok(pid.map(|pid| (pid, epoch))),
            _ => Err(malformed("the answer to controller")),
        }
    }

    /// Says that we are alive, unless a request that is waited for shows it: too many that are unread would push it out.
    pub(crate) fn beat(&self, epoch: u64) {
        if self.asking.look(|()| ()).is_some() {
            self.post(&Request::Heartbeat { epoch });
        }
    }

    /// Sends without waiting for an answer; a failure shows at the next step.
    pub(crate) fn post(&self, request: &Request) {
        let requester = lock(&self.requester);
        let text = serde_json::to_vec(request).expect("requests are plain data");
        guarded(|| {
            if let Ok(loan) = requester.loan_slice_uninit(text.len()) {
                let _ = loan.write_from_slice(&text).send();
            }
        });
    }

    /// Wakes the daemon if it sleeps.
    pub(crate) fn notify(&self) {
        // a daemon that cannot be notified looks by itself after 50 ms
        guarded(|| self.wake.notify());
    }

    /// Opens ports, or does something else with the node.
    pub(crate) fn with_node<T>(
        &self,
        call: impl FnOnce(&Node<S>) -> Result<T, ProtocolError>,
    ) -> Result<T, ProtocolError> {
        let node = lock(&self.node);
        guarded(|| call(&node)).unwrap_or_else(|| Err(damaged(&self.peer, "open services")))
    }

    /// Opens ports. What the daemon is just making or removing is tried again.
    ///
    /// # Errors
    /// That of the last try; [`ProtocolError::DaemonLost`] and its kin, which explain it better; [`ProtocolError::Interrupted`].
    pub(crate) fn ports<T>(
        &self,
        hook: Hook<'_>,
        ports: impl Fn(&Node<S>) -> Result<T, ProtocolError>,
    ) -> Result<T, ProtocolError> {
        let start = Instant::now();
        loop {
            let opened = self.with_node(&ports);
            let Err(error) = opened else {
                return opened;
            };
            self.peer.check()?;
            let again = matches!(error, ProtocolError::Transport { .. });
            if !again || start.elapsed() > OPEN_MAX {
                return Err(error);
            }
            pause(hook)?;
        }
    }
}

/// Lets time pass before the next try.
pub(crate) fn pause(hook: Hook<'_>) -> Result<(), ProtocolError> {
    if hook().is_break() {
        return Err(ProtocolError::Interrupted);
    }
    crate::doors::thread::sleep(PAUSE);
    Ok(())
}

/// Errors when another program has cut a file of the daemon while it was mapped here.
pub(crate) fn intact(peer: &Peer) -> Result<(), ProtocolError> {
    match mapping::any_damaged()
        && storage::is_damaged(&peer.paths.transport_config(peer.beacon.session))
    {
        true => Err(damaged(peer, "read shared memory")),
        false => Ok(()),
    }
}

/// As [`intact`], and asks the daemon's files, which takes a few microseconds.
pub(crate) fn intact_there(peer: &Peer) -> Result<(), ProtocolError> {
    match peer.is_damaged() {
        true => Err(damaged(peer, "wait for the daemon")),
        false => intact(peer),
    }
}

/// As [`intact_there`], while this process holds a lease.
pub(crate) fn intact_lease(peer: &Peer, epoch: u64) -> Result<(), ProtocolError> {
    intact_there(peer)?;
    match described::is_damaged(&peer.paths, peer.beacon.session, Damage::Lease(epoch)) {
        true => Err(damaged(peer, "wait for a frame")),
        false => Ok(()),
    }
}

/// The error of a daemon whose shared memory makes no sense.
pub(crate) fn damaged(peer: &Peer, action: &str) -> ProtocolError {
    ProtocolError::Damaged {
        action: action.to_owned(),
        path: peer.paths.shared_folder().display().to_string(),
    }
}

pub(crate) fn malformed(problem: &str) -> ProtocolError {
    ProtocolError::Malformed {
        from: "the daemon",
        problem: problem.to_owned(),
    }
}

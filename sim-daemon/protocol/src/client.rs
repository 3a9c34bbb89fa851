//! A client: attaches to a running daemon, observes it, and controls it when it holds the lease.

use std::ops::{ControlFlow, Range};
use std::path::PathBuf;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{Node, ipc_threadsafe};

use crate::command::Call;
use crate::control::{Request, Response};
use crate::controller::Controller;
use crate::liveness::Peer;
use crate::observer::Observer;
use crate::place::{Place, Presence, running};
use crate::transport::{self, Requester, SLICE, facts};
use crate::{Description, Frame, Op, PROTOCOL_VERSION, ProtocolError};

pub(crate) type S = ipc_threadsafe::Service;

/// Called at least every 50 ms while a call waits; `Break` ends the call with [`ProtocolError::Interrupted`].
pub type Hook<'a> = &'a mut dyn FnMut() -> ControlFlow<()>;

/// A [`Hook`] that never interrupts.
pub fn keep_waiting() -> impl FnMut() -> ControlFlow<()> {
    || ControlFlow::Continue(())
}

/// How long control requests wait for a daemon that lives but is busy or stopped.
const ANSWER_MAX: Duration = Duration::from_secs(30);

/// Numbers for an input, row-major `(worlds, columns)`. The daemon gets them in the precision of its run.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

impl Values<'_> {
    /// Number of entries.
    pub fn len(&self) -> usize {
        match self {
            Values::F32(values) => values.len(),
            Values::F64(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One array that a step or a write sets.
#[derive(Debug, Clone)]
pub struct Command<'a> {
    /// `joint_f`, `joint_target_q`, `joint_target_qd` for a step; `joint_q`, `joint_qd` for a write.
    pub field: &'a str,
    /// Dofs (or coordinates for `joint_q`) that the array covers.
    pub columns: Range<usize>,
    /// The numbers, `(worlds, columns)`.
    pub values: Values<'a>,
}

/// How to attach.
#[derive(Debug, Clone, Default)]
pub struct AttachOptions {
    /// Root folder; [`crate::place::default_root`] when `None`.
    pub root: Option<PathBuf>,
    /// How long to wait for a daemon that does not run yet.
    pub wait: Duration,
}

/// A connection to a daemon. All methods take `&self`, from any thread; calls that step wait for each other.
#[derive(Debug)]
pub struct Client {
    description: Arc<Description>,
    controller: Mutex<Option<Controller>>,
    observer: Mutex<Option<Observer>>,
    frames: Arc<AtomicUsize>,
    link: Arc<Link>,
    process: u32,
}

/// What every part of a client uses to reach the daemon.
#[derive(Debug)]
pub(crate) struct Link {
    pub(crate) peer: Peer,
    pub(crate) wake: Notifier<S>,
    requester: Mutex<Requester<S>>,
    node: Mutex<Node<S>>,
}

impl Client {
    /// Attaches to the daemon `name`, as an observer at first.
    ///
    /// # Errors
    /// [`ProtocolError::NoDaemon`], [`ProtocolError::ProtocolVersion`], [`ProtocolError::Handshake`],
    /// [`ProtocolError::BadName`], [`ProtocolError::Interrupted`].
    pub fn attach(
        name: &str,
        options: &AttachOptions,
        hook: Hook<'_>,
    ) -> Result<Client, ProtocolError> {
        let place = Place::new(options.root.as_deref(), name)?;
        let deadline = Instant::now() + options.wait;
        let beacon = loop {
            match place.presence() {
                Presence::Running(beacon) => break beacon,
                Presence::Absent if Instant::now() >= deadline => {
                    let names = running(Some(place.root()))?;
                    let running = if names.is_empty() {
                        "none".to_owned()
                    } else {
                        names.join(", ")
                    };
                    return Err(ProtocolError::NoDaemon {
                        name: name.to_owned(),
                        root: place.root().into(),
                        running,
                    });
                }
                _ => {}
            }
            if hook().is_break() {
                return Err(ProtocolError::Interrupted);
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        if beacon.protocol != PROTOCOL_VERSION {
            let (daemon, client) = (beacon.protocol, PROTOCOL_VERSION);
            return Err(ProtocolError::ProtocolVersion {
                name: name.to_owned(),
                daemon,
                client,
            });
        }
        let peer = Peer { place, beacon };
        let client = Client::handshake(peer.clone(), hook);
        // a daemon that ended meanwhile explains any failure better than the failure does
        if client.is_err() {
            peer.check()?;
        }
        client
    }

    fn handshake(peer: Peer, hook: Hook<'_>) -> Result<Client, ProtocolError> {
        let node =
            transport::node::<S>(&peer.place.transport_config(peer.beacon.session), "client")?;
        let wake = transport::open_event(&node, "wake")?;
        let name = peer.place.name().to_owned();
        let announced = transport::attribute(&wake, facts::PROTOCOL);
        if announced != PROTOCOL_VERSION.to_string() {
            let described = PROTOCOL_VERSION.to_string();
            return Err(ProtocolError::Handshake {
                name,
                fact: "protocol version",
                announced,
                described,
            });
        }
        let link = Link {
            peer,
            wake: transport::notifier(&wake)?,
            requester: Mutex::new(transport::requester(&node)?),
            node: Mutex::new(node),
        };
        let Response::Description(description) = link.ask(&Request::Describe, hook)? else {
            return Err(malformed("the answer to describe"));
        };
        for (fact, key, described) in [
            (
                "schema hash",
                facts::SCHEMA,
                format!("{:016x}", description.schema_hash()),
            ),
            (
                "number of worlds",
                facts::WORLDS,
                description.worlds.to_string(),
            ),
            (
                "number of dofs",
                facts::DOFS,
                description.dof_names.len().to_string(),
            ),
        ] {
            let announced = transport::attribute(&wake, key);
            if announced != described {
                return Err(ProtocolError::Handshake {
                    name,
                    fact,
                    announced,
                    described,
                });
            }
        }
        Ok(Client {
            description: Arc::new(*description),
            controller: Mutex::new(None),
            observer: Mutex::new(None),
            frames: Arc::new(AtomicUsize::new(0)),
            link: Arc::new(link),
            process: std::process::id(),
        })
    }

    /// Everything about the daemon that does not change.
    pub fn description(&self) -> &Arc<Description> {
        &self.description
    }

    /// Process that holds the lease, if any.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`] and its kin.
    pub fn controller(&self, hook: Hook<'_>) -> Result<Option<u32>, ProtocolError> {
        match self.link.ask(&Request::Controller, hook)? {
            Response::Controller { pid } => Ok(pid),
            _ => Err(malformed("the answer to controller")),
        }
    }

    /// Whether this client holds the lease, as far as it knows.
    pub fn holds_lease(&self) -> bool {
        lock(&self.controller).is_some()
    }

    /// Takes the lease; done by itself at the first [`Client::step`], [`Client::reset`], [`Client::write`] or
    /// [`Client::forward`]. From then on a thread of this client sends heartbeats.
    ///
    /// # Errors
    /// [`ProtocolError::LeaseHeld`] with the holder's process, [`ProtocolError::SharedMemory`],
    /// [`ProtocolError::DaemonLost`] and its kin.
    pub fn acquire(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        let mut controller = lock(&self.controller);
        if controller.is_none() {
            *controller = Some(self.take_lease(hook)?);
        }
        Ok(())
    }

    fn take_lease(&self, hook: Hook<'_>) -> Result<Controller, ProtocolError> {
        Controller::acquire(&self.link, &self.description, &self.frames, hook)
    }

    /// Gives the lease back, so that another client can take it. Does nothing without one. Frames stay valid.
    pub fn release(&self) {
        lock(&self.controller).take(); // dropping it releases
    }

    /// Sets the given inputs, advances every world by one control frame and returns the frame. What is left out keeps its
    /// last value.
    ///
    /// # Errors
    /// [`ProtocolError::CommandRefused`], [`ProtocolError::Shape`], [`ProtocolError::NotAnInput`] and
    /// [`ProtocolError::FramesHeld`] leave the worlds as they were. After [`ProtocolError::Interrupted`] the step may have
    /// been made. [`ProtocolError::LeaseHeld`], [`ProtocolError::LeaseLost`], [`ProtocolError::DaemonLost`],
    /// [`ProtocolError::DaemonRestarted`].
    pub fn step(&self, commands: &[Command<'_>], hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.run(Op::Step, commands, None, hook)
    }

    /// Puts the worlds under the mask (all without one) back to the start and returns the frame there.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn reset(&self, mask: Option<&[bool]>, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.run(Op::Reset, &[], mask, hook)
    }

    /// Sets the state of the worlds under the mask (all without one) and returns the frame evaluated there.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn write(
        &self,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        self.run(Op::Write, arrays, mask, hook)
    }

    /// Evaluates the fields at the present state without stepping.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn forward(&self, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.run(Op::Forward, &[], None, hook)
    }

    fn run(
        &self,
        op: Op,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        let mut held = lock(&self.controller);
        let controller = match &mut *held {
            Some(controller) => controller,
            empty => empty.insert(self.take_lease(hook)?),
        };
        let result = controller.run(&Call { op, arrays, mask }, hook);
        // a lost lease can be asked for again; a lost daemon cannot come back
        if matches!(result, Err(ProtocolError::LeaseLost { .. })) {
            held.take();
        }
        result
    }

    /// The newest frame for observers, if there is one that was not returned before. It shows the first
    /// `watch_worlds` worlds and is published at a limited rate.
    ///
    /// # Errors
    /// [`ProtocolError::FramesHeld`], [`ProtocolError::DaemonLost`] and its kin.
    pub fn latest(&self) -> Result<Option<Frame>, ProtocolError> {
        self.with_observer(Observer::latest)
    }

    /// Waits for a frame newer than those returned before; `None` after `timeout`.
    ///
    /// # Errors
    /// As [`Client::latest`], and [`ProtocolError::Interrupted`].
    pub fn wait_newer(
        &self,
        timeout: Option<Duration>,
        hook: Hook<'_>,
    ) -> Result<Option<Frame>, ProtocolError> {
        self.with_observer(|observer| observer.wait_newer(timeout, hook))
    }

    fn with_observer<T>(
        &self,
        call: impl FnOnce(&mut Observer) -> Result<T, ProtocolError>,
    ) -> Result<T, ProtocolError> {
        let mut observer = lock(&self.observer);
        let observer = match &mut *observer {
            Some(observer) => observer,
            empty => empty.insert(Observer::open(&self.link, &self.description)?),
        };
        call(observer)
    }

    /// Lets a test send what it likes through the ports of the lease, and reads the answer.
    #[cfg(test)]
    pub(crate) fn raw(
        &self,
        send: impl FnOnce(&crate::transport::CommandPublisher<S>, u64),
    ) -> Result<Frame, ProtocolError> {
        lock(&self.controller)
            .as_mut()
            .expect("the lease is held")
            .raw(send)
    }

    /// Errors when the daemon is gone. A few microseconds.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`], [`ProtocolError::DaemonRestarted`].
    pub fn check_alive(&self) -> Result<(), ProtocolError> {
        self.link.peer.check()
    }

    /// Ends the daemon and returns when it is gone and has left nothing behind.
    ///
    /// # Errors
    /// [`ProtocolError::Timeout`], [`ProtocolError::Interrupted`].
    pub fn shutdown(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.release();
        lock(&self.observer).take();
        match self.link.ask(&Request::Shutdown, hook) {
            Ok(_)
            | Err(ProtocolError::DaemonLost { .. } | ProtocolError::DaemonRestarted { .. }) => {}
            Err(error) => return Err(error),
        }
        let start = Instant::now();
        while self.check_alive().is_ok() {
            if start.elapsed() > ANSWER_MAX {
                return Err(self.link.peer.timeout(ANSWER_MAX));
            }
            if hook().is_break() {
                return Err(ProtocolError::Interrupted);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // in a forked child the ports belong to the parent: leave them alone
        if std::process::id() != self.process {
            std::mem::forget(lock(&self.controller).take());
            std::mem::forget(lock(&self.observer).take());
            std::mem::forget(Arc::clone(&self.link));
        }
    }
}

impl Link {
    /// Asks and waits for the answer; control requests are rare, so waiting is by sleeping.
    pub(crate) fn ask(&self, request: &Request, hook: Hook<'_>) -> Result<Response, ProtocolError> {
        let requester = lock(&self.requester);
        let text = serde_json::to_vec(request).expect("requests are plain data");
        let failed = |error: &dyn std::fmt::Debug| {
            ProtocolError::transport(format!("send {request:?}"), error)
        };
        let loan = requester
            .loan_slice_uninit(text.len())
            .map_err(|error| failed(&error))?;
        let pending = loan
            .write_from_slice(&text)
            .send()
            .map_err(|error| failed(&error))?;
        self.notify();
        let (start, mut nap, mut looked) =
            (Instant::now(), Duration::from_micros(20), Instant::now());
        loop {
            if let Some(response) = pending.receive().map_err(|error| failed(&error))? {
                return serde_json::from_slice(response.payload()).map_err(|error| {
                    ProtocolError::Malformed {
                        from: "the daemon",
                        problem: format!("answer to {request:?}: {error}"),
                    }
                });
            }
            if looked.elapsed() > SLICE {
                self.peer.check()?;
                if hook().is_break() {
                    return Err(ProtocolError::Interrupted);
                }
                if start.elapsed() > ANSWER_MAX {
                    return Err(self.peer.timeout(ANSWER_MAX));
                }
                looked = Instant::now();
            }
            std::thread::sleep(nap);
            nap = (nap * 3 / 2).min(Duration::from_millis(1));
        }
    }

    /// Sends without waiting for an answer; a failure shows at the next step.
    pub(crate) fn tell(&self, request: &Request) {
        let requester = lock(&self.requester);
        let text = serde_json::to_vec(request).expect("requests are plain data");
        if let Ok(loan) = requester.loan_slice_uninit(text.len()) {
            let _ = loan.write_from_slice(&text).send();
        }
    }

    /// Wakes the daemon if it sleeps.
    pub(crate) fn notify(&self) {
        // a daemon that cannot be notified looks by itself after 50 ms
        let _ = self.wake.notify();
    }

    pub(crate) fn with_node<T>(&self, call: impl FnOnce(&Node<S>) -> T) -> T {
        call(&lock(&self.node))
    }
}

/// Nothing of ours is left half-written when a thread panics: a poisoned lock is as good as any.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn malformed(problem: &str) -> ProtocolError {
    ProtocolError::Malformed {
        from: "the daemon",
        problem: problem.to_owned(),
    }
}

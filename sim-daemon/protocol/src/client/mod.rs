//! A client: attaches to a running daemon, observes it, and controls it when it holds the lease.

mod observer;
mod on_device;

use std::time::Duration;

use observer::Observer;

use crate::doors::sync::Arc;
use crate::doors::sync::atomic::{AtomicBool, Ordering};
use crate::journal::Journal;
use crate::lease::controller::Controller;
use crate::memory::forked::Maker;
use crate::memory::frame::Alive;
use crate::presence::connection::{Connection, malformed};
use crate::presence::described;
use crate::presence::discovery::{AttachOptions, find};
use crate::presence::liveness::Peer;
use crate::presence::paths::DaemonPaths;
use crate::transport;
use crate::waiting::hook::Hook;
use crate::waiting::turn::{Held, Turn};
use crate::wire::command::{Call, Command};
use crate::wire::control::{Request, Response};
use crate::{Description, Frame, Op, ProtocolError, Timing};

/// How long a client that attaches waits for the daemon's word.
const DESCRIBED_MAX: Duration = Duration::from_millis(500);

/// A connection to a daemon. All methods take `&self`, from any thread; calls that step wait for each other.
///
/// ```no_run
/// use sim_protocol::{AttachOptions, Client, Command, ProtocolError, Values, keep_waiting};
///
/// let client = Client::attach("franka", &AttachOptions::default(), &mut keep_waiting())?;
/// let about = client.description();
/// let dofs = about.dof_names.len();
/// let target = Command {
///     field: "joint_target_q",
///     columns: 0..dofs,
///     values: Values::F32(&vec![0.0; about.worlds * dofs]),
/// };
/// let frame = client.step(&[target], &mut keep_waiting())?;
/// // (worlds, coordinates) in shared memory; `None` where the daemon runs in f64
/// let joint_q: Option<&[f32]> = frame.field("joint_q")?.as_slice();
/// # Ok::<(), ProtocolError>(())
/// ```
#[derive(Debug)]
pub struct Client {
    description: Arc<Description>,
    controller: Turn<Option<Box<Controller>>>,
    observer: Turn<Option<Box<Observer>>>,
    /// The lease is to be given back once the call that uses it returns.
    release: AtomicBool,
    frames: Arc<Alive>,
    connection: Arc<Connection>,
    maker: Maker,
}

impl Client {
    /// Attaches to the daemon `name`, or to the group of that name, as an observer at first.
    ///
    /// # Errors
    /// [`ProtocolError::NoDaemon`], [`ProtocolError::Grouped`], [`ProtocolError::ProtocolVersion`],
    /// [`ProtocolError::Handshake`], [`ProtocolError::BadName`], [`ProtocolError::Interrupted`].
    pub fn attach(
        name: &str,
        options: &AttachOptions,
        hook: Hook<'_>,
    ) -> Result<Client, ProtocolError> {
        let beacon = find(name, options, hook)?;
        if beacon.groups > 1 {
            let (name, groups) = (name.to_owned(), beacon.groups);
            return Err(ProtocolError::Grouped { name, groups });
        }
        let paths = DaemonPaths::new(options.root.as_deref(), name)?;
        let peer = Peer::find(paths, beacon)?;
        let client = Client::handshake(peer.clone(), hook);
        // a daemon that ended meanwhile explains any failure better than the failure does
        if client.is_err() {
            peer.check()?;
        }
        client
    }

    fn handshake(peer: Peer, hook: Hook<'_>) -> Result<Client, ProtocolError> {
        let name = peer.paths.name().to_owned();
        let (connection, announced) = Connection::open(&peer, hook)?;
        match connection.ask_within(DESCRIBED_MAX, &Request::Describe, hook) {
            // a daemon at long work answers later, and has written its description before
            Ok(Response::Described) | Err(ProtocolError::Timeout { .. }) => {}
            other => return Err(other.err().unwrap_or(malformed("the answer to describe"))),
        }
        let description = described::read(&connection.peer.paths, connection.peer.beacon.session)?;
        for (fact, announced, described) in [
            (
                "schema hash",
                announced.schema,
                format!("{:016x}", description.schema_hash()),
            ),
            (
                "number of worlds",
                announced.worlds,
                description.worlds.to_string(),
            ),
            (
                "number of dofs",
                announced.dofs,
                description.dof_names.len().to_string(),
            ),
        ] {
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
            description: Arc::new(description),
            controller: Turn::new(None),
            observer: Turn::new(None),
            release: AtomicBool::new(false),
            frames: Alive::new(),
            connection: Arc::new(connection),
            maker: Maker::this(),
        })
    }

    /// Everything about the daemon that does not change.
    pub fn description(&self) -> &Arc<Description> {
        &self.description
    }

    /// Process that holds the lease, if any.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`] and its kin, [`ProtocolError::Forked`].
    pub fn controller(&self, hook: Hook<'_>) -> Result<Option<u32>, ProtocolError> {
        self.check_process()?;
        let holder = self.connection.holder(hook)?;
        Ok(holder.map(|(pid, _)| pid))
    }

    /// Whether this client holds the lease, as far as it knows. In a forked child it does not.
    pub fn holds_lease(&self) -> bool {
        // a call that has it takes the lease, or uses it
        self.maker.is_this() && self.controller.look(Option::is_some).unwrap_or(true)
    }

    /// How frames kept their pace since the daemon started, or since somebody counted anew, as `clear` does.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`] and its kin, [`ProtocolError::Forked`].
    pub fn timing(&self, clear: bool, hook: Hook<'_>) -> Result<Timing, ProtocolError> {
        self.check_process()?;
        match self.connection.ask(&Request::Timing { clear }, hook)? {
            Response::Timing(timing) => Ok(timing),
            _ => Err(malformed("the answer to timing")),
        }
    }

    /// Takes the lease; done by itself at the first [`Client::step`], [`Client::send`], [`Client::reset`], [`Client::write`],
    /// [`Client::forward`], [`Client::snapshot`] or [`Client::restore`]. From then on a thread of this client sends heartbeats.
    ///
    /// # Errors
    /// [`ProtocolError::LeaseHeld`] with the holder's process, [`ProtocolError::SharedMemory`],
    /// [`ProtocolError::DaemonLost`] and its kin.
    pub fn acquire(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.with_controller(hook, |_, _| Ok(()))
    }

    /// Refuses a forked child: the ports belong to the process that opened them. A thread that had a turn or a lock is not in
    /// the child, so a call asks this before it waits for either.
    ///
    /// # Errors
    /// [`ProtocolError::Forked`].
    pub fn check_process(&self) -> Result<(), ProtocolError> {
        if self.maker.is_this() {
            return Ok(());
        }
        let (name, pid) = (self.description.name.clone(), self.maker.pid());
        Err(ProtocolError::Forked { name, pid })
    }

    fn take_lease(&self, hook: Hook<'_>) -> Result<Box<Controller>, ProtocolError> {
        Controller::acquire(&self.connection, &self.description, &self.frames, hook).map(Box::new)
    }

    /// Gives the lease back, so that another client can take it. Does nothing without one. Frames stay valid. From a hook
    /// it takes effect when the call that waits returns.
    ///
    /// # Errors
    /// [`ProtocolError::Interrupted`] while it waits for the call of another thread; [`ProtocolError::Forked`].
    pub fn release(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.check_process()?;
        match self.controller.take(hook) {
            Ok(mut held) => drop(held.take()), // dropping it releases
            Err(ProtocolError::CallInProgress) => self.release.store(true, Ordering::Relaxed),
            Err(error) => return Err(error),
        }
        Ok(())
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
        self.run(&Call::new(Op::Step, commands, None), hook)
    }

    /// The first half of a [`Client::step`]: sends its command and returns while the daemon steps. Until [`Client::recv`] has
    /// taken the frame, every other command is refused.
    ///
    /// # Errors
    /// As [`Client::step`], but for what only the daemon finds, such as an entry that is NaN: [`Client::recv`] has that. After
    /// any error nothing is in flight that was not before.
    pub fn send(&self, commands: &[Command<'_>], hook: Hook<'_>) -> Result<(), ProtocolError> {
        let call = Call::new(Op::Step, commands, None);
        self.with_controller(hook, |controller, hook| controller.send(&call, hook))
    }

    /// The second half: waits for the frame of the step that was sent.
    ///
    /// # Errors
    /// [`ProtocolError::NothingSent`]. [`ProtocolError::CommandRefused`]: no world was touched, and the next step may be sent.
    /// After [`ProtocolError::Interrupted`] and [`ProtocolError::Timeout`] it may be called again.
    /// [`ProtocolError::LeaseLost`], [`ProtocolError::DaemonLost`], [`ProtocolError::DaemonRestarted`].
    pub fn recv(&self, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.check_process()?;
        let mut held = self.turn(hook)?;
        let Some(controller) = &mut *held else {
            self.check_alive()?;
            return Err(ProtocolError::NothingSent);
        };
        let result = controller.recv(hook);
        self.settle(held, &result);
        result
    }

    /// Puts the worlds under the mask (all without one) back to the start and returns the frame there.
    ///
    /// What of the state the scene has distributions of is drawn from (seed, world, episode). A reset starts the next episode
    /// of a world; with a seed, one for all or one per world, the first one of that seed. Seed and episode are 0 at first.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn reset(
        &self,
        mask: Option<&[bool]>,
        seed: Option<&[u64]>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        self.reset_to(&[], mask, seed, hook)
    }

    /// As [`Client::reset`], and then sets states of these worlds, before the frame is evaluated.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn reset_to(
        &self,
        arrays: &[Command<'_>],
        mask: Option<&[bool]>,
        seed: Option<&[u64]>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        let call = Call {
            seed,
            ..Call::new(Op::Reset, arrays, mask)
        };
        self.run(&call, hook)
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
        self.run(&Call::new(Op::Write, arrays, mask), hook)
    }

    /// Evaluates the fields at the present state without stepping.
    ///
    /// # Errors
    /// As [`Client::step`].
    pub fn forward(&self, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.run(&Call::new(Op::Forward, &[], None), hook)
    }

    /// Lets the daemon write all worlds into a file, and evaluates the fields. What was there before is replaced as a whole
    /// or, after an error, not at all.
    ///
    /// # Errors
    /// As [`Client::step`]; [`ProtocolError::CommandRefused`] where the daemon cannot write `path`, which must be absolute.
    pub fn snapshot(&self, path: &str, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        let call = Call {
            path: Some(path),
            ..Call::new(Op::Snapshot, &[], None)
        };
        self.run(&call, hook)
    }

    /// Sets the worlds under the mask (all without one) to those of a snapshot, counters and commands included, or all of
    /// them to its world `from_world`; returns the frame evaluated there.
    ///
    /// # Errors
    /// As [`Client::step`]; [`ProtocolError::CommandRefused`] where the daemon cannot read `path`, which must be absolute, or
    /// what it reads is not a whole snapshot of the same model, precision and, without `from_world`, number of worlds.
    pub fn restore(
        &self,
        path: &str,
        mask: Option<&[bool]>,
        from_world: Option<u64>,
        hook: Hook<'_>,
    ) -> Result<Frame, ProtocolError> {
        let call = Call {
            path: Some(path),
            from_world,
            ..Call::new(Op::Restore, &[], mask)
        };
        self.run(&call, hook)
    }

    /// Solves the inverse kinematics that the file at `path` asks for with the daemon's model; the answer takes its place. No
    /// world moves. Returns a frame.
    ///
    /// # Errors
    /// As [`Client::step`]; [`ProtocolError::CommandRefused`] where the daemon cannot read or write `path`, which must be
    /// absolute, or cannot solve what it asks.
    pub fn ik(&self, path: &str, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        let call = Call {
            path: Some(path),
            ..Call::new(Op::Ik, &[], None)
        };
        self.run(&call, hook)
    }

    /// Advances every world by the control frames that the file at `path` asks for, with its policy; what was collected takes its
    /// place. Returns a frame of the end.
    ///
    /// # Errors
    /// As [`Client::step`]; [`ProtocolError::CommandRefused`] where the daemon cannot read or write `path`, which must be
    /// absolute, or cannot carry out what it asks. The worlds stay at the frame before the one that was refused.
    pub fn rollout(&self, path: &str, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        let call = Call {
            path: Some(path),
            ..Call::new(Op::Rollout, &[], None)
        };
        self.run(&call, hook)
    }

    pub(crate) fn run(&self, call: &Call<'_>, hook: Hook<'_>) -> Result<Frame, ProtocolError> {
        self.with_controller(hook, |controller, hook| controller.run(call, hook))
    }

    /// Takes the lease first, if this client has none.
    pub(crate) fn with_controller<T>(
        &self,
        hook: Hook<'_>,
        call: impl FnOnce(&mut Controller, Hook<'_>) -> Result<T, ProtocolError>,
    ) -> Result<T, ProtocolError> {
        self.check_process()?;
        let mut held = self.turn(hook)?;
        let controller = match &mut *held {
            Some(controller) => controller,
            empty => empty.insert(self.take_lease(hook)?),
        };
        let result = call(controller, hook);
        self.settle(held, &result);
        result
    }

    /// Begins the use of a lease. A release that a hook asks for is that of this call.
    fn turn(&self, hook: Hook<'_>) -> Result<Held<'_, Option<Box<Controller>>>, ProtocolError> {
        let held = self.controller.take(hook)?;
        self.release.store(false, Ordering::Relaxed);
        Ok(held)
    }

    /// Ends the use of a lease. One that is lost can be asked for again; a lost daemon cannot come back.
    fn settle<T>(
        &self,
        mut held: Held<'_, Option<Box<Controller>>>,
        result: &Result<T, ProtocolError>,
    ) {
        let is_lost = matches!(result, Err(ProtocolError::LeaseLost { .. }));
        if is_lost || self.release.load(Ordering::Relaxed) {
            held.take();
        }
    }

    /// The newest frame for observers, if there is one that was not returned before. It shows the first
    /// `watch_worlds` worlds and is published at a limited rate.
    ///
    /// # Errors
    /// [`ProtocolError::FramesHeld`], [`ProtocolError::TooManyClients`], [`ProtocolError::DaemonLost`] and its kin,
    /// [`ProtocolError::CallInProgress`], [`ProtocolError::Interrupted`] while it waits for the call of another thread.
    pub fn latest(&self, hook: Hook<'_>) -> Result<Option<Frame>, ProtocolError> {
        self.with_observer(hook, |observer, _| observer.latest())
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
        self.with_observer(hook, |observer, hook| observer.wait_newer(timeout, hook))
    }

    /// How many other clients observe the worlds.
    ///
    /// # Errors
    /// As [`Client::latest`].
    pub fn observers(&self, hook: Hook<'_>) -> Result<usize, ProtocolError> {
        self.check_process()?;
        // an observer that only counts registers no reader
        let registered = usize::from(self.observer.take(hook)?.is_some());
        let all = self.connection.ports(hook, transport::watchers)?;
        Ok(all.saturating_sub(registered))
    }

    fn with_observer<T>(
        &self,
        hook: Hook<'_>,
        call: impl FnOnce(&mut Observer, Hook<'_>) -> Result<T, ProtocolError>,
    ) -> Result<T, ProtocolError> {
        self.check_process()?;
        let mut held = self.observer.take(hook)?;
        let observer = match &mut *held {
            Some(observer) => observer,
            empty => {
                let opened = Observer::open(&self.connection, &self.description, hook)?;
                empty.insert(Box::new(opened))
            }
        };
        call(observer, hook)
    }

    /// Subscribes to every command that the daemon carries out from now on, from any client, with digests of its
    /// frame and the arrays of `fields`.
    ///
    /// # Errors
    /// [`ProtocolError::NoField`]; [`ProtocolError::SharedMemory`] where it does not fit; [`ProtocolError::CommandRefused`]
    /// when there are as many recorders as a daemon serves; [`ProtocolError::DaemonLost`] and its kin.
    pub fn journal(&self, fields: &[String], hook: Hook<'_>) -> Result<Journal, ProtocolError> {
        self.check_process()?;
        Journal::open(&self.connection, &self.description, fields, hook)
    }

    /// Lets a test send what it likes through the ports of the lease, and reads the answer.
    #[cfg(all(test, not(simulated)))]
    pub(crate) fn raw(
        &self,
        send: impl FnOnce(&crate::transport::CommandPublisher<crate::presence::connection::S>, u64),
    ) -> Result<Frame, ProtocolError> {
        let mut held = self
            .controller
            .take(&mut crate::waiting::hook::keep_waiting())?;
        held.as_mut().expect("the lease is held").raw(send)
    }

    /// Lets a test take the lease for another process, which never opens its ports.
    #[cfg(all(test, not(simulated)))]
    pub(crate) fn ask_for_lease(&self, pid: u32) -> bool {
        let granted = self.connection.ask(
            &Request::Acquire { pid },
            &mut crate::waiting::hook::keep_waiting(),
        );
        matches!(granted, Ok(Response::Granted { .. }))
    }

    /// Asks for a journal that is never joined. Returns whether it was granted.
    #[cfg(all(test, not(simulated)))]
    pub(crate) fn ask_for_journal(&self) -> bool {
        let request = Request::Journal { observed: 0 };
        let granted = self
            .connection
            .ask(&request, &mut crate::waiting::hook::keep_waiting());
        matches!(granted, Ok(Response::Journal { .. }))
    }

    /// Errors when the daemon is gone. A few microseconds.
    ///
    /// # Errors
    /// [`ProtocolError::DaemonLost`], [`ProtocolError::DaemonRestarted`].
    pub fn check_alive(&self) -> Result<(), ProtocolError> {
        self.connection.peer.check()
    }

    /// Ends the daemon, with all of its groups, and returns when it is gone and has left nothing behind.
    ///
    /// # Errors
    /// [`ProtocolError::Timeout`], [`ProtocolError::Interrupted`], [`ProtocolError::Forked`].
    pub fn shutdown(&self, hook: Hook<'_>) -> Result<(), ProtocolError> {
        self.release(hook)?;
        self.observer.take(hook)?.take();
        self.connection.shut_down(hook)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // in a forked child the ports belong to the parent: leave them alone
        if !self.maker.is_this() {
            // what another thread used when the process forked is out of reach, and as good as forgotten
            std::mem::forget(self.controller.value().and_then(Option::take));
            std::mem::forget(self.observer.value().and_then(Option::take));
            std::mem::forget(Arc::clone(&self.connection));
        }
    }
}

//! The daemon's end of the protocol: it receives commands one at a time, loans frames, and keeps leases and observers.
//! It knows no physics.

mod cleanup;
mod handover;
mod inbox;
mod journal;
mod late;
mod lease;
mod observers;
mod orphans;
mod pace;
mod state;
#[cfg(all(test, not(simulated)))]
mod tests;
pub mod watch;
mod worlds;

use std::time::Duration;

use crate::doors;
use crate::doors::sync::Arc;
use crate::doors::sync::atomic::{AtomicBool, Ordering};
use crate::doors::time::Instant;

pub use cleanup::ClientCleanup;
pub use inbox::{Inbox, Numbers};
pub use lease::FrameMemory;
pub use worlds::{Next, Worlds};

pub use crate::memory::mapping::Pages;

use self::handover::Handover;
use self::journal::Journals;
use self::lease::Lease;
use self::observers::Observers;
use self::pace::Pacer;
use self::state::{State, header};
use self::worlds::S;
use crate::lease::device_memory::{self, Delivery, Door};
use crate::memory::guard::guarded;
use crate::memory::mapping;
use crate::presence::daemon_lock::DaemonLock;
use crate::presence::described;
use crate::transport::budget;
use crate::transport::{self, Sleeper, handshake};
use crate::waiting::affinity::CoreAffinity;
use crate::waiting::clock;
use crate::waiting::waiter::{Waiter, cores};
use crate::{Command, Description, Op, ProtocolError, RefusalKind, Table};

/// While commands come without a pause, control requests are looked at this often.
const AROUND_PERIOD: Duration = Duration::from_millis(20);

/// A daemon ends when the transport panics that many times in a row, with all clients lost after each.
const PANICS_MAX: u32 = 8;

/// The services of one daemon.
pub struct Host {
    state: State,
    waiter: Waiter,
    listener: Sleeper<S>,
    panics: u32,
    /// Last, so that its files go after everything that uses them.
    daemon_lock: DaemonLock,
}

impl Host {
    /// Opens the services of a daemon, takes their memory, and announces it.
    ///
    /// `frame` is the table of a frame ([`Table::over_arena`]). `stops` names the commands that are 0 in worlds whose command is
    /// late, where these stop. `stop` ends [`Host::wait`] when set. Of `description`, the
    /// host fills in name, session, process, protocol and schema.
    ///
    /// # Errors
    /// [`ProtocolError::SharedMemory`] and [`ProtocolError::Memory`] before anything is taken;
    /// [`ProtocolError::Transport`].
    pub fn open(
        mut daemon_lock: DaemonLock,
        mut description: Description,
        frame: Table,
        stops: &[&str],
        stop: Arc<AtomicBool>,
    ) -> Result<Host, ProtocolError> {
        let session = doors::random();
        description.protocol = crate::PROTOCOL_VERSION;
        description.release = env!("CARGO_PKG_VERSION").to_owned();
        description.name = daemon_lock.paths().name().to_owned();
        description.session = session;
        description.pid = crate::doors::process::id();
        description.schema = description.schema_hash();
        check(&description, &frame, 0, 1)?;

        let node = transport::node::<S>(&daemon_lock.paths().transport_config(session), "daemon")?;
        let attributes = [
            (handshake::PROTOCOL, description.protocol.to_string()),
            (handshake::SCHEMA, format!("{:016x}", description.schema)),
            (handshake::WORLDS, description.worlds.to_string()),
            (handshake::DOFS, description.dof_names.len().to_string()),
        ];
        let listener = transport::listener(&transport::create_event(&node, "wake", &attributes)?)?;
        let control = transport::create_control(&node)?;
        let responder = transport::responder(&control)?;
        described::write(daemon_lock.paths(), &description)?;
        let door = Door::open(daemon_lock.paths(), session)?;
        let observers = Observers::open(&node, &description, &frame)?;
        let lease = Lease::open(&node, 1, &frame, description.frames_held)?;
        // last: from here on clients may come
        daemon_lock.announce(session, 1)?;

        // the daemon only waits while nobody steps: its own threads are idle then, the client needs one core. Other groups may step
        let others = match description.groups {
            1 => 0,
            _ => description.busy_threads(),
        };
        let inbox = Inbox::for_commands_of(&description);
        let pacer = Pacer::new(&description, stops);
        let state = State {
            node,
            paths: daemon_lock.paths().clone(),
            faults: mapping::faults(),
            description,
            frame,
            lease: Some(lease),
            handover: Handover::default(),
            journals: Journals::default(),
            epochs: 1,
            control,
            responder,
            observers,
            door,
            visitor: None,
            polled: Instant::now(),
            frames: 0,
            inbox,
            aside: None,
            stop,
            affinity: CoreAffinity::new(),
            pacer,
        };
        Ok(Host {
            state,
            waiter: Waiter::new(cores() > 1 + others),
            listener,
            panics: 0,
            daemon_lock,
        })
    }

    /// The description that clients get.
    pub fn description(&self) -> &Description {
        &self.state.description
    }

    /// Where the daemon lives.
    pub fn daemon_lock(&self) -> &DaemonLock {
        &self.daemon_lock
    }

    /// Shared memory taken so far [bytes].
    pub fn shared_bytes(&self) -> u64 {
        budget::used(&self.daemon_lock.paths().shared_folder())
    }

    /// Something that cleans up after killed clients, to be run now and then on a thread of its own.
    pub fn client_cleanup(&self) -> ClientCleanup {
        ClientCleanup::new(&self.state.node)
    }

    /// Waits for the next thing to do.
    ///
    /// # Errors
    /// [`ProtocolError::Transport`]; [`ProtocolError::Damaged`] when other programs leave nothing to serve with.
    pub fn wait(&mut self) -> Result<Next, ProtocolError> {
        self.state.hand_over();
        loop {
            if let Some(next) = guarded(|| self.look()) {
                self.panics = 0;
                if let Ok(Next::LeaseEnded) = next {
                    self.state.handover.notify();
                }
                return next;
            }
            self.panics += 1;
            if self.panics > PANICS_MAX {
                return Err(ProtocolError::Damaged {
                    action: "serve clients".to_owned(),
                    path: self
                        .daemon_lock
                        .paths()
                        .shared_folder()
                        .display()
                        .to_string(),
                });
            }
            self.state.lose_clients();
        }
    }

    fn look(&mut self) -> Result<Next, ProtocolError> {
        if self.state.polled.elapsed() > AROUND_PERIOD
            && let Some(next) = self.state.poll_services()
        {
            return Ok(next);
        }
        let next = self.waiter.wait(&self.listener, &mut self.state)?;
        if next == Next::Command {
            let client_core = self.state.inbox.header().core;
            let is_step = self.state.inbox.op() == Op::Step;
            let (is_paced, affinity) = (self.state.pacer.is_paced(), &mut self.state.affinity);
            let shared = affinity.core(is_paced) == client_core;
            let moved = match (is_paced, is_step) {
                (false, _) => shared && affinity.leave(client_core),
                (true, true) => shared && affinity.keep_off(client_core),
                // other calls may start threads, which would stay away, too
                (true, false) => {
                    affinity.stay();
                    false
                }
            };
            self.waiter.share(shared && !moved);
        }
        Ok(next)
    }

    /// Whether somebody asks the daemon to stop: long work on a command looks at it.
    pub fn stop_flag(&self) -> &AtomicBool {
        &self.state.stop
    }

    /// The command that [`Host::wait`] has found.
    pub fn inbox(&self) -> &Inbox {
        &self.state.inbox
    }

    /// Answers the command with a frame, which the worlds write straight into shared memory.
    ///
    /// `started` is when work on the command began.
    pub fn answer(&mut self, started: Instant, worlds: &mut impl Worlds) {
        if self.state.inbox.op() == Op::Step && !self.approach() {
            return self.state.record_inputs();
        }
        self.state.answer(started, worlds);
    }

    /// Serves everything but commands until shortly before the frame is due. False if nobody waits for it any more.
    fn approach(&mut self) -> bool {
        while let Some(due) = self.state.pacer.due() {
            let wait = Duration::from_nanos(due.saturating_sub(clock::now()));
            if wait < AROUND_PERIOD {
                break;
            }
            if !self.is_waited_for() {
                return false;
            }
            crate::doors::thread::sleep((wait - AROUND_PERIOD / 2).min(AROUND_PERIOD));
        }
        true
    }

    /// Puts a step into [`Host::inbox`] that no client sent, after [`Next::Late`].
    pub fn give_up(&mut self) {
        self.state.give_up();
    }

    /// The worlds stand still until the next step comes.
    pub fn stand_still(&mut self) {
        self.state.pacer.stand_still();
    }

    /// Advances the worlds by that step, and shows observers; `arena` has room for a frame.
    pub fn advance(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) {
        self.state.advance(arena, worlds);
    }

    /// Puts the command in [`Host::inbox`] aside, which asks for steps that the daemon makes itself by [`Host::put_step`]. It stays
    /// there until [`Host::take_back`].
    pub fn put_aside(&mut self) {
        self.state.put_aside();
    }

    /// Puts a step into [`Host::inbox`], for the client whose command was put aside.
    ///
    /// # Errors
    /// One sentence about what does not fit.
    pub fn put_step(&mut self, commands: &[Command<'_>]) -> Result<(), String> {
        self.state.put_step(commands)
    }

    /// Advances the worlds by that step, at the pace of the run, and shows observers; `arena` has room for a frame. False if nobody
    /// waits for it any more.
    pub fn carry_out(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) -> bool {
        self.state.pacer.receive();
        if !self.approach() {
            return false;
        }
        self.state.carry_out(arena, worlds);
        self.state.polled.elapsed() < AROUND_PERIOD || self.is_waited_for()
    }

    /// Puts the command that was put aside into [`Host::inbox`] again.
    pub fn take_back(&mut self) {
        self.state.take_back();
    }

    /// The number of the present lease: its frames lie in memory of its own. 0 if there is none.
    pub fn lease(&self) -> u64 {
        self.state.lease.as_ref().map_or(0, |lease| lease.epoch)
    }

    /// Slots of frames that a lease has.
    pub fn frame_slots(&self) -> usize {
        transport::frame_slots(self.state.description.frames_held)
    }

    /// Answers [`Next::DeviceMemory`]; `make` makes it, or says why it cannot.
    pub fn deliver(&mut self, make: impl FnOnce(&Host) -> Result<Delivery, String>) {
        let Some((epoch, stream)) = self.state.visitor.take() else {
            return;
        };
        let answer = match self.lease() == epoch {
            true => make(self),
            false => Err("its lease has ended".to_owned()),
        };
        device_memory::deliver(&stream, answer);
    }

    /// Serves everything but commands, while the one in [`Host::inbox`] waits for its client's card. False if nobody waits for it any more.
    pub fn is_waited_for(&mut self) -> bool {
        if self.state.poll_services() == Some(Next::End) {
            self.state.stop.store(true, Ordering::Relaxed);
        }
        !self.state.stop.load(Ordering::Relaxed) && self.lease() == self.state.inbox.header().epoch
    }

    /// Makes one of the present step of commands here and commands that were in device memory; see [`Inbox::bring_here`].
    ///
    /// # Errors
    /// One sentence about what does not fit.
    pub fn bring_here(&mut self, brought: &[(String, Vec<f32>)]) -> Result<(), String> {
        let state = &mut self.state;
        state.inbox.bring_here(&state.description, brought)
    }

    /// Whether a recorder is attached.
    pub fn is_recorded(&self) -> bool {
        self.state.journals.are_read()
    }

    /// Gives recorders the state of all worlds, from which they go on: those who wait for one, or `all` of them after a
    /// command that others could not carry out again.
    pub fn record_state(&mut self, state: &[u8], all: bool) {
        let session = self.state.description.session;
        self.state.journals.state(session, state, all);
    }

    /// Ends all recordings, and refuses those to come.
    pub fn end_records(&mut self, reason: &str) {
        let session = self.state.description.session;
        self.state.journals.end(session, reason);
    }

    /// Answers the command with a refusal, unless its lease has ended: another client may have the present one.
    pub fn refuse(&mut self, kind: RefusalKind, reason: &str) {
        if self.lease() == self.state.inbox.header().epoch {
            self.state.refuse(kind, reason);
        }
    }

    /// Shows observers the present state; `arena` has room for a frame.
    pub fn show(&mut self, arena: &mut [u64], worlds: &mut impl Worlds) {
        let (began, state) = (Instant::now(), &mut self.state);
        state.frames += 1;
        if worlds.frame(arena, None) {
            let head = header(&state.description, &state.frame, state.frames);
            state
                .observers
                .show(began, head, &state.frame, arena, worlds);
        } else {
            state.observers.unchanged();
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // first: who waits must not take its lease for lost, or a service for one that never was
        self.daemon_lock.withdraw();
    }
}

/// Refuses a run whose shared memory would not fit, or not beside the `physics_bytes` of its worlds, before anything is
/// taken. Of several groups, each as described, all are counted.
///
/// # Errors
/// [`ProtocolError::SharedMemory`] or [`ProtocolError::Memory`] with the bytes free and needed.
pub fn check_memory(
    description: &Description,
    frame: &Table,
    physics_bytes: u64,
) -> Result<(), ProtocolError> {
    check(description, frame, physics_bytes, description.groups)
}

/// The same for so many groups.
fn check(
    description: &Description,
    frame: &Table,
    physics_bytes: u64,
    groups: usize,
) -> Result<(), ProtocolError> {
    let among = match groups {
        1 => String::new(),
        _ => format!(" in {groups} groups"),
    };
    let what = format!(
        "{} worlds{among}, {} frames held",
        description.worlds * groups,
        description.frames_held
    );
    let process_bytes = physics_bytes.saturating_add(budget::own_bytes(description) as u64);
    budget::check(
        budget::free(),
        budget::all_bytes(description, frame).saturating_mul(groups),
        process_bytes.saturating_mul(groups as u64),
        &what,
    )
}

/// Memory that can still be taken, of the machine or of our control group, whichever has less [bytes].
pub fn free_memory() -> u64 {
    budget::free().memory
}

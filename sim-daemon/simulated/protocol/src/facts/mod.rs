//! What is known of a run from outside, and what must hold of it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sim_machine::fs;
use sim_machine::process;
use sim_machine::process::Handle;
use sim_machine::time::now;

use crate::plan::Plan;

mod daemons;
use daemons::Launched;

/// Files in shared memory, by their kind: the ending of their name, or where they are.
pub fn kinds_of_files() -> BTreeMap<String, usize> {
    let mut kinds = BTreeMap::new();
    for path in fs::list(Path::new("/dev/shm")) {
        let kind = path.extension().or(path.parent().and_then(Path::file_name));
        let kind = kind.map_or_else(String::new, |kind| kind.to_string_lossy().into_owned());
        // a folder of a node is one of a kind
        let is_number = kind.parse::<u128>().is_ok();
        *kinds
            .entry(if is_number {
                "of a node".to_owned()
            } else {
                kind
            })
            .or_default() += 1;
    }
    kinds
}

/// A command, everywhere and always: run of the daemon, lease, number.
pub type Id = (u64, u64, u64);

/// A client, everywhere and always: process, and which client of all.
pub type ClientId = (u32, u64);

/// A holder whose heartbeats stopped for so long loses the lease, and the time that a call may take besides [ns].
const SILENT: u64 = 2_600_000_000;
/// A process that is stopped for less misses no heartbeat that matters, nor its time to join [ns].
const MISSED: u64 = 400_000_000;

/// What is known, for all processes and outside of the machine.
#[derive(Debug, Clone, Default)]
pub struct Facts(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// What the worlds counted when they carried out a command.
    carried_out: BTreeMap<Id, u64>,
    /// The lease of each run whose commands were carried out last.
    lease: BTreeMap<u64, u64>,
    /// Times in which a process was stopped [ns]: begin and end, with its number.
    stopped: Vec<(u64, u64, u32)>,
    /// Until when a client may hold a lease [ns].
    holds: BTreeMap<ClientId, u64>,
    /// When a client lost its lease last [ns].
    lost: BTreeMap<ClientId, u64>,
    /// Processes of clients, in the order of their numbers.
    clients: Vec<Handle>,
    /// Daemons that served, by their run, and since when [ns].
    serving: BTreeMap<u64, (Handle, u64)>,
    /// Runs whose end somebody asked for.
    asked: Vec<u64>,
    asked_daemons: Vec<Handle>,
    /// How many ask for the end of whatever daemon runs, and when the last one had done so [ns].
    ends: u64,
    asked_all: u64,
    /// Calls of the system fail.
    failing: bool,
    /// Threads lose their core, or wake late.
    uneven: bool,
    /// None of that any more, and nobody is killed.
    is_calm: bool,
    /// How long a reset takes [ms].
    slow: u64,
    launched: Vec<Launched>,
    /// When the folder of daemons was removed last: nobody finds those from before [ns].
    logged_out: u64,
    /// When something last happened that a wait may have to sit out [ns].
    squeezed: u64,
    commands: u64,
    /// Files of the last daemon before anybody came, by their kind.
    files: BTreeMap<String, usize>,
}

impl Facts {
    /// At the begin of a plan.
    pub fn for_plan(plan: &Plan) -> Facts {
        let facts = Facts::default();
        facts.known(|known| {
            known.failing = plan.failing > 0;
            known.uneven = plan.preempting > 0 || plan.lateness > 1000;
            known.slow = plan.slow;
        });
        facts
    }

    fn known<T>(&self, look: impl FnOnce(&mut Known) -> T) -> T {
        look(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// A daemon has carried out a command, and counted so far.
    ///
    /// # Panics
    /// It did so twice, or for a lease that has ended.
    pub fn carry_out(&self, id: Id, count: u64) {
        self.known(|known| {
            known.commands += 1;
            let before = known.carried_out.insert(id, count);
            assert_eq!(before, None, "{id:?} was carried out twice");
            let lease = known.lease.entry(id.0).or_default();
            assert!(
                id.1 >= *lease,
                "{id:?} was carried out after lease {lease} had begun"
            );
            *lease = id.1;
        });
    }

    /// A client got a frame.
    ///
    /// # Panics
    /// It is not that of its command.
    pub fn got(&self, id: Id, count: u64) {
        let counted = self.known(|known| known.carried_out.get(&id).copied());
        assert_eq!(counted, Some(count), "the frame of {id:?} is another one's");
    }

    /// Commands that were carried out.
    pub fn commands(&self) -> u64 {
        self.known(|known| known.commands)
    }

    /// A process is stopped from now on, for so long [ns].
    pub fn stop(&self, pid: u32, time: u64) {
        let now = now();
        self.known(|known| known.stopped.push((now, now + time, pid)));
    }

    /// From then on nobody is stopped, and shared memory has room [ns].
    pub fn calm_at(&self) -> u64 {
        self.known(|known| {
            let stops = known.stops();
            let ends = stops.iter().map(|stop| stop.1);
            ends.fold(known.squeezed, u64::max)
        })
    }

    /// From now on no call fails.
    pub fn calm(&self) {
        self.known(|known| (known.failing, known.uneven, known.is_calm) = (false, false, true));
    }

    /// Whether that was said.
    pub fn is_calm(&self) -> bool {
        self.known(|known| known.is_calm)
    }

    /// Whether calls that began then may fail.
    pub fn may_fail(&self, since: u64) -> bool {
        self.known(|known| known.failing) || self.was_squeezed(since)
    }

    /// Whether some threads may wait while others go on.
    pub fn is_uneven(&self) -> bool {
        self.known(|known| known.uneven)
    }

    /// How long a reset takes.
    pub fn slow(&self) -> Duration {
        Duration::from_millis(self.known(|known| known.slow))
    }

    /// A client of this process, which holds nothing.
    pub fn client(&self) -> ClientId {
        self.known(|known| {
            known.clients.push(Handle::this());
            (process::id(), known.clients.len() as u64)
        })
    }

    /// A process that may hold the lease now.
    pub fn holder(&self) -> Option<Handle> {
        self.known(|known| {
            let holding = known.holds.iter().filter(|holds| *holds.1 == u64::MAX);
            let mut holders = holding.map(|(client, _)| known.clients[client.1 as usize - 1]);
            holders.find(|holder| holder.is_alive())
        })
    }

    /// A client may hold a lease until then [ns].
    pub fn holds(&self, client: ClientId, until: u64) {
        self.known(|known| known.holds.insert(client, until));
    }

    /// A client was refused the lease, for which it asked then, since that process holds it.
    ///
    /// # Panics
    /// That cannot be.
    pub fn held_by(&self, pid: u32, client: ClientId, since: u64) {
        let now = now();
        self.known(|known| {
            let may =
                |(id, until): (&ClientId, &u64)| id.0 == pid && *until >= since && *id != client;
            assert!(
                known.holds.iter().any(may),
                "process {pid} has given the lease back that keeps {client:?} out"
            );
            // a daemon that does not run does not see who died
            let stops = known.stops();
            let is_late = |begin: Option<u64>, time| {
                begin.is_some_and(|begin| begin + time + in_all(&stops, begin) < now)
            };
            let dead = process::dead_since(pid);
            assert!(
                !is_late(dead, if client.1 == 0 { SILENT } else { MISSED }),
                "process {pid} is dead and keeps {client:?} out"
            );
            let stopped = process::stopped_since(pid).filter(|begin| begin + SILENT < since);
            // a daemon that did not run does not know how long others were silent
            let excused =
                |&(_, end, who): &(u64, u64, u32)| who != pid && end > stopped.unwrap_or(0);
            assert!(
                stopped.is_none() || known.slow > 0 || stops.iter().any(excused),
                "process {pid} is silent and keeps {client:?} out"
            );
        });
    }

    /// A client lost its lease.
    ///
    /// # Panics
    /// It was there all the time since it lost the last one.
    pub fn lost_lease(&self, client: ClientId) {
        self.known(|known| {
            let now = now();
            let before = known.lost.insert(client, now).unwrap_or(0);
            let mut stops = known.stops();
            stops.retain(|stop| stop.2 == client.0);
            let stopped = in_all(&stops, before);
            let mut losses = process::losses();
            let is_daemon = |pid: u32| known.launched.iter().any(|run| run.has_daemon(pid));
            losses.retain(|loss| loss.2 == client.0 || is_daemon(loss.2));
            let lately = now.saturating_sub(SILENT).max(before);
            let is_loaded = in_all(&losses, lately) >= MISSED;
            assert!(
                stopped >= MISSED || is_loaded,
                "{client:?} lost its lease, and was there"
            );
        });
    }

    /// Somebody asks for the end of this run.
    pub fn ask(&self, session: u64) {
        self.known(|known| known.asked.push(session));
    }

    /// Somebody asks this daemon to end.
    pub fn ask_daemon(&self, daemon: Handle) {
        self.known(|known| known.asked_daemons.push(daemon));
    }

    /// Somebody asks for the end of whatever daemon runs, during that call.
    pub fn ask_all<T>(&self, call: impl FnOnce() -> T) -> T {
        self.known(|known| known.ends += 1);
        let result = call();
        let now = now();
        self.known(|known| (known.ends, known.asked_all) = (known.ends - 1, now));
        result
    }

    /// A run is said to be over.
    ///
    /// # Panics
    /// Its daemon lives, and nobody asked it to end.
    pub fn is_over(&self, session: u64) {
        self.known(|known| {
            let lives = known.lives(session, u64::MAX);
            assert!(!lives, "the daemon of run {session:x} lives");
        });
    }

    /// No daemon was there since then, it is said.
    ///
    /// # Panics
    /// One was.
    pub fn nobody_serves(&self, since: u64) {
        self.known(|known| {
            let seen = known.serving.iter().filter(|run| !known.is_hidden(run.1.0));
            let mut sessions = seen.map(|(session, _)| session);
            let lives = sessions.find(|session| known.lives(**session, since));
            assert!(lives.is_none(), "the daemon of run {lives:x?} lives");
        });
    }

    /// This daemon ends.
    ///
    /// # Panics
    /// Nobody asked it to.
    pub fn ends(&self, may_fail: bool) {
        let this = Handle::this();
        self.known(|known| {
            let mut runs = known.serving.iter().filter(|run| run.1.0 == this);
            let unasked = runs.any(|(session, run)| !known.is_asked(*session, *run));
            assert!(may_fail || !unasked, "nobody asked this daemon to end");
        });
    }

    /// Shared memory is short, or calls fail.
    pub fn squeeze(&self, until: u64) {
        self.known(|known| known.squeezed = known.squeezed.max(until));
    }

    /// Whether it was since then.
    pub fn was_squeezed(&self, since: u64) -> bool {
        self.known(|known| known.squeezed >= since)
    }

    /// Time since then in which somebody was stopped, or had lost the core [ns].
    pub fn stopped_since(&self, since: u64) -> u64 {
        let mut times = self.known(|known| known.stops());
        times.extend(process::losses());
        in_all(&times, since)
    }

    /// This daemon serves from now on; with the files that are there.
    pub fn serves(&self, session: u64, files: BTreeMap<String, usize>) {
        let (this, now) = (Handle::this(), now());
        self.known(|known| {
            known.files = files;
            known.serving.insert(session, (this, now));
        });
    }

    /// Whether the daemon of a run lives.
    pub fn serves_still(&self, session: u64) -> bool {
        self.known(|known| {
            let run = known.serving.get(&session);
            run.is_some_and(|(daemon, _)| daemon.is_alive())
        })
    }

    /// Those files.
    pub fn first_files(&self) -> BTreeMap<String, usize> {
        self.known(|known| known.files.clone())
    }
}

/// How long these times are together, from then on and until now; what is in several counts once [ns].
fn in_all(times: &[(u64, u64, u32)], since: u64) -> u64 {
    let now = now();
    let mut clipped: Vec<(u64, u64)> = times
        .iter()
        .map(|&(begin, end, _)| (begin.max(since), end.min(now)))
        .filter(|(begin, end)| begin < end)
        .collect();
    clipped.sort_unstable();
    let (mut total, mut reached) = (0, 0);
    for (begin, end) in clipped {
        total += end.saturating_sub(begin.max(reached));
        reached = reached.max(end);
    }
    total
}

impl Known {
    /// When processes were stopped: begin and end [ns], and their number.
    fn stops(&self) -> Vec<(u64, u64, u32)> {
        let mut stops = self.stopped.clone();
        stops.extend(process::halts());
        stops
    }

    fn is_asked(&self, session: u64, (daemon, since): (Handle, u64)) -> bool {
        let is_named = self.asked.contains(&session) || self.asked_daemons.contains(&daemon);
        is_named || self.ends > 0 || self.asked_all >= since
    }

    /// Whether the daemon of a run that began to serve before that time lives, and is not to end.
    fn lives(&self, session: u64, before: u64) -> bool {
        let run = self.serving.get(&session);
        run.is_some_and(|&(daemon, since)| {
            since < before && daemon.is_alive() && !self.is_asked(session, (daemon, since))
        })
    }
}

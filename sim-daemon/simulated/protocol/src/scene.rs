//! One run: processes begin, live and die by a plan, and at the end everything is as if nobody had been there.

use std::path::Path;
use std::time::Duration;

use sim_machine::fs;
use sim_machine::process::{self, Handle};
use sim_machine::system::signals;
use sim_machine::thread::sleep;
use sim_machine::time::{jump, now};
use sim_machine::{Outcome, Run, note};
use sim_protocol_simulated::paths::DaemonPaths;
use sim_protocol_simulated::{ProtocolError, cleanup_after_death, sweep};

use crate::client::Actor;
use crate::daemon::{self, root};
use crate::facts::{Facts, kinds_of_files};
use crate::plan::{Act, Fate, Plan, Whom};

/// A daemon whose owner died is gone after this time [ns].
const ORPHAN_MAX: u64 = 2_000_000_000;
/// Everybody has done what they do by then [ms].
const END_MAX: u64 = 400_000;
/// Doors of a run that ends.
const STEPS_MAX: u64 = 30_000_000;
/// A folder without a mark is old then.
const OLD: Duration = Duration::from_secs(61);
/// All jumps of the calendar together are shorter [s].
const JUMPS_MAX: i64 = 1_000_000;
/// By then a daemon has cleaned up after everybody: it looks for files without an owner twice, half a second apart.
const CLEAN: Duration = Duration::from_secs(3);
/// A lock that is held longer is that of a daemon, to who cleans up [ns].
const HELD: u64 = 400_000_000;
/// Bytes of shared memory.
const SHARED: u64 = 1 << 30;

/// Carries out a plan.
pub fn run(plan: &Plan, trace: bool) -> (Outcome, u64) {
    let facts = Facts::for_plan(plan);
    let (seen, carried) = (facts.clone(), plan.clone());
    let run = Run {
        seed: plan.seed,
        failing: plan.failing,
        dropping: plan.dropping,
        preempting: plan.preempting,
        longest: plan.longest,
        lateness: 1000 * plan.lateness,
        steps_max: STEPS_MAX,
        trace,
    };
    let outcome = run.play(move || play(&carried, &facts));
    let commands = seen.commands();
    (outcome, commands)
}

/// The processes of clients, by their number in the plan.
struct Cast<'a> {
    plan: &'a Plan,
    facts: &'a Facts,
    clients: Vec<Handle>,
    /// Owners that were killed, their daemon, and when that must be gone at the latest.
    orphans: Vec<(Handle, u64)>,
}

fn play(plan: &Plan, facts: &Facts) {
    fs::set_capacity(SHARED);
    let clients = Vec::new();
    let orphans = Vec::new();
    let mut cast = Cast {
        plan,
        facts,
        clients,
        orphans,
    };
    cast.launch(u64::MAX);
    for acts in &plan.clients {
        let client = cast.begin(acts.clone());
        cast.clients.push(client);
    }
    for (after, fate) in &plan.fates {
        sleep(Duration::from_millis(*after));
        note(|| format!("{fate:?}"));
        cast.befall(*fate);
        cast.look_after_orphans();
    }
    cast.end();
}

/// Removes what a daemon left that has ended, as its launcher does.
fn clean_up(facts: &Facts) {
    let (began, root) = (now(), root());
    let cleaned = cleanup_after_death(Some(&root), daemon::NAME);
    note(|| format!("cleaned up: {cleaned:?}"));
    let is_excused = facts.may_fail(began) || facts.lived_since(began);
    match cleaned {
        _ if is_excused => {}
        Ok(true) => {
            let paths = DaemonPaths::new(Some(&root), daemon::NAME).expect("a good name");
            let folder = Path::new("/dev/shm").join(paths.stem());
            // a client that attaches makes files yet, which go with the next start
            let mut left = fs::list(&folder);
            left.retain(|path| path.extension().is_some_and(|kind| kind == "description"));
            let is_good = left.is_empty() || facts.lived_since(began);
            assert!(is_good, "left behind: {left:?}");
        }
        // who is stopped may hold the lock
        Ok(false) => assert!(facts.stopped_since(began) > HELD, "nobody cleans up"),
        Err(error) => panic!("cleaning up: {error}"),
    }
}

impl Cast<'_> {
    /// Launches a daemon, from an owner of its own, that is killed after so many changes.
    fn launch(&self, changes: u64) {
        let (facts, failing) = (self.facts.clone(), self.plan.failing > 0);
        let owner = process::start(move || {
            let (owner, own, at) = (Handle::this(), facts.clone(), now());
            let daemon = process::start(move || {
                if !own.is_calm() {
                    Handle::this().kill_at_change(changes);
                }
                let began = now();
                let served = daemon::run(&own, owner.pid);
                let may_fail = failing || own.was_squeezed(began);
                match served {
                    Ok(()) => own.ends(may_fail),
                    Err(ProtocolError::NameTaken { .. }) => {}
                    Err(error) => assert!(may_fail, "the daemon ends: {error}"),
                }
            });
            facts.launched(owner, daemon, at);
            while daemon.is_alive() {
                sleep(Duration::from_millis(100));
            }
            clean_up(&facts);
        });
        note(|| format!("owner {}", owner.pid));
    }

    fn begin(&self, acts: Vec<Act>) -> Handle {
        let facts = self.facts.clone();
        process::start(move || Actor::new(&facts).play(&acts))
    }

    fn who(&self, whom: Whom) -> Option<Handle> {
        match whom {
            Whom::Client(number) => self.clients.get(number).copied(),
            Whom::Holder => self.facts.holder(),
            Whom::Daemon => self.facts.daemon(),
            Whom::Owner => self.facts.owner(),
        }
    }

    fn befall(&mut self, fate: Fate) {
        match fate {
            Fate::Kill(whom) => {
                let Some(who) = self.who(whom) else { return };
                let owned = (whom == Whom::Owner && who.is_alive())
                    .then(|| self.facts.daemon())
                    .flatten();
                who.kill();
                owned
                    .iter()
                    .for_each(|daemon| self.facts.ask_daemon(*daemon));
                self.orphans.extend(owned.map(|daemon| (daemon, now())));
            }
            Fate::KillAtDoor(whom, doors) => {
                let who = self.who(whom);
                who.into_iter().for_each(|who| who.kill_at_door(doors));
            }
            Fate::KillAtChange(whom, changes) => {
                let who = self.who(whom);
                who.into_iter().for_each(|who| who.kill_at_change(changes));
            }
            Fate::StopAtChange(whom, changes, time) => {
                let who = self.who(whom);
                let time = Duration::from_millis(time);
                who.into_iter()
                    .for_each(|who| who.stop_at_change(changes, time));
            }
            Fate::Rival(time) => {
                let acts = vec![Act::Attach(1000), Act::Insist(time), Act::Steps(3)];
                let rival = self.begin(acts);
                self.clients.push(rival);
            }
            Fate::End => self.end_daemon(),
            Fate::EndDoomed(changes) => {
                let daemon = self.facts.daemon();
                daemon
                    .iter()
                    .for_each(|daemon| daemon.kill_at_change(changes));
                self.end_daemon();
            }
            Fate::Stop(whom, time) => self.stop(whom, time),
            Fate::Overtake(changes, time) => {
                match changes {
                    0 => self.stop(Whom::Holder, time),
                    _ => self.befall(Fate::StopAtChange(Whom::Holder, changes, time)),
                }
                self.befall(Fate::Rival(time));
            }
            Fate::Again(number) => {
                if let Some(before) = self.clients.get(number).filter(|client| !client.is_alive()) {
                    note(|| format!("in place of {before:?}"));
                    self.clients[number] = self.begin(self.plan.clients[number].clone());
                }
            }
            Fate::Launch => self.launch(u64::MAX),
            Fate::LaunchDoomed(changes) => self.launch(changes),
            Fate::Logout(launches) => {
                self.facts.log_out();
                let _ = fs::remove_dir_all(root());
                if launches {
                    self.launch(u64::MAX);
                }
            }
            Fate::Replace(after) => {
                self.end_daemon();
                sleep(Duration::from_micros(after));
                self.launch(u64::MAX);
            }
            Fate::Signal => {
                let daemon = self.facts.daemon().filter(|daemon| daemon.is_alive());
                if let Some(daemon) = daemon {
                    self.facts.ask_daemon(daemon);
                    signals::send(daemon.pid);
                }
            }
            Fate::Jump(seconds) => jump(1_000_000_000 * seconds),
            Fate::Squeeze(kibibytes, time) => {
                // calls that began before it ends may fail
                self.facts.squeeze(now() + 1_000_000 * time);
                fs::set_free(kibibytes << 10);
                sim_machine::at(Duration::from_millis(time), || fs::set_capacity(SHARED));
            }
        }
    }

    fn stop(&self, whom: Whom, time: u64) {
        let Some(who) = self.who(whom) else { return };
        who.stop();
        self.facts.stop(who.pid, 1_000_000 * time);
        sim_machine::at(Duration::from_millis(time), move || who.resume());
    }

    /// As a process does that is no client.
    fn end_daemon(&self) {
        let facts = self.facts.clone();
        process::start(move || Actor::new(&facts).end());
    }

    /// A daemon whose owner is dead goes, unless it is stopped.
    fn look_after_orphans(&mut self) {
        let facts = self.facts;
        self.orphans.retain(|&(daemon, since)| {
            let waited = now() - since;
            let late = waited.saturating_sub(facts.stopped_since(since)) > ORPHAN_MAX + 200_000_000;
            assert!(!late || !daemon.is_alive(), "{daemon:?} outlives its owner");
            daemon.is_alive() && !late
        });
    }

    /// Waits for everybody, ends the daemon, and looks for what is left.
    fn end(&mut self) {
        let mut waited = 0;
        let alive = |clients: &[Handle]| clients.iter().any(|client| client.is_alive());
        while alive(&self.clients) {
            sleep(Duration::from_millis(100));
            waited += 100;
            self.look_after_orphans();
            // a call whose memory cannot be made takes minutes
            let most = if self.plan.failing > 0 {
                20 * END_MAX
            } else {
                END_MAX
            };
            assert!(waited < most, "a client never ends");
        }
        self.facts.calm();
        sim_machine::calm();
        // nobody is stopped any more, shared memory has room, and the daemon has seen who is dead
        let calm = self.facts.calm_at().saturating_sub(now());
        sleep(Duration::from_nanos(calm) + self.facts.slow() + Duration::from_secs(1));
        let overwritten = sim_machine::overwritten();
        assert_eq!(
            overwritten, 0,
            "frames were overwritten that somebody holds"
        );
        self.last_client();
        self.end_hidden();
        let facts = self.facts.clone();
        self.in_a_process(move || {
            Actor::new(&facts).end();
            sweep(Some(&root())).expect("nothing is in the way");
        });
        if self.plan.failing > 0 || self.plan.preempting > 0 || !self.plan.fates.is_empty() {
            // a folder whose daemon was killed before it was marked goes when it is old, by a calendar that was not set back;
            // so does one that a slow client made anew, behind a daemon that has ended
            jump(1_000_000_000 * JUMPS_MAX);
            sleep(OLD);
            self.in_a_process(|| sweep(Some(&root())).expect("nothing is in the way"));
        }
        // who looks for daemons makes their folder
        let mut left = fs::list(Path::new("/dev/shm"));
        left.retain(|path| *path != root());
        let named = fs::list(&root());
        assert!(
            left.is_empty() && named.is_empty(),
            "left behind: {left:?} {named:?}"
        );
    }

    /// A daemon that lives serves the next client, and keeps nothing of those who went.
    fn last_client(&self) {
        let lives = || {
            let daemon = self.facts.server();
            daemon.filter(|_| self.plan.failing == 0)
        };
        let (before, commands) = (lives(), self.facts.commands());
        let facts = self.facts.clone();
        self.in_a_process(move || {
            let acts = [Act::Attach(5000), Act::Steps(3), Act::Observe(1)];
            Actor::new(&facts).play(&acts);
            if before.is_some() {
                Actor::new(&facts).play(&[Act::Attach(5000), Act::RecordAll]);
            }
        });
        sleep(CLEAN);
        if before.is_some() && before == lives() {
            assert_eq!(
                self.facts.commands(),
                commands + 3,
                "nobody can be in control any more"
            );
            let (first, last) = (self.facts.first_files(), kinds_of_files());
            // a client that was quick came before they were counted: it has a node, too
            if first.get("details") == Some(&1) {
                assert_eq!(last, first, "the daemon keeps what others left");
            }
        }
    }

    /// Ends the daemons that are found by no name any more.
    fn end_hidden(&self) {
        for daemon in self.facts.hidden() {
            self.facts.ask_daemon(daemon);
            signals::send(daemon.pid);
            sleep(Duration::from_nanos(ORPHAN_MAX));
            assert!(!daemon.is_alive(), "{daemon:?} hears no signal");
        }
    }

    fn in_a_process(&self, call: impl FnOnce() + Send + 'static) {
        let process = process::start(call);
        let mut waited = 0;
        while process.is_alive() {
            sleep(Duration::from_millis(10));
            waited += 10;
            assert!(waited < END_MAX, "it never ends");
        }
    }
}

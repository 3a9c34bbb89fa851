//! What happens in a run: what clients do, and what befalls them. A seed makes it; a failed run is tried again with less of it.

use fastrand::Rng;

/// What a client does next. Times are in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Attaches, and waits so long for a daemon.
    Attach(u64),
    /// Makes so many steps.
    Steps(u8),
    /// Sends a step, does nothing for a while, and takes its frame.
    SendRecv(u64),
    /// Keeps the last frame while more come, and looks at it again.
    Hold(u64),
    /// Other commands.
    Reset,
    Forward,
    /// Begins a step and lets the hook end the wait.
    Interrupt,
    /// Gives the lease back.
    Release,
    /// Looks at what observers see, so many times.
    Observe(u8),
    /// Waits for frames of others, so long.
    Newer(u64),
    /// Asks who controls, and how frames kept their pace.
    Ask,
    /// Counts observers.
    Count,
    /// Asks for something that the worlds cannot do.
    Refused,
    /// Lets the hook of a step give the lease back and end the wait.
    ReleaseInside,
    /// Lets another thread use the client so many times meanwhile, with steps alone or in all ways.
    Beside(u8, bool),
    /// Goes on with the other client of this process.
    Swap,
    /// Records so many entries.
    Record(u8),
    /// Takes every place of recorders at once, which are free.
    RecordAll,
    /// Takes the lease, and gives it back or not without a command.
    Take(bool),
    /// Asks for the lease until it has it, so long at most.
    Insist(u64),
    /// Its process is killed at the door that it passes after so many others.
    DieAtDoor(u64),
    /// The same right after so many changes that others can see.
    DieAtChange(u64),
    /// Does nothing.
    Rest(u64),
    /// Lets go of everything.
    Detach,
    /// Ends the daemon.
    Shutdown,
}

/// To whom something happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whom {
    /// A client, by its number.
    Client(usize),
    /// The client that has the lease.
    Holder,
    /// The daemon that runs.
    Daemon,
    /// The process that launched it.
    Owner,
}

/// What happens to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It is killed.
    Kill(Whom),
    /// It is killed at the door that it passes after so many others.
    KillAtDoor(Whom, u64),
    /// It is killed right after so many changes that others can see.
    KillAtChange(Whom, u64),
    /// It is stopped right after so many of them, for so many milliseconds.
    StopAtChange(Whom, u64, u64),
    /// Another client begins, which asks for the lease for so many milliseconds.
    Rival(u64),
    /// The same, and the client that has the lease is stopped for as long, at once or after so many changes.
    Overtake(u64, u64),
    /// Another process ends the daemon.
    End,
    /// The same, and the daemon is killed after so many changes of its end.
    EndDoomed(u64),
    /// It is stopped for so many milliseconds.
    Stop(Whom, u64),
    /// Another client begins, with the acts of this one.
    Again(usize),
    /// Another daemon begins, of an owner of its own.
    Launch,
    /// The same, and it is killed after so many changes.
    LaunchDoomed(u64),
    /// Somebody sends the daemon a signal.
    Signal,
    /// The folder of daemons is removed, as those of users are who log out; another daemon begins then, or not.
    Logout(bool),
    /// Another process ends the daemon, and so many microseconds later the next one begins.
    Replace(u64),
    /// The calendar jumps by so many seconds.
    Jump(i64),
    /// Shared memory has so much left, in kibibytes, for so many milliseconds.
    Squeeze(u64, u64),
}

/// A run.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Who goes on when.
    pub seed: u64,
    /// Of every client.
    pub clients: Vec<Vec<Act>>,
    /// With the time since the last one [ms].
    pub fates: Vec<(u64, Fate)>,
    /// Calls in a million that fail.
    pub failing: u32,
    /// Notifications in a million that are lost.
    pub dropping: u32,
    /// Doors in a million behind which a thread loses its core for a while.
    pub preempting: u32,
    /// How long at most, as a power of two [µs].
    pub longest: u32,
    /// How late sleepers wake, at most [µs].
    pub lateness: u64,
    /// How long a reset takes [ms].
    pub slow: u64,
}

impl Plan {
    /// The plan of a seed.
    pub fn from_seed(seed: u64) -> Plan {
        let rng = &mut Rng::with_seed(seed ^ 0x706c_616e);
        let clients = rng.usize(1..5);
        let fates = rng.usize(0..9);
        let mix = Mix::new(rng, ACTS.iter().map(|act| act.0));
        let befalls = Mix::new(rng, FATES.iter().map(|fate| fate.0));
        Plan {
            seed,
            clients: (0..clients).map(|_| acts(rng, &mix)).collect(),
            fates: (0..fates)
                .map(|_| (rng.u64(1..400), FATES[befalls.choose(rng)].1(rng, clients)))
                .collect(),
            failing: *rng.choice(&[0, 0, 0, 50, 500, 5000]).unwrap_or(&0),
            dropping: *rng.choice(&[0, 0, 10_000, 200_000]).unwrap_or(&0),
            preempting: *rng.choice(&[0, 0, 200, 3000, 10_000]).unwrap_or(&0),
            longest: *rng.choice(&[14, 14, 18]).unwrap_or(&14),
            lateness: *rng.choice(&[100, 1000, 20_000]).unwrap_or(&100),
            slow: match rng.u32(0..6) {
                0 => rng.u64(1..3000),
                1 => rng.u64(1500..6000),
                _ => 0,
            },
        }
    }

    /// The same run with a part less, for each part.
    pub fn smaller(&self) -> Vec<Plan> {
        let mut plans = Vec::new();
        let mut push = |change: &dyn Fn(&mut Plan)| {
            let mut plan = self.clone();
            change(&mut plan);
            plans.push(plan);
        };
        if self.failing > 0 {
            push(&|plan| plan.failing = 0);
        }
        if self.dropping > 0 {
            push(&|plan| plan.dropping = 0);
        }
        if self.preempting > 0 {
            push(&|plan| plan.preempting = 0);
        }
        if self.slow > 0 {
            push(&|plan| plan.slow = 0);
        }
        for index in 0..self.fates.len() {
            push(&|plan| {
                plan.fates.remove(index);
            });
        }
        for client in (0..self.clients.len()).rev() {
            // the last one alone, since fates count them
            if client + 1 == self.clients.len() && client > 0 {
                push(&|plan| {
                    plan.clients.remove(client);
                });
            }
            for act in 0..self.clients[client].len() {
                push(&|plan| {
                    plan.clients[client].remove(act);
                });
            }
        }
        plans
    }

    /// How much there is of it.
    pub fn size(&self) -> usize {
        let acts: usize = self.clients.iter().map(Vec::len).sum();
        self.fates.len() + acts
    }
}

/// How an act is drawn.
type Draw = fn(&mut Rng) -> Act;
/// The same of a fate, with the number of clients.
type DrawFate = fn(&mut Rng, usize) -> Fate;

/// What clients do, with its weight.
const ACTS: [(u32, Draw); 24] = [
    (30, |rng| Act::Steps(rng.u8(1..12))),
    (6, |rng| Act::SendRecv(rng.u64(0..30))),
    (6, |rng| Act::Hold(rng.u64(0..100))),
    (4, |_| Act::Reset),
    (4, |_| Act::Forward),
    (4, |_| Act::Interrupt),
    (8, |_| Act::Release),
    (6, |rng| Act::Observe(rng.u8(1..6))),
    (5, |rng| Act::Newer(rng.u64(1..200))),
    (4, |_| Act::Ask),
    (5, |rng| Act::Record(rng.u8(1..20))),
    (9, |rng| Act::Rest(rng.u64(0..300))),
    (3, |rng| Act::Rest(rng.u64(0..4000))),
    (4, |_| Act::Detach),
    (4, |rng| Act::Attach(rng.u64(0..2000))),
    (1, |_| Act::Shutdown),
    (2, |_| Act::Count),
    (3, |_| Act::Refused),
    (4, |_| Act::ReleaseInside),
    (9, |rng| Act::Beside(rng.u8(1..=120), rng.bool())),
    (7, |_| Act::Swap),
    (6, |rng| Act::Take(rng.bool())),
    (4, |rng| Act::Insist(rng.u64(0..6000))),
    (6, |rng| death(rng)),
];

/// What befalls processes, with its weight.
const FATES: [(u32, DrawFate); 17] = [
    (35, |rng, clients| Fate::Kill(whom(rng, clients))),
    (20, |rng, clients| {
        Fate::KillAtDoor(victim(rng, clients), doors(rng))
    }),
    (20, |rng, clients| {
        Fate::KillAtChange(victim(rng, clients), changes(rng))
    }),
    (25, |rng, clients| Fate::Stop(whom(rng, clients), stop(rng))),
    (15, |rng, clients| {
        Fate::StopAtChange(victim(rng, clients), changes(rng), stop(rng))
    }),
    (12, |rng, _| Fate::Rival(rng.u64(0..8000))),
    (8, |rng, _| {
        Fate::Overtake(rng.u64(0..10), rng.u64(1000..8000))
    }),
    (15, |rng, clients| Fate::Again(rng.usize(0..clients))),
    (12, |_, _| Fate::Launch),
    (4, |rng, _| Fate::LaunchDoomed(changes(rng))),
    (3, |_, _| Fate::Signal),
    (5, |rng, _| Fate::Jump(rng.i64(-100_000..100_000))),
    (10, |rng, _| {
        Fate::Squeeze(rng.u64(0..2000), rng.u64(1..1000))
    }),
    (5, |_, _| Fate::End),
    (4, |rng, _| Fate::EndDoomed(changes(rng))),
    (3, |rng, _| Fate::Logout(rng.bool())),
    (5, |rng, _| Fate::Replace(rng.u64(0..8000))),
];

/// How long processes are stopped [ms].
const STOPS: [u64; 5] = [10, 300, 1000, 2500, 6000];

/// A choice by weights. Each run has weights of its own: what a run leaves out does not end what it does often.
struct Mix(Vec<u32>);

impl Mix {
    fn new(rng: &mut Rng, weights: impl Iterator<Item = u32>) -> Mix {
        let mut vary = |weight: u32| weight * rng.choice(&[0, 1, 1, 4]).unwrap_or(&1);
        let mut weights: Vec<u32> = weights.map(&mut vary).collect();
        if weights.iter().all(|weight| *weight == 0) {
            weights.fill(1);
        }
        Mix(weights)
    }

    fn choose(&self, rng: &mut Rng) -> usize {
        let mut left = rng.u32(0..self.0.iter().sum());
        let fits = |weight: &u32| match left.checked_sub(*weight) {
            Some(rest) => {
                left = rest;
                false
            }
            None => true,
        };
        self.0.iter().position(fits).unwrap_or(0)
    }
}

fn acts(rng: &mut Rng, mix: &Mix) -> Vec<Act> {
    let mut acts = vec![Act::Rest(rng.u64(0..300))];
    if rng.u32(0..3) == 0 {
        acts.push(death(rng));
    }
    acts.push(Act::Attach(rng.u64(0..2000)));
    let count = rng.usize(1..12);
    acts.extend((0..count).map(|_| ACTS[mix.choose(rng)].1(rng)));
    acts
}

fn death(rng: &mut Rng) -> Act {
    match rng.bool() {
        true => Act::DieAtDoor(doors(rng)),
        false => Act::DieAtChange(changes(rng)),
    }
}

/// Doors from one file to the next, of one call, or of a longer life.
fn doors(rng: &mut Rng) -> u64 {
    let most = *rng.choice(&[40, 400, 1500, 6000]).unwrap_or(&40);
    rng.u64(1..=most)
}

/// Changes of one call, of an attach, or of a longer life.
fn changes(rng: &mut Rng) -> u64 {
    let most = *rng.choice(&[10, 60, 300]).unwrap_or(&10);
    rng.u64(1..=most)
}

fn stop(rng: &mut Rng) -> u64 {
    *rng.choice(&STOPS).unwrap_or(&10)
}

fn whom(rng: &mut Rng, clients: usize) -> Whom {
    match rng.u32(0..10) {
        0..4 => Whom::Client(rng.usize(0..clients)),
        4..6 => Whom::Holder,
        6..9 => Whom::Daemon,
        _ => Whom::Owner,
    }
}

/// An owner does nothing at whose doors it could die.
fn victim(rng: &mut Rng, clients: usize) -> Whom {
    match rng.u32(0..6) {
        0..2 => Whom::Daemon,
        2 => Whom::Holder,
        _ => Whom::Client(rng.usize(0..clients)),
    }
}

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
    /// Lets another thread use the client so many times meanwhile.
    Beside(u8),
    /// Goes on with the other client of this process.
    Swap,
    /// Records so many entries.
    Record(u8),
    /// Takes every place of recorders at once, which are free.
    RecordAll,
    /// Takes the lease, and gives it back or not without a command.
    Take(bool),
    /// Its process is killed at the door that it passes after so many others.
    DieAtDoor(u64),
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
    /// Another process ends the daemon.
    End,
    /// It is stopped for so many milliseconds.
    Stop(Whom, u64),
    /// Another client begins, with the acts of this one.
    Again(usize),
    /// Another daemon begins, of an owner of its own.
    Launch,
    /// Somebody sends the daemon a signal.
    Signal,
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
        Plan {
            seed,
            clients: (0..clients).map(|_| acts(rng)).collect(),
            fates: (0..fates)
                .map(|_| (rng.u64(1..400), fate(rng, clients)))
                .collect(),
            failing: *rng.choice(&[0, 0, 0, 50, 500, 5000]).unwrap_or(&0),
            dropping: *rng.choice(&[0, 0, 10_000, 200_000]).unwrap_or(&0),
            preempting: *rng.choice(&[0, 0, 200, 3000]).unwrap_or(&0),
            lateness: *rng.choice(&[100, 1000, 20_000]).unwrap_or(&100),
            slow: if rng.u32(0..3) == 0 {
                rng.u64(1..3000)
            } else {
                0
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

fn acts(rng: &mut Rng) -> Vec<Act> {
    let mut acts = vec![Act::Rest(rng.u64(0..300))];
    if rng.u32(0..3) == 0 {
        acts.push(Act::DieAtDoor(doors(rng)));
    }
    acts.push(Act::Attach(rng.u64(0..2000)));
    acts.extend((0..rng.usize(1..12)).map(|_| act(rng)));
    acts
}

/// Doors from one file to the next, of one call, or of a longer life.
fn doors(rng: &mut Rng) -> u64 {
    let most = *rng.choice(&[40, 400, 1500, 6000]).unwrap_or(&40);
    rng.u64(1..=most)
}

fn act(rng: &mut Rng) -> Act {
    match rng.u32(0..135) {
        0..30 => Act::Steps(rng.u8(1..12)),
        30..36 => Act::SendRecv(rng.u64(0..30)),
        36..42 => Act::Hold(rng.u64(0..100)),
        42..46 => Act::Reset,
        46..50 => Act::Forward,
        50..54 => Act::Interrupt,
        54..62 => Act::Release,
        62..68 => Act::Observe(rng.u8(1..6)),
        68..73 => Act::Newer(rng.u64(1..200)),
        73..77 => Act::Ask,
        77..82 => Act::Record(rng.u8(1..20)),
        82..91 => Act::Rest(rng.u64(0..300)),
        91..95 => Act::Detach,
        95..99 => Act::Attach(rng.u64(0..2000)),
        99..100 => Act::Shutdown,
        100..102 => Act::Count,
        102..105 => Act::Refused,
        105..109 => Act::ReleaseInside,
        109..118 => Act::Beside(rng.u8(1..=120)),
        118..125 => Act::Swap,
        125..131 => Act::Take(rng.bool()),
        _ => Act::DieAtDoor(doors(rng)),
    }
}

fn fate(rng: &mut Rng, clients: usize) -> Fate {
    let whom = match rng.u32(0..10) {
        0..6 => Whom::Client(rng.usize(0..clients)),
        6..9 => Whom::Daemon,
        _ => Whom::Owner,
    };
    match rng.u32(0..130) {
        100..125 if whom != Whom::Owner => Fate::KillAtDoor(whom, doors(rng)),
        100..125 => Fate::Kill(whom),
        125..130 => Fate::End,
        0..35 => Fate::Kill(whom),
        35..60 => Fate::Stop(
            whom,
            *rng.choice(&[10, 300, 1000, 2500, 6000]).unwrap_or(&10),
        ),
        60..75 => Fate::Again(rng.usize(0..clients)),
        75..87 => Fate::Launch,
        87..90 => Fate::Signal,
        90..95 => Fate::Jump(rng.i64(-100_000..100_000)),
        _ => Fate::Squeeze(rng.u64(0..2000), rng.u64(1..1000)),
    }
}

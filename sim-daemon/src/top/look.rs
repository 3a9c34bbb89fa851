//! What is asked of a daemon, once per interval.

use std::time::{Duration, Instant};

use sim_physics::arrays::status::FROZEN;
use sim_protocol::{AttachOptions, Client, Description, Hook, ProtocolError, Timing, keep_waiting};
use sim_system::process;

/// A daemon that is watched.
pub(super) struct Watched {
    name: String,
    groups: Vec<Client>,
    /// Frames of each group at the last look, and when that was.
    before: Vec<(u64, Instant)>,
    /// Frozen worlds and contacts of each group, as last seen.
    seen: Vec<Seen>,
}

/// What a frame for observers shows.
#[derive(Debug, Default, Clone, Copy)]
struct Seen {
    worlds: usize,
    frozen: usize,
    /// Contacts of these worlds, where frames carry their number.
    contacts: Option<f64>,
}

/// What a daemon did since the last look.
#[derive(Debug)]
pub(super) struct Look {
    pub(super) name: String,
    pub(super) device: String,
    pub(super) pid: u32,
    pub(super) age: Option<Duration>,
    pub(super) worlds: usize,
    pub(super) groups: usize,
    /// Control frames of all groups per second.
    pub(super) frames_per_s: f64,
    /// Physics steps of all worlds per second.
    pub(super) steps_per_s: f64,
    pub(super) controllers: Vec<u32>,
    pub(super) observers: usize,
    /// Worlds that observers see, and those of them that are frozen.
    pub(super) seen: usize,
    pub(super) frozen: usize,
    /// Contacts of a world, where frames carry their number.
    pub(super) contacts: Option<f64>,
    /// Memory of the process [bytes].
    pub(super) memory: Option<u64>,
    /// The part of it that is shared, where the system tells [bytes].
    pub(super) memory_shared: Option<u64>,
    /// Simulated seconds per second that frames keep to, if any.
    pub(super) realtime: Option<f64>,
    /// Of each group, since it started or somebody counted anew.
    pub(super) timing: Vec<Timing>,
}

impl Watched {
    pub(super) fn attach(name: &str) -> Result<Watched, ProtocolError> {
        let options = AttachOptions::default();
        let hook = &mut keep_waiting();
        let count = sim_protocol::find(name, &options, hook)?.groups;
        let names = match count {
            1 => vec![name.to_owned()],
            _ => (0..count).map(|group| format!("{name}.{group}")).collect(),
        };
        let mut groups = Vec::new();
        for name in &names {
            groups.push(Client::attach(name, &options, hook)?);
        }
        let mut watched = Watched {
            name: name.to_owned(),
            seen: vec![Seen::default(); groups.len()],
            before: Vec::new(),
            groups,
        };
        watched.look(&mut keep_waiting())?;
        Ok(watched)
    }

    fn description(&self) -> &Description {
        self.groups[0].description()
    }

    pub(super) fn look(&mut self, hook: Hook<'_>) -> Result<Look, ProtocolError> {
        let (mut controllers, mut observers, mut timing) = (Vec::new(), 0, Vec::new());
        let mut after = Vec::new();
        for (group, seen) in self.groups.iter().zip(&mut self.seen) {
            controllers.extend(group.controller(hook)?);
            observers += group.observers(hook)?;
            let told = group.timing(false, hook)?;
            after.push((told.frames, Instant::now()));
            timing.push(told);
            match group.latest(hook) {
                Ok(Some(frame)) => *seen = Seen::from_frame(&frame),
                // where the daemon has no room for another observer, the rest is known without it
                Ok(None) | Err(ProtocolError::TooManyClients { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        let pairs = after.iter().zip(&self.before);
        let rates = pairs.map(|((frames, now), (before, then))| {
            frames.saturating_sub(*before) as f64 / now.duration_since(*then).as_secs_f64()
        });
        let frames_per_s: f64 = rates.sum();
        self.before = after;
        let contacts: Option<f64> = self.seen.iter().map(|seen| seen.contacts).sum();
        let seen: usize = self.seen.iter().map(|seen| seen.worlds).sum();
        let description = self.description();
        Ok(Look {
            name: self.name.clone(),
            device: description.device.clone(),
            pid: description.pid,
            age: process::age(description.pid),
            worlds: description.worlds * self.groups.len(),
            groups: self.groups.len(),
            frames_per_s,
            steps_per_s: frames_per_s * (description.worlds * description.substeps) as f64,
            controllers,
            observers,
            seen,
            frozen: self.seen.iter().map(|seen| seen.frozen).sum(),
            contacts: contacts.map(|contacts| contacts / seen.max(1) as f64),
            memory: process::memory(description.pid),
            memory_shared: process::memory_shared(description.pid),
            realtime: description.pace.map(|pace| pace.realtime),
            timing,
        })
    }
}

impl Seen {
    fn from_frame(frame: &sim_protocol::Frame) -> Seen {
        let status = frame.field("status").ok();
        let status = status.as_ref().and_then(|view| view.as_slice::<u32>());
        let contacts = frame.field("contact_count").ok();
        let contacts = contacts.as_ref().and_then(|view| view.as_slice::<i32>());
        let is_frozen = |bits: &&u32| **bits & FROZEN != 0;
        Seen {
            worlds: status.map_or(0, <[u32]>::len),
            frozen: status.map_or(0, |status| status.iter().filter(is_frozen).count()),
            contacts: contacts.map(|counts| counts.iter().copied().map(f64::from).sum()),
        }
    }
}

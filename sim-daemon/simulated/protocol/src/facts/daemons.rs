//! Daemons that were launched.

use sim_machine::process::{self, Handle};
use sim_machine::time::now;

use super::{Facts, Known};

/// A daemon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Launched {
    owner: Handle,
    daemon: Handle,
    /// When it began [ns].
    at: u64,
}

impl Launched {
    /// Whether that is its process.
    pub(super) fn has_daemon(&self, pid: u32) -> bool {
        self.daemon.pid == pid
    }
}

impl Facts {
    /// Notes a daemon, its owner, and when it began [ns].
    pub fn launched(&self, owner: Handle, daemon: Handle, at: u64) {
        self.known(|known| known.launched.push(Launched { owner, daemon, at }));
    }

    /// The daemon launched last of those that live, or of all.
    pub fn daemon(&self) -> Option<Handle> {
        self.known(|known| known.last_launched().map(|launched| launched.daemon))
    }

    /// All that were launched.
    pub fn daemons(&self) -> Vec<Handle> {
        let daemons = |known: &mut Known| {
            known
                .launched
                .iter()
                .map(|launched| launched.daemon)
                .collect()
        };
        self.known(daemons)
    }

    /// Its owner.
    pub fn owner(&self) -> Option<Handle> {
        self.known(|known| known.last_launched().map(|launched| launched.owner))
    }

    /// The daemon that new clients find, and that nobody asked to end.
    pub fn server(&self) -> Option<Handle> {
        self.known(|known| {
            let mut runs = known.serving.iter();
            let serves = |(session, run): &(&u64, &(Handle, u64))| {
                !known.is_hidden(run.0) && run.0.is_alive() && !known.is_asked(**session, **run)
            };
            runs.find(serves).map(|(_, run)| run.0)
        })
    }

    /// Whether a daemon lived at some time since then.
    pub fn lived_since(&self, since: u64) -> bool {
        let lived = |daemon: &Handle| {
            daemon.is_alive() || process::dead_since(daemon.pid).is_none_or(|death| death >= since)
        };
        self.daemons().iter().any(lived)
    }

    /// The folder of daemons is removed.
    pub fn log_out(&self) {
        let now = now();
        self.known(|known| known.logged_out = now);
    }

    /// Daemons that live and that nobody finds any more.
    pub fn hidden(&self) -> Vec<Handle> {
        self.known(|known| {
            let runs = known.serving.values();
            let hidden = runs.filter(|run| known.is_hidden(run.0) && run.0.is_alive());
            hidden.map(|run| run.0).collect()
        })
    }
}

impl Known {
    /// Whether nobody finds a daemon: the folder with its name was removed.
    pub(super) fn is_hidden(&self, daemon: Handle) -> bool {
        let mut launched = self.launched.iter();
        launched.any(|launched| launched.daemon == daemon && launched.at <= self.logged_out)
    }

    /// Of those that live, or of all.
    fn last_launched(&self) -> Option<Launched> {
        let mut all = self.launched.iter().rev();
        let living = all.clone().find(|launched| launched.daemon.is_alive());
        living.or(all.next()).copied()
    }
}

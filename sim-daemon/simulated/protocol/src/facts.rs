//! What is known of a run from outside, and what must hold of it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use sim_machine::fs;
use sim_machine::process::Handle;
use sim_machine::time::now;

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

/// What is known, for all processes and outside of the machine.
#[derive(Debug, Clone, Default)]
pub struct Facts(Arc<Mutex<Known>>);

#[derive(Debug, Default)]
struct Known {
    /// What the worlds counted when they carried out a command.
    carried_out: BTreeMap<Id, u64>,
    /// The lease of each run whose commands were carried out last.
    lease: BTreeMap<u64, u64>,
    /// Times in which a process was stopped [ns]: begin and end.
    stopped: Vec<(u64, u64)>,
    daemon: Option<Handle>,
    owner: Option<Handle>,
    /// When something last happened that a wait may have to sit out [ns].
    squeezed: u64,
    commands: u64,
    /// Files of the last daemon before anybody came, by their kind.
    files: BTreeMap<String, usize>,
}

impl Facts {
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
    pub fn stop(&self, time: u64) {
        let now = now();
        self.known(|known| known.stopped.push((now, now + time)));
    }

    /// Shared memory is short, or calls fail.
    pub fn squeeze(&self, until: u64) {
        self.known(|known| known.squeezed = known.squeezed.max(until));
    }

    /// Whether it was since then.
    pub fn was_squeezed(&self, since: u64) -> bool {
        self.known(|known| known.squeezed >= since)
    }

    /// Time since then in which somebody was stopped [ns].
    pub fn stopped_since(&self, since: u64) -> u64 {
        let now = now();
        let overlap = |&(begin, end): &(u64, u64)| end.min(now).saturating_sub(begin.max(since));
        self.known(|known| known.stopped.iter().map(overlap).sum())
    }

    /// Notes the files of a daemon before anybody came.
    pub fn begins_with(&self, files: BTreeMap<String, usize>) {
        self.known(|known| known.files = files);
    }

    /// Those files.
    pub fn first_files(&self) -> BTreeMap<String, usize> {
        self.known(|known| known.files.clone())
    }

    /// Notes the daemon and its owner.
    pub fn launched(&self, owner: Handle, daemon: Handle) {
        self.known(|known| (known.owner, known.daemon) = (Some(owner), Some(daemon)));
    }

    /// The daemon launched last.
    pub fn daemon(&self) -> Option<Handle> {
        self.known(|known| known.daemon)
    }

    /// Its owner.
    pub fn owner(&self) -> Option<Handle> {
        self.known(|known| known.owner)
    }
}

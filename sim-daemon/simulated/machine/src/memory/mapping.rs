//! Mapped files: here all memory is there, unless a scenario says that somebody has cut it.

use std::sync::Weak;

use crate::world::{is_on, with};

/// The pages of a mapped file. The machine has none that a device could import.
#[derive(Debug)]
pub struct Pages(());

impl Pages {
    /// Whether these words lie in them as a whole.
    pub fn hold(&self, _words: &[u64]) -> bool {
        false
    }
}

/// Also says which files this thread has mapped meanwhile so that it may write to them.
pub fn noted<T>(make: impl FnOnce() -> T) -> (T, Vec<Weak<Pages>>) {
    (make(), Vec::new())
}

/// Whether bytes lie in one mapped file.
pub fn holds<T>(_values: &[T]) -> bool {
    true
}

/// The same for bytes that may not be there at all.
pub fn holds_bytes(_first: usize, _bytes: usize) -> bool {
    true
}

/// What a process has seen of files that were cut.
#[derive(Debug, Default)]
pub(crate) struct Damages {
    /// The process and the number of the run.
    seen: Vec<(u32, u64)>,
}

/// Another program has cut a file of a run (see [`super::storage::run_of`]), and the process `pid` has read behind its end. A
/// process that made the file notes it under the complement of the number too, as `is_own` says.
pub fn damage(pid: u32, owner: u64, is_own: bool) {
    with(|world| {
        let seen = &mut world.wires.damages.seen;
        seen.push((pid, owner));
        if is_own {
            seen.push((pid, !owner));
        }
    });
}

fn seen(matches: impl Fn(u64) -> bool) -> usize {
    if !is_on() {
        return 0;
    }
    with(|world| {
        let process = world.process();
        let seen = world.wires.damages.seen.iter();
        seen.filter(|(pid, owner)| *pid == process && matches(*owner))
            .count()
    })
}

/// Whether any mapped file was cut.
pub fn any_damaged() -> bool {
    seen(|_| true) > 0
}

/// Pages that were missing so far.
pub fn faults() -> usize {
    seen(|_| true)
}

/// Whether a file of `owner` that was made here was cut while it was mapped.
pub fn is_own_damaged(owner: u64) -> bool {
    is_damaged(!owner)
}

/// Whether a file of `owner` was cut while it was mapped.
pub fn is_damaged(owner: u64) -> bool {
    seen(|of| of == owner) > 0
}

//! The threads that work on parts of worlds. Sole user of rayon.

use std::sync::Arc;

use rayon::prelude::*;

/// Parts per thread: enough that one slow part does not leave the other threads idle.
pub const PARTS_PER_THREAD: usize = 4;

/// The threads of one group of worlds, or of all.
#[derive(Clone)]
pub struct Workers(Kind);

#[derive(Clone)]
enum Kind {
    /// The caller's thread.
    Caller,
    /// A pool for one group.
    Own(Arc<rayon::ThreadPool>),
    /// A pool for all groups: threads that one leaves idle work for another.
    Shared(Arc<rayon::ThreadPool>),
}

impl Workers {
    /// So many threads for so many groups, which get clones. One thread for one group is the caller's.
    ///
    /// # Errors
    /// Why the system starts no threads.
    pub fn new(threads: usize, groups: usize) -> Result<Workers, String> {
        if threads == 1 && groups == 1 {
            return Ok(Workers(Kind::Caller));
        }
        let builder = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("step-{i}"));
        let pool = Arc::new(builder.build().map_err(|error| error.to_string())?);
        Ok(Workers(match groups {
            1 => Kind::Own(pool),
            _ => Kind::Shared(pool),
        }))
    }

    /// Applies `work` to every part, on all threads. Allocates nothing, but for a few words per part where groups share threads.
    pub fn for_each<T: Send>(&self, parts: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
        match &self.0 {
            Kind::Caller => parts.iter_mut().for_each(work),
            Kind::Own(pool) => pool.install(|| parts.par_iter_mut().for_each(work)),
            // one job per part, in order of arrival: a thread that waits inside a job, as those of an iterator do, would start
            // another group's job and delay its own
            Kind::Shared(pool) => pool.in_place_scope(|scope| {
                let work = &work;
                for part in parts {
                    scope.spawn(move |_| work(part));
                }
            }),
        }
    }
}

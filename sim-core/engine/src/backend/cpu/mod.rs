//! The CPU: blocks of worlds, one world a SIMD lane, spread over threads. Sole user of rayon.
//!
//! A control frame is one pass per block with all substeps in cache; nothing is allocated in it, but where groups share their threads a
//! few words for each chunk.

mod chunk;
mod contacts;
mod delay;
mod dispatch;
mod noise;
mod records;
mod reset;
mod seats;
mod transfer;
mod trouble;

pub use dispatch::{available, create};

use super::state;
use super::{Backend, BackendError, Backends, Faults, Frozen, Groups, Lanes, Precision, Values};
use chunk::{Chunk, Job};
use dispatch::{Program, RunChunk};
use rayon::prelude::*;
use sim_physics::arrays::Array;
use sim_physics::arrays::{Field, Layout};
use sim_physics::lane::Lane;
use std::ops::Range;
use std::sync::Arc;

/// Chunks a thread: enough that a slow block does not leave the others idle.
pub(crate) const CHUNKS_PER_THREAD: usize = 4;

struct Cpu<F: Lane> {
    chunks: Vec<Chunk<F>>,
    job: Job<F>,
    workers: Workers,
    threads: usize,
    device: String,
    arena_words: usize,
    run: RunChunk<F>,
}

/// Who steps the chunks.
#[derive(Clone)]
enum Workers {
    /// The thread of the caller.
    Caller,
    /// A pool for one group.
    Own(Arc<rayon::ThreadPool>),
    /// A pool for all groups: what one leaves idle works for another.
    Shared(Arc<rayon::ThreadPool>),
}

impl Workers {
    fn new(threads: usize, groups: usize) -> Result<Workers, BackendError> {
        if threads == 1 && groups == 1 {
            return Ok(Workers::Caller);
        }
        let builder = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("step-{i}"));
        let failed = |e: rayon::ThreadPoolBuildError| BackendError::Threads {
            threads,
            reason: e.to_string(),
        };
        let pool = Arc::new(builder.build().map_err(failed)?);
        Ok(match groups {
            1 => Workers::Own(pool),
            _ => Workers::Shared(pool),
        })
    }
}

impl<F: Lane> Cpu<F> {
    fn new(
        job: Job<F>,
        worlds: usize,
        threads: usize,
        workers: Workers,
        program: &Program<F>,
    ) -> Self {
        let blocks = worlds.div_ceil(F::WIDTH);
        let parts = if threads == 1 {
            1
        } else {
            (threads * CHUNKS_PER_THREAD).min(blocks)
        };
        let chunks = (0..parts)
            .map(|part| {
                let first = part * blocks / parts * F::WIDTH;
                let end = ((part + 1) * blocks / parts * F::WIDTH).min(worlds);
                Chunk::new(&job, first..end)
            })
            .collect();
        let plural = if threads == 1 { "" } else { "s" };
        Cpu {
            arena_words: job.layout.bytes / 8,
            chunks,
            job,
            workers,
            threads,
            device: format!(
                "cpu ({}, {} world{} a block, {threads} thread{plural})",
                program.instructions,
                F::WIDTH,
                if F::WIDTH == 1 { "" } else { "s" },
            ),
            run: program.chunk,
        }
    }
}

impl<F: Lane> Cpu<F> {
    /// Does something with every chunk, on all threads.
    fn for_each(&mut self, work: impl Fn(&mut Chunk<F>, &Job<F>) + Send + Sync) {
        let job = &self.job;
        let work = |chunk: &mut Chunk<F>| work(chunk, job);
        match &self.workers {
            Workers::Caller => self.chunks.iter_mut().for_each(work),
            Workers::Own(pool) => pool.install(|| self.chunks.par_iter_mut().for_each(work)),
            // a job a chunk, in order of arrival: a thread that waits within a job, as those of an iterator do, would take up
            // another group's meanwhile, and hold up its own
            Workers::Shared(pool) => pool.in_place_scope(|scope| {
                let work = &work;
                for chunk in &mut self.chunks {
                    scope.spawn(move |_| work(chunk));
                }
            }),
        }
    }
}

impl<F: Lane> Backend for Cpu<F> {
    fn device(&self) -> &str {
        &self.device
    }

    fn threads(&self) -> usize {
        self.threads
    }

    fn set_faults(&mut self, faults: Faults) {
        self.job.faults = faults;
    }

    fn freeze_others(&mut self, good: &[bool]) {
        for chunk in &mut self.chunks {
            chunk.freeze_others(good);
        }
    }

    fn write(
        &mut self,
        field: Field,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) {
        for chunk in &mut self.chunks {
            chunk.write(&self.job, state::array_of(field), &columns, values, mask);
        }
    }

    fn write_params(&mut self, columns: Range<usize>, values: Values<'_>, mask: Option<&[bool]>) {
        for chunk in &mut self.chunks {
            chunk.write(&self.job, Array::Params, &columns, values, mask);
        }
    }

    fn params(&self, columns: Range<usize>, to: &mut [f64]) {
        for chunk in &self.chunks {
            chunk.params(&self.job, &columns, to);
        }
    }

    fn reset(&mut self, mask: Option<&[bool]>, seeds: Option<&[u64]>) {
        self.for_each(|chunk, job| chunk.reset(job, mask, seeds));
    }

    fn take_frozen(&mut self) -> Frozen {
        let mut all = Frozen::default();
        for chunk in &mut self.chunks {
            all.join(chunk.take_frozen());
        }
        // looked for only where there is something to tell
        if all.first.is_some() {
            all.now = self.chunks.iter().map(Chunk::frozen_now).sum();
        }
        all
    }

    fn numbers(&self) -> usize {
        self.job.numbers()
    }

    fn save(&self, records: &mut [u8]) {
        for chunk in &self.chunks {
            chunk.save(&self.job, records);
        }
    }

    fn restore(&mut self, records: &[u8], mask: Option<&[bool]>, from_world: Option<usize>) {
        for chunk in &mut self.chunks {
            chunk.restore(&self.job, records, mask, from_world);
        }
    }

    fn run(&mut self, substeps: usize, arena: &mut [u64]) {
        assert!(
            arena.len() >= self.arena_words,
            "the arena is smaller than the layout"
        );
        let arena = transfer::Arena::new(arena);
        let run = self.run;
        self.for_each(|chunk, job| {
            // SAFETY: `dispatch` chose `run` for instructions that this processor has; the arena holds
            // the layout (asserted) and outlives the call; each chunk writes its own worlds' rows only.
            unsafe { run(chunk, job, substeps, arena) }
        });
    }
}

//! The backend itself: chunks of worlds and the threads that step them.

use super::chunk::{Chunk, Job};
use super::transfer;
use crate::backend::{Backend, Faults, Frozen, Input, MachineCode, Profile, Values};
use crate::random::Episode;
use crate::workers::{PARTS_PER_THREAD, Workers};
use sim_physics::compiled::Stages;
use sim_physics::lane::Lane;
use std::ops::Range;

/// [`Chunk::run`], compiled for an instruction set.
///
/// # Safety
/// As [`Chunk::run`].
pub(super) type RunChunk<F> =
    unsafe fn(&mut Chunk<F>, &Job<F>, usize, transfer::Arena, Option<&mut Profile>);

/// The physics code, compiled for an instruction set.
pub(super) struct CompiledStages<F: Lane> {
    /// Name of the instruction set, for people.
    pub instructions: &'static str,
    pub stages: Stages<F>,
    pub chunk: RunChunk<F>,
}

/// The backend of one group of worlds.
pub(super) struct Cpu<F: Lane> {
    chunks: Vec<Chunk<F>>,
    job: Job<F>,
    workers: Workers,
    threads: usize,
    device: String,
    arena_words: usize,
    run: RunChunk<F>,
}

impl<F: Lane> Cpu<F> {
    pub fn new(
        job: Job<F>,
        worlds: usize,
        threads: usize,
        workers: Workers,
        (stages, note): (&CompiledStages<F>, &str),
    ) -> Self {
        let blocks = worlds.div_ceil(F::WIDTH);
        let parts = if threads == 1 {
            1
        } else {
            (threads * PARTS_PER_THREAD).min(blocks)
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
                "cpu ({}, {} world{} a block{note}, {threads} thread{plural})",
                stages.instructions,
                F::WIDTH,
                if F::WIDTH == 1 { "" } else { "s" },
            ),
            run: stages.chunk,
        }
    }
}

impl<F: Lane> Cpu<F> {
    /// Applies `work` to every chunk, on all threads.
    fn for_each(&mut self, work: impl Fn(&mut Chunk<F>, &Job<F>) + Send + Sync) {
        let job = &self.job;
        let work = |chunk: &mut Chunk<F>| work(chunk, job);
        self.workers.for_each(&mut self.chunks, work);
    }
}

impl<F: Lane> Backend for Cpu<F> {
    fn device(&self) -> &str {
        &self.device
    }

    fn threads(&self) -> usize {
        self.threads
    }

    fn compiled(&self) -> Option<[MachineCode; 2]> {
        Some(self.job.compiled.as_ref()?.sizes())
    }

    fn code_pieces(&self) -> Vec<(usize, usize, &'static str)> {
        let compiled = self.job.compiled.iter();
        compiled.flat_map(|step| step.pieces()).collect()
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
        input: Input,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) {
        let (group, columns) = input.place(&self.job.constants, columns);
        for chunk in &mut self.chunks {
            chunk.write(&self.job, group, &columns, values, mask);
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

    fn episodes(&self, to: &mut [Episode]) {
        for chunk in &self.chunks {
            chunk.episodes(&self.job, to);
        }
    }

    fn take_frozen(&mut self) -> Frozen {
        let mut all = Frozen::default();
        for chunk in &mut self.chunks {
            all.join(chunk.take_frozen());
        }
        // counted only if there is something to report
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
            unsafe { run(chunk, job, substeps, arena, None) }
        });
    }

    fn run_profiled(&mut self, substeps: usize, arena: &mut [u64], to: &mut Profile) -> bool {
        assert!(
            arena.len() >= self.arena_words,
            "the arena is smaller than the layout"
        );
        let arena = transfer::Arena::new(arena);
        for chunk in &mut self.chunks {
            // SAFETY: as in `run`.
            unsafe { (self.run)(chunk, &self.job, substeps, arena, Some(&mut *to)) }
        }
        true
    }
}

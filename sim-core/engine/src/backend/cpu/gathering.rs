//! Gathering: worlds of several blocks whose solve goes on, in a block of their own.
//!
//! A block iterates until its slowest world has arrived. So it pauses when few worlds are left. These move to lanes of a block
//! that is gathered from all blocks of a cluster; once its lanes are full it goes on, and pauses in turn. A world returns to its
//! own block when it has arrived. No value of a world depends on the lane and the neighbours that it has meanwhile.

use super::chunk::{Chunk, Job, Pauses};
use super::gathered::{Gathered, Guest, Guests, RETURNS, few, going_on};
use super::lane_move::{Move, clear_absent_rows};
use super::probe::Probe;
use super::run::run_on;
use crate::backend::Part;
use sim_physics::arrays::Pause;
use sim_physics::lane::Lane;

impl<F: Lane> Chunk<F> {
    /// Gathers the worlds of the block at work, `k` of its cluster, that the solver left when it paused. Its first `lanes` lanes
    /// have worlds.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    pub(super) unsafe fn gather(
        &mut self,
        job: &Job<F>,
        k: usize,
        lanes: usize,
        probe: &mut impl Probe<F>,
    ) {
        let Some(Pauses { resumes, .. }) = job.pauses else {
            return;
        };
        let goes_on = going_on::<F>(&job.constants, &self.block);
        let mut worlds = Guests::new();
        for lane in (0..lanes).filter(|lane| goes_on >> lane & 1 == 1) {
            worlds.push(lane, Guest { block: k, lane });
        }
        let mut worlds = worlds.all();
        while !worlds.is_empty() {
            let from = (&*self.block, &self.memory[..]);
            let gathering = self
                .gathering
                .as_mut()
                .expect("a block that pauses has one");
            let taken = gathering.fills.take(&job.constants, resumes, from, worlds);
            worlds = &worlds[taken..];
            probe.note_moves(taken);
            if gathering.fills.guests.len() == F::WIDTH {
                // SAFETY: by contract.
                unsafe { self.run_gathered(job, few(F::WIDTH), probe) };
            }
        }
        probe.after_part(Part::Gathering);
    }

    /// Ends the solve of all worlds that were gathered.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    pub(super) unsafe fn end_gathered(&mut self, job: &Job<F>, probe: &mut impl Probe<F>) {
        let gathering = self.gathering.as_ref();
        if gathering.is_some_and(|gathering| !gathering.fills.guests.is_empty()) {
            // SAFETY: by contract.
            unsafe { self.run_gathered(job, 0, probe) };
        }
    }

    /// Runs the block that fills until at most `few` of its worlds go on. These are the first of the next one.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    unsafe fn run_gathered(&mut self, job: &Job<F>, few: usize, probe: &mut impl Probe<F>) {
        let (Some(gathering), Some(pauses)) = (&mut self.gathering, &job.pauses) else {
            return;
        };
        let (solver, resumes) = (pauses.stage, pauses.resumes);
        std::mem::swap(&mut gathering.fills, &mut gathering.runs);
        let Gathered { space, guests } = &mut gathering.runs;
        space.block.pause = Pause {
            resumes: true,
            few,
            iterates: true,
            paused: false,
        };
        let lanes = guests.len();
        clear_absent_rows(&job.constants, &mut space.memory);
        probe.after_part(Part::Gathering);
        let at_work = (&mut *space.block, &mut space.memory[..]);
        // SAFETY: by contract.
        unsafe { run_on(job, at_work, lanes, solver, false, probe) };
        // worlds back to their own blocks; those that go on have other lanes next
        let goes_on = going_on::<F>(&job.constants, &space.block);
        for k in 0..self.spaces.len() {
            let arrived =
                |(lane, guest): &(usize, &Guest)| guest.block == k && goes_on >> lane & 1 == 0;
            let mut arrived = guests.iter().enumerate().filter(arrived).peekable();
            if arrived.peek().is_some() {
                let returns = Move::<F>::new(arrived.map(|(lane, guest)| (lane, guest.lane)));
                let to = match &mut self.spaces[k] {
                    Some(home) => &mut home.block,
                    None => &mut self.block,
                };
                returns.arrays(&space.block, to, &RETURNS);
            }
        }
        let mut worlds = Guests::new();
        for (lane, guest) in guests.iter().enumerate() {
            if goes_on >> lane & 1 == 1 {
                worlds.push(lane, *guest);
            }
        }
        if !worlds.all().is_empty() {
            let from = (&*space.block, &space.memory[..]);
            gathering
                .fills
                .take(&job.constants, resumes, from, worlds.all());
            probe.note_moves(worlds.all().len());
        }
        probe.after_part(Part::Gathering);
        gathering.runs.guests.clear();
    }
}

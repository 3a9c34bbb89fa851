//! A control frame of a chunk: all substeps of a cluster of blocks in cache, then its outputs.

use super::chunk::{Chunk, Job};
use super::compiled::Section;
use super::contacts;
use super::gathered::few;
use super::probe::{Moment, Probe, Watch};
use super::transfer::{self, Arena};
use crate::backend::{Part, Profile, clocks};
use sim_physics::arrays::{Block, Field, Pause, Slot, Source};
use sim_physics::lane::Lane;
use std::ops::Range;
use std::time::Instant;

/// Whether the field is a counter that a chunk keeps per world, outside of the state.
fn is_counter(field: Field) -> bool {
    field.row().source == Source::Counter
}

/// Runs a stage on a block and its memory of contacts. Its first `lanes` lanes have worlds.
///
/// # Safety
/// The processor has the instructions of the job's stages.
#[inline(always)]
pub(super) unsafe fn run_on<F: Lane>(
    job: &Job<F>,
    (block, memory): (&mut Block<F, F>, &mut [F]),
    lanes: usize,
    stage: usize,
    evaluates: bool,
    probe: &mut impl Probe<F>,
) {
    let constants = &job.constants;
    let mut moment = Moment {
        constants,
        block,
        memory,
        lanes,
        stage,
        evaluates,
    };
    probe.before(&mut moment);
    // SAFETY: by contract.
    unsafe { job.stages[stage](constants, moment.block, moment.memory) };
    probe.after(&mut moment);
}

impl<F: Lane> Chunk<F> {
    /// Runs all substeps of every block and writes its outputs.
    ///
    /// # Safety
    /// The processor has the instructions of `F`; the arena holds the job's layout.
    #[inline(always)]
    pub unsafe fn run(
        &mut self,
        job: &Job<F>,
        substeps: usize,
        arena: Arena,
        profile: Option<&mut Profile>,
    ) {
        // SAFETY: by contract.
        unsafe {
            match profile {
                None => self.run_watched(job, substeps, arena, &mut ()),
                Some(profile) => {
                    let begin = Instant::now();
                    let mut watch = Watch::new(profile, &job.constants);
                    self.run_watched(job, substeps, arena, &mut watch);
                    let own_ns = watch.own_ns;
                    profile.total_ns += begin.elapsed().as_nanos() as u64 - own_ns;
                    profile.world_steps += (substeps * self.worlds.len()) as u64;
                }
            }
        }
    }

    /// [`Chunk::run`], watched by a probe.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    unsafe fn run_watched(
        &mut self,
        job: &Job<F>,
        substeps: usize,
        arena: Arena,
        probe: &mut impl Probe<F>,
    ) {
        self.frames += u64::from(substeps > 0);
        let (blocks, cluster) = (self.worlds.len().div_ceil(F::WIDTH), self.spaces.len());
        for first in (0..blocks).step_by(cluster) {
            let cluster = first..(first + cluster).min(blocks);
            for (k, block) in cluster.clone().enumerate() {
                self.enter(k);
                self.load(self.state_of(job, block));
                if substeps > 0 {
                    self.draw_command_noise(job, block);
                }
                probe.after_part(Part::Load);
            }
            for pass in 0..substeps {
                let is_last = pass + 1 == substeps;
                // SAFETY: by contract.
                unsafe { self.step(job, cluster.clone(), is_last.then_some(arena), probe) };
            }
            for (k, block) in cluster.enumerate() {
                self.enter(k);
                // SAFETY: by contract.
                unsafe { self.evaluate(job, block, substeps, arena, probe) };
            }
        }
        for slot in job
            .layout
            .slots
            .iter()
            .filter(|slot| is_counter(slot.field))
        {
            // SAFETY: as above.
            unsafe { self.put_counter(job, slot, arena) };
        }
        probe.after_part(Part::Fields);
        if substeps > 0 {
            // after the fault was shown, before the commands of the next frame arrive
            if job.faults.resets {
                self.reset_frozen(job);
            }
            self.regroup(job);
            probe.after_part(Part::Grouping);
        }
    }

    /// Where the state of a block is.
    #[inline(always)]
    fn state_of(&self, job: &Job<F>, block: usize) -> Range<usize> {
        let stride = job.shape.total() * F::WIDTH;
        block * stride..(block + 1) * stride
    }

    /// Runs a substep of a cluster of blocks: stages that are compiled as machine code, unless they are watched or evaluated. Of the
    /// last one it writes the fields that belong to it to the arena.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    unsafe fn step<P: Probe<F>>(
        &mut self,
        job: &Job<F>,
        blocks: Range<usize>,
        last: Option<Arena>,
        probe: &mut P,
    ) {
        let shows = last.is_some() && job.evaluate_last.is_some();
        let compiled = match P::WATCHES || shows {
            true => None,
            false => job.compiled.as_deref(),
        };
        if shows {
            for k in 0..blocks.len() {
                self.enter(k);
                self.make_zeros_positive();
            }
        }
        let stages = &job.step;
        let solver = job.pauses.filter(|_| self.gathering.is_some());
        let mut begin = 0;
        while begin < stages.len() {
            // up to the stage that may pause, all blocks of the cluster
            let pauses = |stage: &usize| solver.is_some_and(|solver| solver.stage == *stage);
            let end = match stages[begin..].iter().position(pauses) {
                Some(place) => begin + place + 1,
                None => stages.len(),
            };
            for (k, block) in blocks.clone().enumerate() {
                self.enter(k);
                let mut place = begin;
                while place < end {
                    if let Some((number, section)) =
                        compiled.and_then(|step| step.section_at(place))
                    {
                        // SAFETY: by contract; it was compiled for registers of `F` and the model of the job.
                        unsafe { self.run_section(number, section, block) };
                        place += section.stages();
                        continue;
                    }
                    let stage = stages[place];
                    place += 1;
                    // the last stage goes to the next state
                    if let (Some(arena), true) = (last, place == stages.len()) {
                        // SAFETY: by contract.
                        unsafe { self.evaluate_last(job, block, arena, probe) };
                    }
                    if pauses(&stage) {
                        self.block.pause.few = few(F::WIDTH);
                    }
                    // SAFETY: by contract.
                    unsafe { self.run_stage(job, block, stage, false, probe) };
                }
                if self.block.pause.paused {
                    // SAFETY: by contract.
                    unsafe { self.gather(job, k, self.lanes_of(block).len(), probe) };
                }
            }
            // SAFETY: by contract.
            unsafe { self.end_gathered(job, probe) };
            for (k, block) in blocks.clone().enumerate() {
                self.enter(k);
                let paused = std::mem::take(&mut self.block.pause).paused;
                if let (Some(solver), true) = (solver, paused) {
                    self.block.pause.resumes = true;
                    // SAFETY: by contract.
                    unsafe { self.run_stage(job, block, solver.stage, false, probe) };
                    self.block.pause = Pause::default();
                }
            }
            begin = end;
        }
    }

    /// Ends a control frame of the block at work: its faults, its state, and what the frame shows of it.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    unsafe fn evaluate(
        &mut self,
        job: &Job<F>,
        block: usize,
        substeps: usize,
        arena: Arena,
        probe: &mut impl Probe<F>,
    ) {
        let state = self.state_of(job, block);
        if substeps > 0 {
            self.make_zeros_positive();
            self.note_faults(job, block, state.clone());
            self.age_commands(job, block, state.clone());
            // outputs are a function of the state: the noise of the next frame is not drawn yet
            self.block.command_noise.fill(F::c(0.0));
        }
        // before the evaluation, which changes the warm start: reading outputs must not change the run
        self.store(job.shape, state);
        probe.after_part(Part::Store);
        let stages = if substeps > 0 {
            &job.evaluate_now
        } else {
            &job.evaluate
        };
        for &stage in stages {
            // SAFETY: by contract.
            unsafe { self.run_stage(job, block, stage, true, probe) };
        }
        if substeps > 0 || job.finds_contacts {
            self.count_left_out(block);
        }
        if substeps > 0 {
            self.note_contacts(&job.constants, block);
        }
        probe.after_part(Part::Grouping);
        let lags = substeps > 0 && job.evaluate_last.is_some();
        // SAFETY: the arena holds the layout.
        unsafe { self.put_fields(job, block, arena, 0.0, |field| !(lags && field.lags())) };
        probe.after_part(Part::Fields);
    }

    /// Runs the stages of a compiled section, by its number.
    ///
    /// # Safety
    /// The processor has the instructions of the section, which is of the job's model.
    #[inline(always)]
    unsafe fn run_section(&mut self, number: usize, section: &Section, block: usize) {
        let at_work = (&mut *self.block, &mut self.memory[..]);
        let wary = &mut self.wary[number][block];
        // SAFETY: by contract.
        unsafe { section.run(at_work, &mut self.compiled_scratch, wary) };
    }

    /// Runs a stage.
    ///
    /// # Safety
    /// The processor has the instructions of the job's stages.
    #[inline(always)]
    unsafe fn run_stage(
        &mut self,
        job: &Job<F>,
        block: usize,
        stage: usize,
        evaluates: bool,
        probe: &mut impl Probe<F>,
    ) {
        let lanes = self.lanes_of(block).len();
        let at_work = (&mut *self.block, &mut self.memory[..]);
        // SAFETY: by contract.
        unsafe { run_on(job, at_work, lanes, stage, evaluates, probe) };
    }

    /// Evaluates and writes the fields that belong to the last substep, before its last stage goes to the next state.
    ///
    /// # Safety
    /// As [`Chunk::run`].
    #[inline(always)]
    unsafe fn evaluate_last(
        &mut self,
        job: &Job<F>,
        block: usize,
        arena: Arena,
        probe: &mut impl Probe<F>,
    ) {
        let Some(stages) = &job.evaluate_last else {
            return;
        };
        // the solver's result is its next start too, which outputs must not change
        self.kept.copy_from_slice(&self.block.joint_qdd);
        // SAFETY: by contract.
        unsafe {
            for &stage in stages {
                self.run_stage(job, block, stage, true, probe);
            }
            // the frame is not counted yet, and its last substep has not passed
            self.put_fields(job, block, arena, job.frame_s - job.dt, Field::lags);
        }
        probe.after_part(Part::Fields);
        self.block.joint_qdd.copy_from_slice(&self.kept);
    }

    /// Writes those fields of a block that are no counters; `passed_s` is the time since the last frame that was counted.
    ///
    /// # Safety
    /// The arena holds the job's layout.
    #[inline(always)]
    unsafe fn put_fields(
        &mut self,
        job: &Job<F>,
        block: usize,
        arena: Arena,
        passed_s: f64,
        is_due: impl Fn(Field) -> bool,
    ) {
        let slots = job.layout.slots.iter();
        for slot in slots.filter(|slot| !is_counter(slot.field) && is_due(slot.field)) {
            // SAFETY: the arena holds the layout, and these worlds are this chunk's alone.
            unsafe {
                if let Source::Contacts(_) = slot.field.row().source {
                    contacts::export(self, job, slot, block, arena);
                } else {
                    transfer::export(self, &job.constants, slot, block, arena);
                }
                if slot.field == Field::Sensordata {
                    for lane in self.lanes_of(block) {
                        let world = self.assignment.world(lane);
                        let row = arena.row(slot, self.worlds.start + world);
                        let time = self.steps[world] as f64 * job.frame_s + passed_s;
                        clocks::put(&job.constants, time, row);
                    }
                }
                if let Some(noise) = job.noise.for_field(slot.field) {
                    for lane in self.lanes_of(block) {
                        let world = self.assignment.world(lane);
                        let row = arena.row(slot, self.worlds.start + world);
                        self.add_noise(job, noise, world, row);
                    }
                }
            }
        }
    }

    /// Writes a counter of every world.
    ///
    /// # Safety
    /// The arena holds the slot.
    unsafe fn put_counter(&self, job: &Job<F>, slot: &Slot, arena: Arena) {
        let (first, all) = (self.worlds.start, self.worlds.clone());
        // SAFETY: these worlds are this chunk's alone; the rest by contract.
        unsafe {
            match slot.field {
                Field::Time => arena.put(slot, all, |w| self.steps[w - first] as f64 * job.frame_s),
                Field::Step => arena.put(slot, all, |w| self.steps[w - first]),
                Field::Status => arena.put(slot, all, |w| self.status[w - first]),
                _ => arena.put(slot, all, |w| self.left_out[w - first]),
            }
        }
    }
}

//! A chunk: blocks of worlds that one thread works on, with their state in lane order and a workspace for each block of a cluster.

use super::compiled::CompiledStep;
use super::contact_kinds::ContactKinds;
use super::gathered::{Gathering, cluster_size};
use super::lane_assignment::LaneAssignment;
use super::space::Space;
use crate::backend::noise::Noise;
use crate::backend::state::{self, RECORD, Shape};
use crate::backend::{Faults, Frozen, OutputsAt, Values};
use crate::random::Numbering;
use crate::start::StartDraw;
use sim_model::{Model, SensedShapes};
use sim_physics::arrays::{Array, Block, Flat, Layout};
use sim_physics::compiled::Stages;
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use sim_physics::schedule::{evaluation_stages, step_stages};
use sim_physics::step::{Runs, StageId};
use std::ops::Range;
use std::sync::Arc;

/// A stage that may pause.
#[derive(Clone, Copy)]
pub(super) struct Pauses {
    /// Its place.
    pub stage: usize,
    /// The arrays from which it resumes.
    pub resumes: &'static [Array],
}

/// Data that all chunks share.
pub(super) struct Job<F: Lane> {
    pub constants: Constants<F::Real>,
    /// Every stage, by [`StageId::index`].
    pub stages: Stages<F>,
    /// How the scalars of a world lie.
    pub shape: Shape,
    pub layout: Layout,
    /// Stages of a step that the model needs, by their places.
    pub step: Vec<usize>,
    /// What of the substep is machine code, where the model is compiled.
    pub compiled: Option<Arc<CompiledStep>>,
    /// Stages that evaluate the fields of the layout.
    pub evaluate: Vec<usize>,
    /// Stages that evaluate fields of the state in the frame after a step.
    pub evaluate_now: Vec<usize>,
    /// Stages that evaluate the other ones before the last stage of a step; none where all belong to the state in the frame.
    pub evaluate_last: Option<Vec<usize>>,
    /// The stage that may pause, where there is one.
    pub pauses: Option<Pauses>,
    /// Whether they detect contacts.
    pub finds_contacts: bool,
    /// Duration of a control frame [s].
    pub frame_s: f64,
    /// Duration of a substep [s].
    pub dt: f64,
    /// Bounds of faults.
    pub faults: Faults,
    /// State and commands of a world after a reset, in the order of [`RECORD`].
    pub start: Vec<F::Real>,
    /// Random part of the start.
    pub draw: StartDraw,
    /// World numbers in draws.
    pub numbering: Numbering,
    /// Noise of commands and sensors.
    pub noise: Noise,
    /// Shapes of the contact sensors.
    pub contact_sensors: Vec<SensedShapes>,
}

impl<F: Lane> Job<F> {
    pub fn new(
        model: &Model,
        (layout, outputs_at): (Layout, OutputsAt),
        stages: Stages<F>,
        compiled: Option<Arc<CompiledStep>>,
        numbering: Numbering,
    ) -> Job<F> {
        let constants = model.constants().cast();
        let places = |stages: &[StageId]| -> Vec<usize> {
            stages.iter().map(|stage| stage.index()).collect()
        };
        let fields = || layout.slots.iter().map(|slot| slot.field);
        let evaluation = evaluation_stages(&constants, fields());
        let lags = outputs_at == OutputsAt::LastSubstep;
        let now = fields().filter(|field| !lags || !field.lags());
        let evaluate_now = places(&evaluation_stages(&constants, now));
        let evaluate_last = lags.then(|| {
            // what a step runs as well has run already
            let stages = evaluation.iter().copied();
            let stages = stages.filter(|stage| stage.row().runs == Runs::Evaluation);
            places(&stages.collect::<Vec<_>>())
        });
        let step = step_stages(&constants);
        let pauses = step.iter().find(|stage| !stage.resumes().is_empty());
        let pauses = pauses.filter(|_| F::WIDTH > 1);
        Job {
            shape: Shape::from_constants(&constants),
            pauses: pauses.map(|stage| Pauses {
                stage: stage.index(),
                resumes: stage.resumes(),
            }),
            step: places(&step),
            compiled,
            evaluate: places(&evaluation),
            evaluate_now,
            evaluate_last,
            finds_contacts: state::finds_contacts(&evaluation),
            constants,
            stages,
            layout,
            frame_s: model.substeps() as f64 * model.dt(),
            dt: model.dt(),
            faults: Faults::default(),
            start: state::start(model),
            draw: StartDraw::new(model),
            numbering,
            noise: Noise::new(model),
            contact_sensors: model.contact_sensors().to_vec(),
        }
    }
}

pub(super) struct Chunk<F: Lane> {
    pub(super) worlds: Range<usize>,
    /// `(blocks, numbers of a world, WIDTH)`
    pub(super) state: Vec<F::Real>,
    /// The lane of each world.
    pub(super) assignment: LaneAssignment,
    /// What makes worlds share a block.
    pub(super) kinds: ContactKinds,
    /// Control frames since the reset of each world; a frozen world does not count.
    pub(super) steps: Vec<u64>,
    pub(super) status: Vec<u32>,
    /// Most contacts that did not fit in a substep of the last frame, or in the evaluated state.
    pub(super) left_out: Vec<u32>,
    /// Seeds of what is drawn for each world.
    pub(super) seeds: Vec<u64>,
    /// Resets of each world since it got its seed.
    pub(super) episodes: Vec<u32>,
    /// Control frames so far.
    pub(super) frames: u64,
    /// Worlds that were frozen since the last report.
    pub(super) frozen: Frozen,
    /// The block at work.
    pub block: Box<Block<F, F>>,
    /// Its scratch memory of the execution context.
    pub memory: Vec<F>,
    /// Spaces of a cluster of blocks; none in the place of the one at work.
    pub(super) spaces: Vec<Option<Space<F>>>,
    /// The place of the block at work in its cluster.
    pub(super) at_work: usize,
    /// For how many substeps each block assumes nothing, by section of the compiled substep: see [`super::compiled::Section::run`].
    pub(super) wary: Vec<Vec<u8>>,
    /// Memory of the compiled sections.
    pub(super) compiled_scratch: Vec<F>,
    /// Blocks of worlds from the cluster; none where blocks are by themselves.
    pub(super) gathering: Option<Gathering<F>>,
    /// Scratch: what an evaluation amid a step must leave as it was.
    pub(super) kept: Vec<F>,
    /// Scratch: one field of one block.
    pub staging: Vec<F>,
    /// Scratch: the same, per element.
    pub lanes: Vec<F::Real>,
    /// Scratch: the same, per world.
    pub rows: Vec<F::Real>,
}

impl<F: Lane> Chunk<F> {
    pub fn new(job: &Job<F>, worlds: Range<usize>) -> Self {
        let blocks = worlds.len().div_ceil(F::WIDTH);
        let elements = job
            .layout
            .slots
            .iter()
            .map(|slot| slot.shape[1..].iter().product());
        let elements: usize = elements.max().unwrap_or(1);
        let cluster =
            (job.pauses).map_or(1, |_| cluster_size(&job.constants, blocks, size_of::<F>()));
        let Space { block, memory } = Space::new(&job.constants);
        let mut spaces = vec![None];
        spaces.extend((1..cluster).map(|_| Some(Space::new(&job.constants))));
        let compiled = job.compiled.as_deref();
        let mut chunk = Chunk {
            state: vec![F::Real::default(); blocks * job.shape.total() * F::WIDTH],
            steps: vec![0; worlds.len()],
            status: vec![0; worlds.len()],
            left_out: vec![0; worlds.len()],
            seeds: vec![0; worlds.len()],
            episodes: vec![0; worlds.len()],
            frames: 0,
            frozen: Frozen::default(),
            block,
            memory,
            spaces,
            at_work: 0,
            wary: vec![vec![0; blocks]; compiled.map_or(0, |step| step.sections())],
            compiled_scratch: vec![F::default(); compiled.map_or(0, |step| step.scratch())],
            gathering: (cluster > 1).then(|| Gathering::new(&job.constants)),
            kept: vec![F::default(); job.constants.dofs.len()],
            staging: vec![F::default(); elements],
            lanes: vec![F::Real::default(); elements * F::WIDTH],
            rows: vec![F::Real::default(); elements * F::WIDTH],
            assignment: LaneAssignment::new(worlds.len(), blocks * F::WIDTH),
            kinds: ContactKinds::new(job.constants.contacts.classes.len()),
            worlds,
        };
        chunk.start(job);
        chunk
    }

    /// Index in `state` of a value of a world, which is counted from the chunk's first.
    pub(super) fn place(&self, shape: Shape, world: usize, field: Array, k: usize) -> usize {
        let lane = self.assignment.lane(world);
        let (block, lane) = (lane / F::WIDTH, lane % F::WIDTH);
        (block * shape.total() + shape.start(field) + k) * F::WIDTH + lane
    }

    pub fn write(
        &mut self,
        job: &Job<F>,
        target: Array,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) {
        // of a robot without joints; its place may lie past the end
        if columns.is_empty() {
            return;
        }
        let shape = job.shape;
        let writes_state = state::is_motion(&target);
        for world in 0..self.worlds.len() {
            let outside = self.worlds.start + world;
            if mask.is_some_and(|mask| !mask[outside]) {
                continue;
            }
            let row = outside * columns.len();
            let first = self.place(shape, world, target, columns.start);
            let cells = self.state[first..].iter_mut().step_by(F::WIDTH);
            match values {
                Values::F32(v) => {
                    for (cell, x) in cells.zip(&v[row..row + columns.len()]) {
                        *cell = F::Real::from_f64(f64::from(*x));
                    }
                }
                Values::F64(v) => {
                    for (cell, x) in cells.zip(&v[row..row + columns.len()]) {
                        *cell = F::Real::from_f64(*x);
                    }
                }
            }
            if writes_state {
                for dof in 0..shape.dofs {
                    let place = self.place(shape, world, Array::JointQdd, dof);
                    self.state[place] = F::Real::default();
                }
            }
            if matches!(target, Array::JointQ) {
                for coord in columns.clone() {
                    let place = self.place(shape, world, Array::JointQRest, coord);
                    self.state[place] = F::Real::default();
                }
                self.normalize(job, world, columns);
            }
        }
    }

    /// Columns of the parameters of every world, as the backend's.
    pub fn params(&self, job: &Job<F>, columns: &Range<usize>, to: &mut [f64]) {
        let shape = job.shape;
        for world in 0..self.worlds.len() {
            let row = (self.worlds.start + world) * columns.len();
            for (k, column) in columns.clone().enumerate() {
                let place = self.place(shape, world, Array::Params, column);
                to[row + k] = self.state[place].to_f64();
            }
        }
    }

    /// Makes the quaternions of a world in these columns unit.
    fn normalize(&mut self, job: &Job<F>, world: usize, columns: &Range<usize>) {
        let shape = job.shape;
        let written = job.constants.quaternions();
        for first in written.filter(|first| columns.contains(first)) {
            let place = self.place(shape, world, Array::JointQ, first);
            let at = |i: usize| place + i * F::WIDTH;
            let square: f64 = (0..4).map(|i| self.state[at(i)].to_f64().powi(2)).sum();
            // a quaternion of length 1, up to rounding, keeps its bits
            if (square - 1.0).abs() > 4.0 * F::Real::EPSILON {
                for i in 0..4 {
                    self.state[at(i)] =
                        F::Real::from_f64(self.state[at(i)].to_f64() / square.sqrt());
                }
            }
        }
    }

    /// Goes to work in a space of the cluster.
    #[inline(always)]
    pub(super) fn enter(&mut self, k: usize) {
        if self.at_work == k {
            return;
        }
        let next = self.spaces[k].take().expect("a space that is not at work");
        let last = Space {
            block: std::mem::replace(&mut self.block, next.block),
            memory: std::mem::replace(&mut self.memory, next.memory),
        };
        self.spaces[self.at_work] = Some(last);
        self.at_work = k;
    }

    /// The lanes of a block that hold a world.
    #[inline(always)]
    pub(super) fn lanes_of(&self, block: usize) -> Range<usize> {
        let first = block * F::WIDTH;
        first..(first + F::WIDTH).min(self.worlds.len())
    }

    /// State and commands of a block into its workspace.
    #[inline(always)]
    pub(super) fn load(&mut self, state: Range<usize>) {
        let b = &mut self.block;
        let mut from = self.state[state].chunks_exact(F::WIDTH);
        for array in RECORD {
            let (Flat::Cells(x) | Flat::Values(x)) = b.array_mut(array);
            for x in x {
                *x = F::load(from.next().expect("a register for every number"));
            }
        }
        b.unconverged[0] = F::c(0.0);
        b.left_out[0] = F::c(0.0);
        b.substep[0] = F::c(0.0);
        b.command_noise.fill(F::c(0.0));
    }

    /// Makes each zero in the state of the block at work positive: stages and machine code may differ in its sign, and in no
    /// other number.
    #[inline(always)]
    pub(super) fn make_zeros_positive(&mut self) {
        for array in RECORD.into_iter().filter(state::is_motion) {
            let (Flat::Cells(x) | Flat::Values(x)) = self.block.array_mut(array);
            for x in x {
                // -0 + 0 is 0
                *x = *x + F::c(0.0);
            }
        }
    }

    /// The state of a block out of its workspace; commands did not change.
    #[inline(always)]
    pub(super) fn store(&mut self, shape: Shape, range: Range<usize>) {
        for array in RECORD.into_iter().filter(state::is_motion) {
            let first = range.start + shape.start(array) * F::WIDTH;
            let to = self.state[first..].chunks_exact_mut(F::WIDTH);
            let (Flat::Cells(x) | Flat::Values(x)) = self.block.array(array);
            for (x, to) in x.iter().zip(to) {
                x.store(to);
            }
        }
    }
}

//! The stages on the backend that records.
//!
//! Its instance of the physics is a hundred thousand calls, which no optimisation makes faster in a way that matters: a
//! recording takes milliseconds. See the profile in `Cargo.toml`.

use sim_physics::arrays::{Array, Block, Flat, Writer};
use sim_physics::constants::Constants;
use sim_physics::every_stage;
use sim_physics::lane::{Cx, Num};
use sim_physics::step::{Stage, StageId};
use sim_record::{RecordError, Recorded, RecordedVariable, Recorder, Recording, record};
use std::ops::Range;

/// A block of the backend that records.
pub type RecordedWorlds = Block<Recorded, RecordedVariable>;

/// Records a stage.
pub fn run(stage: StageId, cx: &mut Recorder, m: &Constants<f32>, block: &mut RecordedWorlds) {
    static STAGES: [RunStage; StageId::COUNT] = every_stage!(stage_functions(recorded));
    cx.begin_part(stage.name());
    STAGES[stage.index()](cx, m, block);
}

type RunStage = fn(&mut Recorder, &Constants<f32>, &mut RecordedWorlds);

fn recorded<S: Stage>(cx: &mut Recorder, m: &Constants<f32>, block: &mut RecordedWorlds) {
    S::run(cx, m, block);
}

/// Recorded stages of a substep that follow each other, with the arrays of their inputs and of their outputs, in order.
pub struct StageRun {
    /// All of them.
    pub recording: Recording,
    /// What its inputs are.
    pub reads: Vec<Array>,
    /// What its outputs are: what outlasts the substep, and what other stages read before they write it.
    pub writes: Vec<Array>,
}

impl StageRun {
    /// Records the stages in `run`, places among all those of a substep; on assumptions, see [`Recorder::assume_nowhere`].
    ///
    /// # Errors
    /// As [`record`].
    pub fn record(
        m: &Constants<f32>,
        substep: &[StageId],
        run: Range<usize>,
        assumes: bool,
    ) -> Result<StageRun, RecordError> {
        let stages = &substep[run.clone()];
        let kept = kept();
        let (reads, mut writes) = effects(stages);
        // in the order in which they follow, into the next substep
        let others = [&substep[run.end..], &substep[..run.start]].concat();
        writes.retain(|array| kept.contains(array) || is_read_first(*array, &others));
        let recording = between(m, &reads, &writes, |cx, block| {
            if assumes {
                cx.assume_nowhere();
            }
            for stage in stages {
                self::run(*stage, cx, m, block);
            }
            Vec::new()
        })?;
        Ok(StageRun {
            recording,
            reads,
            writes,
        })
    }
}

/// Do stages read an array before one writes all of it?
fn is_read_first(array: Array, stages: &[StageId]) -> bool {
    let meets = |stage: &&StageId| {
        let mut arrays = stage.reads().iter().chain(stage.writes());
        arrays.any(|other| *other == array)
    };
    let first = stages.iter().find(meets);
    first.is_some_and(|stage| stage.reads().contains(&array))
}

/// What outlasts a substep.
pub fn kept() -> Vec<Array> {
    let kept = |array: &Array| matches!(array.writer(), Writer::Motion | Writer::Counter);
    Array::ALL.iter().copied().filter(kept).collect()
}

/// What a run of stages reads from before it, and what it writes.
pub fn effects(stages: &[StageId]) -> (Vec<Array>, Vec<Array>) {
    let (mut reads, mut writes) = (Vec::new(), Vec::new());
    for stage in stages {
        for array in stage.row().reads {
            if !writes.contains(array) && !reads.contains(array) {
                reads.push(*array);
            }
        }
        for array in stage.row().writes {
            if !writes.contains(array) {
                writes.push(*array);
            }
        }
    }
    (reads, writes)
}

/// The recording of `code` between two sets of arrays: its inputs are the scalars of `reads`, in order, its outputs those of
/// `writes`, then what `code` returns.
///
/// # Errors
/// As [`record`].
pub fn between(
    m: &Constants<f32>,
    reads: &[Array],
    writes: &[Array],
    code: impl FnOnce(&mut Recorder, &mut RecordedWorlds) -> Vec<Recorded>,
) -> Result<Recording, RecordError> {
    let inputs = reads.iter().map(|array| array.scalars(m)).sum();
    record(inputs, |cx, x| {
        let mut block = given(cx, m, reads, x);
        let more = code(cx, &mut block);
        let mut results = results(cx, &block, writes);
        results.extend(more);
        results
    })
}

/// A block whose arrays are the inputs, in order.
fn given(
    cx: &mut Recorder,
    m: &Constants<f32>,
    arrays: &[Array],
    x: &[Recorded],
) -> RecordedWorlds {
    let cell = cx.var(Recorded::c(0.0));
    let mut block = Block::new(m, cell);
    // the block's cells are one variable so far, and each needs its own
    for array in Array::ALL {
        if let Flat::Cells(cells) = block.array_mut(*array) {
            cells.fill_with(|| cx.var(Recorded::c(0.0)));
        }
    }
    let mut inputs = x.iter().copied();
    let mut next = || inputs.next().expect("an input for every number read");
    for array in arrays {
        match block.array_mut(*array) {
            Flat::Cells(cells) => cells.iter_mut().for_each(|v| cx.set(v, next())),
            Flat::Values(values) => values.iter_mut().for_each(|v| *v = next()),
        }
    }
    block
}

fn results(cx: &mut Recorder, block: &RecordedWorlds, arrays: &[Array]) -> Vec<Recorded> {
    let mut results = Vec::new();
    for array in arrays {
        match block.array(*array) {
            Flat::Cells(cells) => results.extend(cells.iter().map(|v| cx.get(v))),
            Flat::Values(values) => results.extend_from_slice(values),
        }
    }
    results
}

//! The stages on the machine that records.
//!
//! Its instance of the text is a hundred thousand calls, which no optimisation makes faster in a way that matters: a
//! recording takes milliseconds. See the profile in `Cargo.toml`.

use sim_physics::arrays::{Block, Numbers, WorkSlot as Slot};
use sim_physics::constants::Constants;
use sim_physics::every_stage;
use sim_physics::lane::{Cx, Num};
use sim_physics::step::Stage;
use sim_record::{RecordError, Recorded, RecordedVariable, Recorder, Recording, record};

/// A block of the machine that records.
pub type RecordedWorlds = Block<Recorded, RecordedVariable>;

/// What stages leave for each other, and the state.
pub const SLOTS: [Slot; 38] = {
    use Slot::*;
    [
        JointQ,
        JointQRest,
        JointQd,
        JointQdd,
        Unconverged,
        LeftOut,
        JointF,
        JointTargetQ,
        JointTargetQd,
        Params,
        Substep,
        CommandHistory,
        CommandNoise,
        Applied,
        Rotation,
        Origin,
        Reference,
        Motion,
        Inertia,
        BiasForce,
        MassMatrix,
        SmoothForce,
        EfcWeight,
        EfcAref,
        LimitSide,
        EfcForce,
        ConstraintForce,
        BodyQ,
        Velocity,
        LinkCenter,
        BodyQd,
        Orientation,
        JointTorque,
        SiteQ,
        SiteQd,
        Gyro,
        Accelerometer,
        SiteInverse,
    ]
};

/// Cells that a stage leaves to nobody.
pub const SCRATCH: [Slot; 4] = [
    Slot::System,
    Slot::CoupledSystem,
    Slot::Pull,
    Slot::Solution,
];

/// Records a stage.
pub fn run(stage: Stage, cx: &mut Recorder, m: &Constants<f32>, block: &mut RecordedWorlds) {
    static STAGES: [RunStage; Stage::ALL.len()] = every_stage!(recorded);
    STAGES[stage.number()](cx, m, block);
}

type RunStage = fn(&mut Recorder, &Constants<f32>, &mut RecordedWorlds);

fn recorded<const STAGE: usize>(cx: &mut Recorder, m: &Constants<f32>, block: &mut RecordedWorlds) {
    sim_physics::step::run::<_, STAGE>(cx, m, block);
}

/// Numbers of a slot, by the model.
pub fn length(m: &Constants<f32>, slot: Slot) -> usize {
    // a block of plain numbers: nothing is recorded
    match Block::<f32, f32>::new(m, 0.0).numbers(slot) {
        Numbers::Cells(x) | Numbers::Values(x) => x.len(),
    }
}

/// The recording of a text between two sets of slots: its inputs are the numbers of `reads`, in order, its outputs those of
/// `writes`, then what the text returns.
///
/// # Errors
/// As [`record`].
pub fn between(
    m: &Constants<f32>,
    reads: &[Slot],
    writes: &[Slot],
    text: impl FnOnce(&mut Recorder, &mut RecordedWorlds) -> Vec<Recorded>,
) -> Result<Recording, RecordError> {
    let mut plain = Block::<f32, f32>::new(m, 0.0);
    let mut length = |slot: &Slot| match plain.numbers(*slot) {
        Numbers::Cells(x) | Numbers::Values(x) => x.len(),
    };
    let inputs = reads.iter().map(&mut length).sum();
    record(inputs, |cx, x| {
        let mut block = given(cx, m, reads, x);
        let more = text(cx, &mut block);
        let mut results = results(cx, &mut block, writes);
        results.extend(more);
        results
    })
}

/// A block whose slots are the inputs, in order.
fn given(cx: &mut Recorder, m: &Constants<f32>, slots: &[Slot], x: &[Recorded]) -> RecordedWorlds {
    let cell = cx.var(Recorded::c(0.0));
    let mut block = Block::new(m, cell);
    // the block's cells are one variable so far, and each needs its own
    for slot in SLOTS.into_iter().chain(SCRATCH) {
        if let Numbers::Cells(cells) = block.numbers(slot) {
            cells.fill_with(|| cx.var(Recorded::c(0.0)));
        }
    }
    let mut inputs = x.iter().copied();
    let mut next = || inputs.next().expect("an input for every number read");
    for slot in slots {
        match block.numbers(*slot) {
            Numbers::Cells(cells) => cells.iter_mut().for_each(|v| cx.set(v, next())),
            Numbers::Values(values) => values.iter_mut().for_each(|v| *v = next()),
        }
    }
    block
}

fn results(cx: &mut Recorder, block: &mut RecordedWorlds, slots: &[Slot]) -> Vec<Recorded> {
    let mut results = Vec::new();
    for slot in slots {
        match block.numbers(*slot) {
            Numbers::Cells(cells) => results.extend(cells.iter().map(|v| cx.get(v))),
            Numbers::Values(values) => results.extend_from_slice(values),
        }
    }
    results
}

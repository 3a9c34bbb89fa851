//! Machine code beside the stages that it stands for, at launch, where someone asks for it.

use super::{CompiledStep, Refusal};
use crate::backend::cpu::space::Space;
use crate::backend::state::RECORD;
use sim_physics::arrays::{Array, Flat};
use sim_physics::compiled::Stages;
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use sim_physics::step::StageId;

/// Substeps that are compared.
const SUBSTEPS: usize = 64;
/// What differs from world to world, by up to [`SIZE`] in its unit.
const DIFFERENT: [Array; 5] = [
    Array::JointQd,
    Array::JointF,
    Array::JointTargetQd,
    Array::Ctrl,
    Array::CommandNoise,
];
const SIZE: f64 = 1.0;

/// What machine code is compared with.
pub(in crate::backend::cpu) struct StagesOfModel<'a, F: Lane> {
    /// Of the model.
    pub constants: &'a Constants<F::Real>,
    /// Every stage, by [`StageId::index`].
    pub stages: &'a Stages<F>,
    /// Those of a substep, by their places.
    pub step: &'a [usize],
    /// State and commands of a world after a reset, in the order of [`RECORD`].
    pub start: &'a [F::Real],
}

impl CompiledStep {
    /// Compares the sections with their stages, substep by substep, from the model's start with different velocities and commands in
    /// each world: both programs of each, where nothing rare happens.
    ///
    /// # Errors
    /// The first number that differs by more than the sign of a zero, with its stage; a model with other arrays or stages.
    ///
    /// # Safety
    /// The processor has the instructions of the stages, which are those of `F`.
    pub unsafe fn check<F: Lane>(&self, of_stages: &StagesOfModel<'_, F>) -> Result<(), Refusal> {
        let StagesOfModel {
            constants,
            stages,
            step,
            ..
        } = *of_stages;
        if self.sizes_of_arrays != sizes_of_arrays(constants) || self.beginning.len() != step.len()
        {
            return Err("it is compared with a model that has other arrays".to_owned());
        }
        let mut space = start(of_stages);
        let mut scratch = vec![F::default(); self.scratch()];
        // beyond finite numbers the code promises nothing: such a world is left out from there on
        let mut finite = vec![true; F::WIDTH];
        for substep in 0..SUBSTEPS {
            let mut place = 0;
            while place < step.len() {
                let section = self.section_at(place).map(|(_, section)| section);
                let end = place + section.map_or(1, |section| section.stages());
                let before = Saved::take(&mut space);
                for &stage in &step[place..end] {
                    // SAFETY: by contract.
                    unsafe { stages[stage](constants, &mut space.block, &mut space.memory) };
                }
                let by_stages = Saved::take(&mut space);
                by_stages.leave_out(&mut finite);
                // first as a block in which nothing rare happened, then as one in which something did
                for mut wary in [0, 1] {
                    let Some(section) = section else { break };
                    before.put(&mut space);
                    let at_work = (&mut *space.block, &mut space.memory[..]);
                    // SAFETY: by contract; the arrays have the sizes that the section was made for.
                    unsafe { section.run(at_work, &mut scratch, &mut wary) };
                    let (by_code, places) = (Saved::take(&mut space), &step[place..end]);
                    let compared = Compared {
                        by_stages: &by_stages,
                        before: &before,
                        written: section.writes(),
                        stages: places,
                        worlds: &finite,
                    };
                    if let Some(difference) = by_code.differs(&compared) {
                        return Err(format!("in substep {substep}, {difference}"));
                    }
                }
                by_stages.put(&mut space);
                place = end;
            }
        }
        Ok(())
    }
}

/// The last of some stages that writes an array, if one does.
fn writer(stages: &[usize], array: Array) -> Option<&'static str> {
    let all: Vec<StageId> = StageId::all().collect();
    let mut writers = stages.iter().rev().map(|stage| all[*stage]);
    let last = writers.find(|stage| stage.writes().contains(&array));
    last.map(StageId::name)
}

/// A block at the model's start, with different velocities and commands in each world.
fn start<F: Lane>(of_stages: &StagesOfModel<'_, F>) -> Space<F> {
    let mut space = Space::new(of_stages.constants);
    let mut numbers = of_stages.start.iter();
    for array in RECORD {
        for register in registers(&mut space, array) {
            *register = F::k(*numbers.next().expect("a number for each"));
        }
    }
    let mut lanes = vec![F::Real::default(); F::WIDTH];
    for array in DIFFERENT {
        for (k, register) in registers(&mut space, array).iter_mut().enumerate() {
            for (lane, x) in lanes.iter_mut().enumerate() {
                *x = F::Real::from_f64(SIZE * ((1 + lane + F::WIDTH * k) as f64).sin());
            }
            *register = *register + F::load(&lanes);
        }
    }
    space
}

fn registers<F: Lane>(space: &mut Space<F>, array: Array) -> &mut [F] {
    let (Flat::Cells(registers) | Flat::Values(registers)) = space.block.array_mut(array);
    registers
}

/// All that a block holds.
struct Saved<F> {
    arrays: Vec<Vec<F>>,
    memory: Vec<F>,
}

impl<F: Lane> Saved<F> {
    fn take(space: &mut Space<F>) -> Saved<F> {
        let arrays = Array::ALL.iter();
        Saved {
            arrays: arrays
                .map(|array| registers(space, *array).to_vec())
                .collect(),
            memory: space.memory.clone(),
        }
    }

    fn put(&self, space: &mut Space<F>) {
        for (array, registers_before) in Array::ALL.iter().zip(&self.arrays) {
            registers(space, *array).copy_from_slice(registers_before);
        }
        space.memory.copy_from_slice(&self.memory);
    }

    /// Leaves out the worlds that have a number which is not finite.
    fn leave_out(&self, worlds: &mut [bool]) {
        for (lane, is_finite) in worlds.iter_mut().enumerate() {
            let mut numbers = self.arrays.iter().flatten().map(|x| x.lane(lane).to_f64());
            *is_finite = *is_finite && numbers.all(f64::is_finite);
        }
    }

    /// The first number that differs from those of the stages, for people: of arrays that are written, of those that no stage
    /// writes, and of the memory of contacts.
    fn differs(&self, compared: &Compared<'_, F>) -> Option<String> {
        let (by_stages, worlds) = (compared.by_stages, compared.worlds);
        for (k, array) in Array::ALL.iter().enumerate() {
            let (stage, expected) = match writer(compared.stages, *array) {
                Some(stage) if compared.written.contains(array) => (stage, &by_stages.arrays[k]),
                // left to the stages of the section, which the code does not need
                Some(_) => continue,
                None => ("of none", &compared.before.arrays[k]),
            };
            if let Some(difference) = different(&self.arrays[k], expected, worlds) {
                return Some(format!("stage {stage}: {array:?} {difference}"));
            }
        }
        let difference = different(&self.memory, &by_stages.memory, worlds)?;
        Some(format!("memory of contacts {difference}"))
    }
}

/// What a section is compared with.
struct Compared<'a, F> {
    by_stages: &'a Saved<F>,
    before: &'a Saved<F>,
    /// Arrays that the section writes for others.
    written: &'a [Array],
    /// The stages that it stands for.
    stages: &'a [usize],
    /// Which worlds are compared.
    worlds: &'a [bool],
}

/// The first number that differs, for people.
fn different<F: Lane>(by_code: &[F], by_stages: &[F], worlds: &[bool]) -> Option<String> {
    for (k, pair) in by_code.iter().zip(by_stages).enumerate() {
        for lane in (0..F::WIDTH).filter(|lane| worlds[*lane]) {
            let [code, stages] = [pair.0, pair.1].map(|x| x.lane(lane).to_f64());
            // NaN, which rows that are not in use may hold, is as good as another
            if stages != code && !(stages.is_nan() && code.is_nan()) {
                return Some(format!(
                    "{k} of world {lane} is {code} by machine code, {stages} by the stages"
                ));
            }
        }
    }
    None
}

/// Scalars of each array, and of the memory of contacts.
pub(super) fn sizes_of_arrays<R: Real>(m: &Constants<R>) -> Vec<usize> {
    let arrays = Array::ALL.iter().map(|array| array.scalars(m));
    arrays.chain([m.contacts.memory.len]).collect()
}

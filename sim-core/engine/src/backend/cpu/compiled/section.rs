//! Stages that follow each other as one program.
//!
//! Where nothing rare happens in a block, a shorter program runs: no joint is at a limit.

use super::{ProgramListing, Refusal};
use sim_compile::{Address, Places, Program, Size, Target};
use sim_physics::arrays::{Array, Block, Flat};
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Tables};
use sim_physics::step::StageId;
use stages_recorded::StageRun;
use std::ops::Range;

/// Most arrays that a section reads and writes, with the memory of contacts.
const ARRAYS_MAX: usize = 64;
/// Substeps of a block after a rare one for which nothing is assumed: what is rare may last.
const WARY: u8 = 16;

/// What a section's programs are made from.
pub(super) struct RecordedSection {
    run: Range<usize>,
    usual: StageRun,
    full: StageRun,
    /// In the order of the programs' addresses; the memory of contacts follows them.
    arrays: Vec<Array>,
    inputs: Vec<Address>,
    outputs: Vec<Address>,
}

impl RecordedSection {
    /// Records stages, which are in these places of a substep.
    ///
    /// # Errors
    /// As [`super::CompiledStep::of_model`].
    pub fn new(
        m: &Constants<f32>,
        substep: &[StageId],
        run: Range<usize>,
    ) -> Result<RecordedSection, Refusal> {
        let record = |assumes| {
            let recorded = StageRun::record(m, substep, run.clone(), assumes);
            recorded.map_err(|error| error.to_string())
        };
        // with contacts, what is asked about is whether there are any, and that is not rare
        let (usual, full) = (record(m.contacts.groups.is_empty())?, record(false)?);
        let mut arrays: Vec<Array> = Vec::new();
        for array in full.reads.iter().chain(&full.writes) {
            if !arrays.contains(array) {
                arrays.push(*array);
            }
        }
        assert!(arrays.len() < ARRAYS_MAX, "more arrays than places");
        let place = |array: &Array| arrays.iter().position(|other| other == array);
        let addresses = |listed: &[Array]| -> Vec<Address> {
            let each = listed.iter().flat_map(|array| {
                let place = place(array).expect("it is listed") as u32;
                let registers = 0..array.scalars(m) as u32;
                registers.map(move |at| Address { array: place, at })
            });
            each.collect()
        };
        Ok(RecordedSection {
            run,
            inputs: addresses(&full.reads),
            outputs: addresses(&full.writes),
            usual,
            full,
            arrays,
        })
    }

    /// The stages that assume that nothing rare happens, where something rare can, and those that assume nothing.
    fn runs(&self) -> (Option<&StageRun>, &StageRun) {
        let assumes = self.usual.recording.assumed().is_some();
        (assumes.then_some(&self.usual), &self.full)
    }

    fn places(&self) -> Places<'_> {
        Places {
            inputs: &self.inputs,
            outputs: &self.outputs,
            memory: Some(self.arrays.len() as u32),
        }
    }

    /// Compiles the programs.
    ///
    /// # Errors
    /// As [`super::CompiledStep::of_model`].
    pub fn compiled(self, tables: &Tables<f32>, target: Target) -> Result<Section, Refusal> {
        let (usual, full) = self.runs();
        let compiled = |run: &StageRun| {
            let made = Program::new(&run.recording, &self.places(), tables, target);
            made.map_err(|error| error.to_string())
        };
        Ok(Section {
            stages: self.run.len(),
            usual: usual.map(compiled).transpose()?,
            full: compiled(full)?,
            writes: full.writes.clone(),
            memory: full.recording.scratch(),
            arrays: self.arrays,
        })
    }

    /// The programs for people: whether one assumes that nothing rare happens, and its lines.
    ///
    /// # Errors
    /// As [`super::CompiledStep::of_model`].
    pub fn listed(
        &self,
        tables: &Tables<f32>,
        target: Target,
    ) -> Result<Vec<ProgramListing>, Refusal> {
        let (usual, full) = self.runs();
        let listed = |(assumes, run): (bool, &StageRun)| {
            let made = Program::listing(&run.recording, &self.places(), tables, target);
            let lines = made.map_err(|error| error.to_string())?;
            Ok(ProgramListing { assumes, lines })
        };
        let programs = usual.map(|run| (true, run)).into_iter();
        programs.chain([(false, full)]).map(listed).collect()
    }
}

/// A section of a substep: a run of its stages.
pub(in crate::backend::cpu) struct Section {
    /// How many stages it stands for.
    stages: usize,
    /// Assumes that nothing rare happens; none where nothing rare can.
    usual: Option<Program>,
    /// Assumes nothing.
    full: Program,
    /// In the order of the programs' addresses; the memory of contacts follows them.
    arrays: Vec<Array>,
    /// Those that it writes for others.
    writes: Vec<Array>,
    /// Registers of the memory of contacts that the programs reach.
    memory: usize,
}

impl Section {
    /// How many stages it stands for.
    #[inline(always)]
    pub fn stages(&self) -> usize {
        self.stages
    }

    /// The arrays that it writes for others.
    pub fn writes(&self) -> &[Array] {
        &self.writes
    }

    fn programs(&self) -> [&Program; 2] {
        [self.usual.as_ref().unwrap_or(&self.full), &self.full]
    }

    /// Memory that [`Section::run`] needs, in registers.
    pub fn scratch(&self) -> usize {
        let [usual, full] = self.programs().map(Program::scratch);
        usual.max(full)
    }

    /// Where the stages are in memory: address, bytes and name of each piece.
    pub fn pieces(&self) -> impl Iterator<Item = (usize, usize, &'static str)> {
        let programs = self.usual.iter().chain([&self.full]);
        programs.flat_map(Program::parts)
    }

    /// Sizes of the programs: of that which assumes, and of the other.
    pub fn sizes(&self) -> [Size; 2] {
        self.programs().map(Program::size)
    }

    /// Runs the stages on a block and its memory of contacts. `wary` is the block's for this section, 0 at first: for how many
    /// substeps nothing is assumed.
    ///
    /// # Safety
    /// The processor has the instructions of `F`, for which the section was compiled, and the block and the memory are of its model.
    #[inline(always)]
    pub unsafe fn run<F: Lane>(
        &self,
        (block, memory): (&mut Block<F, F>, &mut [F]),
        scratch: &mut [F],
        wary: &mut u8,
    ) {
        assert!(scratch.len() >= self.scratch(), "memory for both programs");
        assert!(memory.len() >= self.memory, "memory of contacts");
        let mut places = [std::ptr::null_mut::<f32>(); ARRAYS_MAX];
        for (place, array) in places.iter_mut().zip(&self.arrays) {
            let (Flat::Cells(x) | Flat::Values(x)) = block.array_mut(*array);
            *place = x.as_mut_ptr().cast();
        }
        places[self.arrays.len()] = memory.as_mut_ptr().cast();
        let places = &places[..self.arrays.len() + 1];
        let scratch = scratch.as_mut_ptr().cast();
        if let (Some(usual), 0) = (&self.usual, *wary) {
            // SAFETY: by contract; the arrays are those for which the programs were made, and this block's alone.
            if unsafe { usual.run(places, scratch) } {
                return;
            }
            *wary = WARY;
        }
        *wary = wary.saturating_sub(1);
        // SAFETY: as above.
        let done = unsafe { self.full.run(places, scratch) };
        assert!(done, "it assumes nothing");
    }
}

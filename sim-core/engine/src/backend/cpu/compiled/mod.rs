//! The substep of a model as machine code, where the model can be compiled.
//!
//! It has the bits of the stages. Where nothing rare happens in a block, a shorter program runs: no joint is at a limit.

mod stack;
mod suits;

use sim_compile::{Address, Program, Size, Target};
use sim_model::Model;
use sim_physics::arrays::{Array, Block, Flat};
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use stack::with_stack;
use stages_recorded::Substep;
use suits::suits;

/// Most arrays that a substep reads and writes.
const ARRAYS_MAX: usize = 64;
/// Substeps of a block after a rare one for which nothing is assumed: what is rare may last.
const WARY: u8 = 16;

/// All stages of a substep.
pub(super) struct CompiledStep {
    /// Assumes that nothing rare happens; none where nothing rare can.
    usual: Option<Program>,
    /// Assumes nothing.
    full: Program,
    /// In the order of the programs' addresses.
    arrays: Vec<Array>,
}

/// Why a model has no machine code that should have it, for people.
pub(super) type Refusal = String;

impl CompiledStep {
    /// The substep of a model for registers of `F`; none where the stages run: in double precision, for one world in a block,
    /// with contacts, and for a kind of processor without a compiler.
    ///
    /// # Errors
    /// A recorded operation that the compiler does not know, or a system that forbids machine code.
    pub fn of_model<F: Lane>(model: &Model) -> Result<Option<CompiledStep>, Refusal> {
        let m = model.constants();
        let target = match F::Real::DOUBLE {
            true => None,
            false => Target::of_width(F::WIDTH),
        };
        match target {
            Some(target) if suits(m) => {
                let m = m.cast();
                with_stack(|| CompiledStep::new(&m, target)).map(Some)
            }
            _ => Ok(None),
        }
    }

    fn new(m: &Constants<f32>, target: Target) -> Result<CompiledStep, Refusal> {
        let record = |assumes| Substep::record(m, assumes).map_err(|error| error.to_string());
        let (usual, full) = (record(true)?, record(false)?);
        let mut arrays: Vec<Array> = Vec::new();
        for array in full.reads.iter().chain(&full.writes) {
            if !arrays.contains(array) {
                arrays.push(*array);
            }
        }
        assert!(arrays.len() <= ARRAYS_MAX, "more arrays than places");
        let place = |array: &Array| arrays.iter().position(|other| other == array);
        let addresses = |listed: &[Array]| -> Vec<Address> {
            let each = listed.iter().flat_map(|array| {
                let place = place(array).expect("it is listed") as u32;
                let registers = 0..array.scalars(m) as u32;
                registers.map(move |at| Address { array: place, at })
            });
            each.collect()
        };
        let (inputs, outputs) = (addresses(&full.reads), addresses(&full.writes));
        let tables = &m.contacts.tables;
        let compiled = |step: &Substep| {
            let made = Program::new(&step.recording, &inputs, &outputs, tables, target);
            made.map_err(|error| error.to_string())
        };
        let assumes = usual.recording.assumed().is_some();
        Ok(CompiledStep {
            usual: assumes.then(|| compiled(&usual)).transpose()?,
            full: compiled(&full)?,
            arrays,
        })
    }

    fn programs(&self) -> [&Program; 2] {
        [self.usual.as_ref().unwrap_or(&self.full), &self.full]
    }

    /// Memory that [`CompiledStep::run`] needs, in registers.
    pub fn scratch(&self) -> usize {
        let [usual, full] = self.programs().map(Program::scratch);
        usual.max(full)
    }

    /// Sizes of the programs: of that which assumes, and of the other.
    pub fn sizes(&self) -> [Size; 2] {
        self.programs().map(Program::size)
    }

    /// Runs the substep on a block. `wary` is the block's, 0 at first: for how many substeps nothing is assumed.
    ///
    /// # Safety
    /// The processor has the instructions of `F`, for which the step was compiled, and the block is of its model.
    #[inline(always)]
    pub unsafe fn run<F: Lane>(&self, block: &mut Block<F, F>, scratch: &mut [F], wary: &mut u8) {
        assert!(scratch.len() >= self.scratch(), "memory for both programs");
        let mut places = [std::ptr::null_mut::<f32>(); ARRAYS_MAX];
        for (place, array) in places.iter_mut().zip(&self.arrays) {
            let (Flat::Cells(x) | Flat::Values(x)) = block.array_mut(*array);
            *place = x.as_mut_ptr().cast();
        }
        let places = &places[..self.arrays.len()];
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

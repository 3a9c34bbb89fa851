//! Machine code of this processor, from recorded physics.
//!
//! A recording runs for one world, a program for all worlds of a block, one in each lane of the registers. The
//! model's constants are folded in, and registers are given out over the whole program, which is what makes it faster than stages
//! that are compiled for all models.
//!
//! | file | what it has |
//! |---|---|
//! | `lower` | from branches and loops of a recording to linear code |
//! | `code`, `machine` | instructions before and after registers are given out |
//! | `allocate` | who is in which register |
//! | `x86` | bytes |
//! | `pages` | memory that is written first, and executed afterwards |

mod address;
mod allocate;
mod code;
mod error;
mod lower;
mod machine;
mod pages;
mod x86;

pub use address::Address;
pub use error::CompileError;

use allocate::Files;
use pages::Pages;
use sim_physics::lane::Tables;
use sim_record::Recording;
use std::fmt;
use x86::{Avx2, Avx512, InstructionSet};

/// What a program is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// 8 worlds, with AVX2 and FMA.
    Avx2,
    /// 16 worlds, with AVX-512 (F, DQ, VL, BW).
    Avx512,
}

impl Target {
    /// That of blocks of so many worlds; none where this kind of processor has no compiler, or no such blocks.
    pub fn of_width(worlds: usize) -> Option<Target> {
        match worlds {
            8 if cfg!(target_arch = "x86_64") => Some(Target::Avx2),
            16 if cfg!(target_arch = "x86_64") => Some(Target::Avx512),
            _ => None,
        }
    }
}

/// Counts of a program.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Bytes of machine code.
    pub bytes: usize,
    /// Machine instructions.
    pub instructions: usize,
    /// Values that had to leave the registers.
    pub spills: usize,
    /// Memory that it needs while it runs, in registers.
    pub slots: usize,
}

/// A compiled recording.
pub struct Program {
    pages: Pages,
    size: Size,
}

impl Program {
    /// Compiles a recording whose inputs and outputs have these addresses.
    ///
    /// # Errors
    /// What cannot be compiled, and a system that forbids it.
    ///
    /// # Panics
    /// If there are more or fewer addresses than inputs and outputs.
    pub fn new(
        recording: &Recording,
        inputs: &[Address],
        outputs: &[Address],
        tables: &Tables<f32>,
        target: Target,
    ) -> Result<Program, CompileError> {
        assert_eq!(
            (inputs.len(), outputs.len()),
            (recording.inputs(), recording.outputs()),
            "an address for each"
        );
        if cfg!(not(target_arch = "x86_64")) {
            return Err(CompileError::Processor);
        }
        let code = lower::lower(recording, inputs, outputs, tables)?;
        match target {
            Target::Avx2 => Program::of_code::<Avx2>(&code),
            Target::Avx512 => Program::of_code::<Avx512>(&code),
        }
    }

    fn of_code<S: InstructionSet>(code: &code::Code) -> Result<Program, CompileError> {
        let files = Files {
            scalars: S::SCALARS,
            masks: S::MASKS,
        };
        let allocated = allocate::allocate(code, files);
        let encoded =
            x86::encode::<S>(&allocated.machine, allocated.slots, code.loops, code.labels)?;
        let size = Size {
            bytes: encoded.bytes.len(),
            instructions: encoded.instructions,
            spills: allocated.spills,
            slots: (allocated.slots + code.loops) as usize,
        };
        Ok(Program {
            pages: Pages::new(&encoded.bytes, &encoded.constants)?,
            size,
        })
    }

    /// How large it is.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Memory that it needs while it runs, in registers of its target.
    pub fn scratch(&self) -> usize {
        self.size.slots
    }

    /// Runs it on the arrays of a block, in memory of [`Program::scratch`] registers. False if something holds that the recording
    /// assumes to hold nowhere: then no array was changed.
    ///
    /// # Safety
    /// The processor has the instructions of the target. Each address leads to an array that has the registers of the inputs and
    /// outputs. Nobody else uses these and the memory meanwhile.
    #[must_use]
    pub unsafe fn run(&self, arrays: &[*mut f32], scratch: *mut f32) -> bool {
        let (code, constants) = (self.pages.address(), self.pages.constants());
        #[cfg(target_arch = "x86_64")]
        {
            type Function = extern "sysv64" fn(*const *mut f32, *const f32, *mut f32) -> u32;
            // SAFETY: the pages hold a function of this kind; it reads constants no further than they were made.
            let function: Function = unsafe { std::mem::transmute(code) };
            function(arrays.as_ptr(), constants, scratch) == 0
        }
        #[cfg(not(target_arch = "x86_64"))]
        unreachable!("no program: {code:?}, {constants:?}, {arrays:?}, {scratch:?}")
    }
}

impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Program").field(&self.size).finish()
    }
}

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
//! | `listing` | instructions beside the code that they come from |
//! | `pages` | memory that is written first, and executed afterwards |

mod address;
mod allocate;
mod code;
mod error;
mod listing;
mod lower;
mod machine;
mod pages;
mod x86;

pub use address::{Address, Places};
pub use error::CompileError;
pub use listing::Line;

use allocate::{Allocated, Files};
use listing::PartBytes;
use pages::Pages;
use sim_physics::lane::Tables;
use sim_record::Recording;
use std::fmt;
use x86::{Avx2, Avx512, Encoded, InstructionSet};

/// Most instructions of a program before registers are given out: about 2 MB of code, for which 100 MB of memory are needed [–].
const INSTRUCTIONS_MAX: usize = 200_000;

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
    parts: Vec<PartBytes>,
}

impl Program {
    /// Compiles a recording whose inputs, outputs and scratch memory are in these places.
    ///
    /// # Errors
    /// What cannot be compiled, and a system that forbids it.
    ///
    /// # Panics
    /// If there are more or fewer addresses than inputs and outputs.
    pub fn new(
        recording: &Recording,
        places: &Places<'_>,
        tables: &Tables<f32>,
        target: Target,
    ) -> Result<Program, CompileError> {
        let made = Compiled::new(recording, places, tables, target, false)?;
        let (encoded, allocated) = (&made.encoded, &made.allocated);
        let size = Size {
            bytes: encoded.bytes.len(),
            instructions: encoded.instructions,
            spills: allocated.spills,
            slots: (allocated.slots + made.code.loops) as usize,
        };
        Ok(Program {
            pages: Pages::new(&encoded.bytes, &encoded.constants)?,
            size,
            parts: listing::parts((recording, &made.code), (allocated, encoded)),
        })
    }

    /// The program of a recording for people.
    ///
    /// # Errors
    /// As [`Program::new`], which also asks the system for memory.
    ///
    /// # Panics
    /// As [`Program::new`].
    pub fn listing(
        recording: &Recording,
        places: &Places<'_>,
        tables: &Tables<f32>,
        target: Target,
    ) -> Result<Vec<Line>, CompileError> {
        let made = Compiled::new(recording, places, tables, target, true)?;
        let recorded = (recording, &made.code);
        Ok(listing::lines(recorded, (&made.allocated, &made.encoded)))
    }

    /// How large it is.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Memory that it needs while it runs, in registers of its target.
    pub fn scratch(&self) -> usize {
        self.size.slots
    }

    /// Where its bytes are in memory, by parts of the code that was recorded ([`sim_record::Origin`]): address, bytes and name.
    pub fn parts(&self) -> impl Iterator<Item = (usize, usize, &'static str)> {
        let first = self.pages.address() as usize;
        let parts = self.parts.iter();
        parts.map(move |(part, range)| (first + range.start, range.len(), *part))
    }

    /// Runs it on the arrays of a block, in memory of [`Program::scratch`] registers. False if something holds that the recording
    /// assumes to hold nowhere: then nothing was changed.
    ///
    /// # Safety
    /// The processor has the instructions of the target. Each place leads to an array that has the registers of the inputs and
    /// outputs, and of the recording's scratch memory. Nobody else uses these and the memory meanwhile.
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

/// What becomes of a recording, step by step.
struct Compiled {
    code: code::Code,
    allocated: Allocated,
    encoded: Encoded,
}

impl Compiled {
    /// `lists` asks for the instructions.
    fn new(
        recording: &Recording,
        places: &Places<'_>,
        tables: &Tables<f32>,
        target: Target,
        lists: bool,
    ) -> Result<Compiled, CompileError> {
        assert_eq!(
            (places.inputs.len(), places.outputs.len()),
            (recording.inputs(), recording.outputs()),
            "an address for each"
        );
        if cfg!(not(target_arch = "x86_64")) {
            return Err(CompileError::Processor);
        }
        let code = lower::lower(recording, places, tables)?;
        let instructions = code.instructions.len();
        if instructions > INSTRUCTIONS_MAX {
            return Err(CompileError::TooLong { instructions });
        }
        match target {
            Target::Avx2 => Compiled::of_code::<Avx2>(code, lists),
            Target::Avx512 => Compiled::of_code::<Avx512>(code, lists),
        }
    }

    fn of_code<S: InstructionSet>(code: code::Code, lists: bool) -> Result<Compiled, CompileError> {
        let files = Files {
            scalars: S::SCALARS,
            masks: S::MASKS,
        };
        let allocated = allocate::allocate(&code, files);
        let (machine, slots) = (&allocated.machine, allocated.slots);
        let encoded = x86::encode::<S>(machine, slots, code.loops, code.labels, lists)?;
        Ok(Compiled {
            code,
            allocated,
            encoded,
        })
    }
}

impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Program").field(&self.size).finish()
    }
}

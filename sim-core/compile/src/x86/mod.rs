//! Machine instructions as bytes of x86-64.
//!
//! The program is a function `extern "sysv64" fn(*const *mut f32, *const f32, *mut f32) -> u32`. It gets the addresses of the caller's
//! arrays, of its constants, and of its slots: variables, values that left the registers, counters of loops. It calls nothing and
//! leaves the stack alone.

mod assembler;
mod avx2;
mod avx512;

use crate::code::{Binary, Kind, Logic};
use crate::error::CompileError;
use crate::machine::{Form, Machine, Register};
use assembler::Assembler;
pub(crate) use avx2::Avx2;
pub(crate) use avx512::Avx512;
use iced_x86::{Code, IcedError, Instruction, MemoryOperand, Register as X86};

/// The instructions of a set, and how many registers it has.
pub(crate) trait InstructionSet {
    /// Worlds in a register.
    const WIDTH: usize;
    /// Does an instruction spread a constant of memory over a register by itself?
    const BROADCASTS: bool;
    const SCALARS: usize;
    const MASKS: Option<usize>;

    fn load(kind: Kind, to: Register, from: MemoryOperand) -> Result<Instruction, IcedError>;
    fn store(kind: Kind, to: MemoryOperand, from: Register) -> Result<Instruction, IcedError>;
    /// A register of scalars.
    fn scalar(register: Register) -> X86;
    fn copy() -> Code;
    fn sqrt() -> Code;
    fn round() -> Code;
    fn binary(op: Binary) -> Code;
    fn fma(form: Form, minus_product: bool, minus_c: bool) -> Code;
    /// An instruction that the sets have in different ways.
    fn mask(assembler: &mut Assembler, machine: &Machine) -> Result<(), IcedError>;
    /// Compares masks with nothing: the flag of equality is set if this one holds nowhere.
    fn test(assembler: &mut Assembler, mask: Register) -> Result<(), IcedError>;
}

/// Bytes of a program.
pub(crate) struct Encoded {
    pub bytes: Vec<u8>,
    /// In the order of their addresses; each fills a register where the set does not spread them.
    pub constants: Vec<f32>,
    pub instructions: usize,
    /// Where the bytes of each machine instruction begin.
    pub starts: Vec<u32>,
    /// All instructions in the syntax of Intel's manuals and where they begin, if they were asked for.
    pub listing: Vec<(u32, String)>,
}

/// Encodes a program of so many slots, loops and labels. `lists` asks for its instructions.
pub(crate) fn encode<S: InstructionSet>(
    machine: &[Machine],
    slots: u32,
    loops: u32,
    labels: u32,
    lists: bool,
) -> Result<Encoded, CompileError> {
    let mut assembler = Assembler::new(S::WIDTH, S::BROADCASTS, slots, loops, labels);
    assembler.listing = lists.then(Vec::new);
    let mut starts = Vec::with_capacity(machine.len());
    let mut all = || {
        assembler.begin()?;
        for instruction in machine {
            starts.push(assembler.position() as u32);
            assembler.machine::<S>(instruction)?;
        }
        assembler.end()
    };
    all().map_err(|error: IcedError| CompileError::Encoding(error.to_string()))?;
    Ok(assembler.finish(starts))
}

/// Two instructions of a mask that read and write one file of registers.
fn logic(op: Logic, codes: [Code; 3]) -> Code {
    codes[match op {
        Logic::And => 0,
        Logic::Or => 1,
        Logic::NotAnd => 2,
    }]
}

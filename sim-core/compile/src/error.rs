//! Why there is no program.

use crate::INSTRUCTIONS_MAX;
use std::fmt::Debug;

/// Why a recording has no program.
#[derive(Debug, thiserror::Error)]
pub enum CompileError {
    /// The compiler does not know a statement, an operation or an operand.
    #[error("the compiler does not know the recorded `{0}`")]
    Unknown(String),
    /// A program would be longer than the compiler makes.
    #[error(
        "its machine code would have {instructions} instructions, and the limit is {INSTRUCTIONS_MAX}"
    )]
    TooLong {
        /// How long it would be [–].
        instructions: usize,
    },
    /// The processor is none that it knows.
    #[error("there is no compiler for this kind of processor")]
    Processor,
    /// The encoder refuses an instruction.
    #[error("an instruction cannot be encoded: {0}")]
    Encoding(String),
    /// The system gives no memory that may be executed.
    #[error("the system gives no memory that may be executed: {0}")]
    Memory(#[from] std::io::Error),
}

impl CompileError {
    /// The compiler does not know what this is: the name of its variant.
    pub(crate) fn unknown(what: &impl Debug) -> CompileError {
        let text = format!("{what:?}");
        let name = text.split(|c: char| !c.is_alphanumeric()).next();
        CompileError::Unknown(name.unwrap_or_default().to_owned())
    }
}

//! Machine instructions, before they are encoded: registers are given out, and at most one operand lies in memory.

use crate::code::{Binary, Kind, Label, Logic, Place, Unary};

/// Number of a register of its file.
pub(crate) type Register = u8;

/// A place in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Memory {
    Array {
        base: u32,
        at: u32,
    },
    /// Of the memory that the program is given, counted in registers.
    Slot(u32),
    /// A value that left the registers; it gets a slot when all are known.
    Spilled(u32),
    /// Bits of an `f32`, for all worlds.
    Constant(u32),
}

impl From<Place> for Memory {
    fn from(place: Place) -> Memory {
        match place {
            Place::Array { base, at } => Memory::Array { base, at },
            Place::Variable(variable) => Memory::Slot(variable),
            Place::Constant(bits) => Memory::Constant(bits),
        }
    }
}

/// What an instruction reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Source {
    Register(Register),
    Memory(Memory),
}

/// Which operands of `x y + z` a fused instruction overwrites, and which may lie in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Form {
    /// `to = to · source + register`
    F132,
    /// `to = register · to + source`
    F213,
    /// `to = register · source + to`
    F231,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Machine {
    Load {
        kind: Kind,
        to: Register,
        from: Memory,
    },
    Store {
        kind: Kind,
        to: Memory,
        from: Register,
    },
    /// A scalar from one register to another.
    Copy {
        to: Register,
        from: Register,
    },
    Unary {
        op: Unary,
        to: Register,
        a: Source,
    },
    Binary {
        op: Binary,
        to: Register,
        a: Register,
        b: Source,
    },
    Fma {
        form: Form,
        to: Register,
        a: Register,
        b: Source,
        minus_product: bool,
        minus_c: bool,
    },
    Less {
        to: Register,
        a: Register,
        b: Source,
    },
    /// `a` where the mask holds, else `b`.
    Select {
        to: Register,
        mask: Register,
        a: Source,
        b: Register,
    },
    /// `a` where the mask holds, else 0.
    Keep {
        to: Register,
        mask: Register,
        a: Source,
    },
    Everywhere {
        to: Register,
    },
    Logic {
        op: Logic,
        to: Register,
        a: Register,
        b: Register,
    },
    JumpIfNone {
        mask: Register,
        label: Label,
    },
    RefuseIfAny {
        mask: Register,
    },
    Label(Label),
    LoopStart {
        number: u32,
    },
    /// Counts an iteration, and jumps to the label if it was the last.
    Count {
        number: u32,
        times: u32,
        exit: Label,
    },
    /// Jumps to the start of a loop.
    Again {
        number: u32,
    },
}

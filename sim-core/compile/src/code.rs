//! Linear code: instructions over values, one after another, with jumps instead of blocks.
//!
//! A value is assigned once and lasts as long as it is used. What changes is a variable, which has a place in memory.

use crate::address::Address;

/// What a value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A scalar of every world.
    Scalar,
    /// A boolean of every world.
    Mask,
}

/// What an instruction reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operand {
    Value(u32),
    /// Bits of an `f32`, the same in all worlds.
    Constant(u32),
}

/// A register of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    /// Of an array of the caller: which, and the register in it.
    Array { base: u32, at: u32 },
    /// A variable of the program.
    Variable(u32),
    /// Bits of an `f32`, the same in all worlds.
    Constant(u32),
}

impl From<Address> for Place {
    fn from(address: Address) -> Place {
        Place::Array {
            base: address.array,
            at: address.at,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Sqrt,
    /// The nearest integer, ties to even.
    Round,
}

/// Of two scalars, a scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    /// The smaller; the second where either is NaN.
    Min,
    /// The larger; the second where either is NaN.
    Max,
    /// Of their bits.
    And,
    /// Of their bits.
    Xor,
}

impl Binary {
    /// May the operands change places?
    pub fn commutes(self) -> bool {
        matches!(self, Binary::Add | Binary::Mul | Binary::And | Binary::Xor)
    }
}

/// Of two masks, a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Logic {
    And,
    Or,
    /// The second where the first does not hold.
    NotAnd,
}

/// Where a jump leads.
pub(crate) type Label = u32;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Instruction {
    /// Reads memory. A value whose place does not change needs none: see [`Code::homes`].
    Load {
        to: u32,
        from: Place,
    },
    Store {
        to: Place,
        x: Operand,
    },
    Unary {
        op: Unary,
        to: u32,
        a: Operand,
    },
    Binary {
        op: Binary,
        to: u32,
        a: Operand,
        b: Operand,
    },
    /// `±a b ± c`, rounded once.
    Fma {
        to: u32,
        a: Operand,
        b: Operand,
        c: Operand,
        minus_product: bool,
        minus_c: bool,
    },
    /// `a < b`
    Less {
        to: u32,
        a: Operand,
        b: Operand,
    },
    /// `a` where the mask holds, else `b`.
    Select {
        to: u32,
        mask: u32,
        a: Operand,
        b: Operand,
    },
    /// The mask that holds everywhere.
    Everywhere {
        to: u32,
    },
    Logic {
        op: Logic,
        to: u32,
        a: u32,
        b: u32,
    },
    /// Jumps if the mask holds in no world.
    JumpIfNone {
        mask: u32,
        label: Label,
    },
    /// Ends the program without a result if the mask holds in some world.
    RefuseIfAny {
        mask: u32,
    },
    /// Jumps lead here.
    Label(Label),
    /// A loop begins, with its counter at 0.
    LoopStart {
        number: u32,
    },
    /// A loop ends: it goes on at its start until it ran so many times, then at the label, which follows.
    LoopEnd {
        number: u32,
        times: u32,
        exit: Label,
    },
}

impl Instruction {
    /// The value that it assigns.
    pub fn assigned(&self) -> Option<u32> {
        match *self {
            Instruction::Load { to, .. }
            | Instruction::Unary { to, .. }
            | Instruction::Binary { to, .. }
            | Instruction::Fma { to, .. }
            | Instruction::Less { to, .. }
            | Instruction::Select { to, .. }
            | Instruction::Everywhere { to }
            | Instruction::Logic { to, .. } => Some(to),
            _ => None,
        }
    }

    /// Calls `f` with each value that it reads.
    pub fn each_value(&self, mut f: impl FnMut(u32)) {
        let mut read = |x: Operand| {
            if let Operand::Value(value) = x {
                f(value);
            }
        };
        match *self {
            Instruction::Store { x, .. } => read(x),
            Instruction::Unary { a, .. } => read(a),
            Instruction::Binary { a, b, .. } | Instruction::Less { a, b, .. } => {
                read(a);
                read(b);
            }
            Instruction::Fma { a, b, c, .. } => {
                read(a);
                read(b);
                read(c);
            }
            Instruction::Select { mask, a, b, .. } => {
                f(mask);
                for x in [a, b] {
                    if let Operand::Value(value) = x {
                        f(value);
                    }
                }
            }
            Instruction::Logic { a, b, .. } => {
                f(a);
                f(b);
            }
            Instruction::JumpIfNone { mask, .. } | Instruction::RefuseIfAny { mask } => f(mask),
            Instruction::Load { .. }
            | Instruction::Everywhere { .. }
            | Instruction::Label(_)
            | Instruction::LoopStart { .. }
            | Instruction::LoopEnd { .. } => {}
        }
    }
}

/// A program.
#[derive(Debug, Default)]
pub(crate) struct Code {
    pub instructions: Vec<Instruction>,
    /// The value of the recording that each belongs to; none of what is written at the end.
    pub sources: Vec<Option<u32>>,
    /// What each value is.
    pub kinds: Vec<Kind>,
    /// Where a value stands in memory anyway, for as long as it is used.
    pub homes: Vec<Option<Place>>,
    pub variables: u32,
    pub labels: u32,
    pub loops: u32,
}

impl Code {
    /// A new value.
    pub fn value(&mut self, kind: Kind, home: Option<Place>) -> u32 {
        self.kinds.push(kind);
        self.homes.push(home);
        self.kinds.len() as u32 - 1
    }
}

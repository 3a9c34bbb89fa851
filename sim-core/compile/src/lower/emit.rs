//! Adds instructions to a program.

use super::Lowering;
use crate::code::{Binary, Instruction, Kind, Label, Logic, Operand, Place, Unary};

impl Lowering<'_> {
    pub(super) fn unary(&mut self, op: Unary, a: Operand) -> Operand {
        let to = self.code.value(Kind::Scalar, None);
        self.emit(Instruction::Unary { op, to, a });
        Operand::Value(to)
    }

    pub(super) fn binary(&mut self, op: Binary, a: Operand, b: Operand) -> Operand {
        let to = self.code.value(Kind::Scalar, None);
        self.emit(Instruction::Binary { op, to, a, b });
        Operand::Value(to)
    }

    pub(super) fn select(&mut self, mask: u32, a: Operand, b: Operand) -> Operand {
        let to = self.code.value(Kind::Scalar, None);
        self.emit(Instruction::Select { to, mask, a, b });
        Operand::Value(to)
    }

    pub(super) fn logic(&mut self, op: Logic, a: u32, b: u32) -> u32 {
        let to = self.code.value(Kind::Mask, None);
        self.emit(Instruction::Logic { op, to, a, b });
        to
    }

    /// What is in memory now.
    pub(super) fn load(&mut self, from: Place) -> Operand {
        let to = self.code.value(Kind::Scalar, None);
        self.emit(Instruction::Load { to, from });
        Operand::Value(to)
    }

    /// Writes to memory where the mask holds.
    pub(super) fn store_where(&mut self, mask: u32, to: Place, x: Operand) {
        let before = self.load(to);
        let x = self.select(mask, x, before);
        self.emit(Instruction::Store { to, x });
    }

    pub(super) fn variable(&mut self) -> u32 {
        self.code.variables += 1;
        self.code.variables - 1
    }

    pub(super) fn label(&mut self) -> Label {
        self.code.labels += 1;
        self.code.labels - 1
    }

    /// Adds an instruction. An operand that cannot lie in memory is a value, so that a constant may stay in a register.
    pub(super) fn emit(&mut self, instruction: Instruction) {
        use Instruction::{Binary, Fma, Less, Select, Store};
        let instruction = match instruction {
            Store { to, x } => Store {
                to,
                x: self.in_register(x),
            },
            Binary { op, to, a, b } if op.commutes() => match (a, b) {
                (Operand::Constant(_), Operand::Value(_)) => Binary { op, to, a: b, b: a },
                (a, b) => Binary {
                    op,
                    to,
                    a: self.in_register(a),
                    b,
                },
            },
            Binary { op, to, a, b } => Binary {
                op,
                to,
                a: self.in_register(a),
                b,
            },
            Less { to, a, b } => Less {
                to,
                a: self.in_register(a),
                b,
            },
            // 0 is a case of its own
            Select { to, mask, a, b } if b != Operand::Constant(0) => Select {
                to,
                mask,
                a,
                b: self.in_register(b),
            },
            Fma {
                to,
                a,
                b,
                c,
                minus_product,
                minus_c,
            } => {
                let constants = [a, b, c].map(|x| matches!(x, Operand::Constant(_)));
                // one may lie in memory: the last
                let last = constants.iter().rposition(|is_constant| *is_constant);
                let mut operands = [a, b, c];
                for (k, x) in operands.iter_mut().enumerate() {
                    if last != Some(k) {
                        *x = self.in_register(*x);
                    }
                }
                let [a, b, c] = operands;
                Fma {
                    to,
                    a,
                    b,
                    c,
                    minus_product,
                    minus_c,
                }
            }
            other => other,
        };
        self.code.instructions.push(instruction);
        self.code.sources.push(self.source);
    }

    pub(super) fn in_register(&mut self, x: Operand) -> Operand {
        match x {
            Operand::Value(_) => x,
            Operand::Constant(bits) => {
                let code = &mut self.code;
                let value = self
                    .constants
                    .entry(bits)
                    .or_insert_with(|| code.value(Kind::Scalar, Some(Place::Constant(bits))));
                Operand::Value(*value)
            }
        }
    }
}

//! The machine instruction of an instruction, with registers for its operands and its result.

use super::Allocation;
use crate::code::{Instruction, Kind, Operand};
use crate::machine::{Form, Machine, Source};

impl Allocation<'_> {
    pub(super) fn instruction(&mut self, instruction: &Instruction) {
        self.pinned.clear();
        match *instruction {
            Instruction::Load { to, from } => {
                let kind = self.code.kinds[to as usize];
                self.result(to, &[], |register| Machine::Load {
                    kind,
                    to: register,
                    from: from.into(),
                });
            }
            Instruction::Store { to, x } => {
                let (from, kind) = (self.register(x), self.kind(x));
                self.release(&[x]);
                self.push(Machine::Store {
                    kind,
                    to: to.into(),
                    from,
                });
            }
            Instruction::Unary { op, to, a } => {
                let source = self.source(a);
                self.result(to, &[a], |register| Machine::Unary {
                    op,
                    to: register,
                    a: source,
                });
            }
            Instruction::Binary { op, to, a, b } => {
                let (a, b) = match op.commutes() && self.prefers_memory(a) {
                    true if !matches!(b, Operand::Constant(_)) => (b, a),
                    _ => (a, b),
                };
                let (first, second) = self.pair(a, b);
                self.result(to, &[a, b], |register| Machine::Binary {
                    op,
                    to: register,
                    a: first,
                    b: second,
                });
            }
            Instruction::Less { to, a, b } => {
                let (first, second) = self.pair(a, b);
                self.result(to, &[a, b], |register| Machine::Less {
                    to: register,
                    a: first,
                    b: second,
                });
            }
            Instruction::Select {
                to,
                mask,
                a,
                b: Operand::Constant(0),
            } => {
                let mask_register = self.register(Operand::Value(mask));
                let source = self.source(a);
                self.result(to, &[Operand::Value(mask), a], |register| Machine::Keep {
                    to: register,
                    mask: mask_register,
                    a: source,
                });
            }
            Instruction::Select { to, mask, a, b } => {
                let mask_register = self.register(Operand::Value(mask));
                let (second, first) = self.pair(b, a);
                self.result(to, &[Operand::Value(mask), a, b], |register| {
                    Machine::Select {
                        to: register,
                        mask: mask_register,
                        a: first,
                        b: second,
                    }
                });
            }
            Instruction::Fma {
                to,
                a,
                b,
                c,
                minus_product,
                minus_c,
            } => self.fma(to, [a, b, c], minus_product, minus_c),
            Instruction::Everywhere { to } => {
                self.result(to, &[], |register| Machine::Everywhere { to: register });
            }
            Instruction::Logic { op, to, a, b } => {
                let (first, second) = (
                    self.register(Operand::Value(a)),
                    self.register(Operand::Value(b)),
                );
                self.result(to, &[Operand::Value(a), Operand::Value(b)], |register| {
                    Machine::Logic {
                        op,
                        to: register,
                        a: first,
                        b: second,
                    }
                });
            }
            Instruction::JumpIfNone { mask, label } => {
                let register = self.register(Operand::Value(mask));
                self.release(&[Operand::Value(mask)]);
                self.push(Machine::JumpIfNone {
                    mask: register,
                    label,
                });
                self.meet(label);
            }
            Instruction::RefuseIfAny { mask } => {
                let register = self.register(Operand::Value(mask));
                self.release(&[Operand::Value(mask)]);
                self.push(Machine::RefuseIfAny { mask: register });
            }
            Instruction::Label(label) => self.label(label),
            Instruction::LoopStart { number } => self.loop_start(number),
            Instruction::LoopEnd {
                number,
                times,
                exit,
            } => self.loop_end(number, times, exit),
        }
    }

    /// `±a b ± c`: an instruction that overwrites one of the three, and has at most one in memory.
    fn fma(&mut self, to: u32, operands: [Operand; 3], minus_product: bool, minus_c: bool) {
        // at most one is a constant
        let memory = operands
            .iter()
            .position(|x| matches!(x, Operand::Constant(_)));
        let memory = memory.or_else(|| operands.iter().position(|x| self.prefers_memory(*x)));
        let mut sources = [None; 3];
        for (k, x) in operands.iter().enumerate() {
            if memory != Some(k) {
                sources[k] = Some(Source::Register(self.register(*x)));
            }
        }
        let sources = [0, 1, 2]
            .map(|k| sources[k].unwrap_or_else(|| Source::Memory(self.memory(operands[k]))));
        let register = |k: usize| match sources[k] {
            Source::Register(register) => Some(register),
            Source::Memory(_) => None,
        };
        // operands that are not needed afterwards may be overwritten
        let at = self.at;
        let ends = |this: &mut Self, k: usize| match operands[k] {
            Operand::Value(value) => register(k).is_some() && this.uses.after(value, at).is_none(),
            Operand::Constant(_) => false,
        };
        let target = [2, 0, 1].into_iter().find(|k| ends(self, *k));
        let (form, to_register, a, b) = match target {
            Some(2) => {
                let (x, y) = match register(0) {
                    Some(x) => (x, sources[1]),
                    None => (register(1).expect("one is in memory"), sources[0]),
                };
                self.release(&operands);
                let to_register = register(2).expect("it is overwritten");
                (Form::F231, to_register, x, y)
            }
            Some(k) => {
                let other = 1 - k;
                self.release(&operands);
                let to_register = register(k).expect("it is overwritten");
                match register(other) {
                    Some(x) if register(2).is_none() => (Form::F213, to_register, x, sources[2]),
                    _ => (
                        Form::F132,
                        to_register,
                        register(2).expect("one is in memory"),
                        sources[other],
                    ),
                }
            }
            None => {
                let (x, y) = match register(0) {
                    Some(x) => (x, sources[1]),
                    None => (register(1).expect("one is in memory"), sources[0]),
                };
                let copy = self.free(Kind::Scalar);
                self.push(match sources[2] {
                    Source::Register(from) => Machine::Copy { to: copy, from },
                    Source::Memory(from) => Machine::Load {
                        kind: Kind::Scalar,
                        to: copy,
                        from,
                    },
                });
                self.release(&operands);
                (Form::F231, copy, x, y)
            }
        };
        self.hold(to, to_register);
        let machine = Machine::Fma {
            form,
            to: to_register,
            a,
            b,
            minus_product,
            minus_c,
        };
        self.push_assigning(machine, to, to_register);
    }
}

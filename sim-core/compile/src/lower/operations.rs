//! Operations of a recording.

use super::Lowering;
use crate::code::{Binary, Instruction, Kind, Logic, Operand, Place, Unary};
use crate::error::CompileError;
use sim_record::ir::tree::{self, Entry, Op, Row};

/// All bits but the sign.
const MAGNITUDE: u32 = 0x7fff_ffff;

impl Lowering<'_> {
    pub(super) fn compute(&mut self, number: u32) -> Result<(), CompileError> {
        self.source = Some(number);
        let op = self.recording.value(number);
        let to = match op {
            // where they are used
            Op::Unary(tree::Unary::Neg | tree::Unary::Not, _) | Op::Input(_) => return Ok(()),
            Op::Get(name) => {
                let (variable, _) = self.variables[&name];
                self.load(Place::Variable(variable))
            }
            Op::Load(cell) => {
                let from = self.cell(&cell)?;
                self.load(from)
            }
            Op::Unary(unary, a) => {
                let a = self.scalar(a)?;
                match unary {
                    tree::Unary::Sqrt => self.unary(Unary::Sqrt, a),
                    tree::Unary::Round => self.unary(Unary::Round, a),
                    _ => self.binary(Binary::And, a, Operand::Constant(MAGNITUDE)),
                }
            }
            Op::Binary(binary, a, b) => self.of_two(binary, a, b)?,
            Op::Fma(a, b, c) => {
                let ((a, minus_a), (b, minus_b)) = (self.signed(a)?, self.signed(b)?);
                let (c, minus_c) = self.signed(c)?;
                let to = self.code.value(Kind::Scalar, None);
                self.emit(Instruction::Fma {
                    to,
                    a,
                    b,
                    c,
                    minus_product: minus_a != minus_b,
                    minus_c,
                });
                Operand::Value(to)
            }
            Op::Select(mask, a, b) => {
                let (mask, a, b) = (self.mask(mask)?, self.scalar(a)?, self.scalar(b)?);
                self.select(mask, a, b)
            }
            Op::Constant(Entry {
                table,
                row: Row::At(row),
                number,
            }) => {
                let at = table.base + row * table.stride + number;
                Operand::Constant(self.tables.numbers[at].to_bits())
            }
            other => return Err(CompileError::unknown(&other)),
        };
        self.values[number as usize] = Some(to);
        if self.recording.assumed() == Some(tree::Operand::Value(number)) {
            self.refuse_if_assumed_wrongly()?;
        }
        Ok(())
    }

    fn of_two(
        &mut self,
        binary: tree::Binary,
        a: tree::Operand,
        b: tree::Operand,
    ) -> Result<Operand, CompileError> {
        let op = match binary {
            tree::Binary::Lt => {
                let (a, b) = (self.scalar(a)?, self.scalar(b)?);
                let to = self.code.value(Kind::Mask, None);
                self.emit(Instruction::Less { to, a, b });
                return Ok(Operand::Value(to));
            }
            tree::Binary::And | tree::Binary::Or => {
                let logic = match binary {
                    tree::Binary::And => Logic::And,
                    _ => Logic::Or,
                };
                if let (Logic::And, Some(x)) = (logic, self.inverted(b)) {
                    let (x, a) = (self.mask(x)?, self.mask(a)?);
                    return Ok(Operand::Value(self.logic(Logic::NotAnd, x, a)));
                }
                let (a, b) = (self.mask(a)?, self.mask(b)?);
                return Ok(Operand::Value(self.logic(logic, a, b)));
            }
            tree::Binary::Add => Binary::Add,
            tree::Binary::Sub => Binary::Sub,
            tree::Binary::Mul => Binary::Mul,
            tree::Binary::Div => Binary::Div,
            tree::Binary::Min => Binary::Min,
            tree::Binary::Max => Binary::Max,
        };
        let (a, b) = (self.scalar(a)?, self.scalar(b)?);
        Ok(self.binary(op, a, b))
    }
}

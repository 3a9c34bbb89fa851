//! Operands of a recording: signs, masks, and what stands in memory.

use super::Lowering;
use crate::code::{Binary, Instruction, Kind, Logic, Operand, Place};
use crate::error::CompileError;
use sim_record::ir::tree::{self, Cell, Op, Row};

/// Bits of -0.
const SIGN: u32 = 0x8000_0000;

impl Lowering<'_> {
    /// An operand without its sign, and whether that is a minus.
    pub(super) fn signed(&mut self, x: tree::Operand) -> Result<(Operand, bool), CompileError> {
        if let tree::Operand::Value(number) = x
            && let Op::Unary(tree::Unary::Neg, x) = self.recording.value(number)
        {
            let (x, minus) = self.signed(x)?;
            return Ok((x, !minus));
        }
        Ok((self.unsigned(x)?, false))
    }

    pub(super) fn scalar(&mut self, x: tree::Operand) -> Result<Operand, CompileError> {
        let (x, minus) = self.signed(x)?;
        Ok(match (x, minus) {
            (x, false) => x,
            (Operand::Constant(bits), true) => Operand::Constant(bits ^ SIGN),
            (x, true) => self.binary(Binary::Xor, x, Operand::Constant(SIGN)),
        })
    }

    pub(super) fn unsigned(&mut self, x: tree::Operand) -> Result<Operand, CompileError> {
        match x {
            tree::Operand::Constant(bits) => Ok(Operand::Constant(bits)),
            tree::Operand::Truth(_) => Err(CompileError::unknown(&x)),
            tree::Operand::Value(number) => match self.recording.value(number) {
                Op::Input(input) => Ok(Operand::Value(self.input(input))),
                op => self.values[number as usize].ok_or_else(|| CompileError::unknown(&op)),
            },
        }
    }

    /// The mask that this is the inverse of.
    pub(super) fn inverted(&self, x: tree::Operand) -> Option<tree::Operand> {
        match x {
            tree::Operand::Value(number) => match self.recording.value(number) {
                Op::Unary(tree::Unary::Not, x) => Some(x),
                _ => None,
            },
            _ => None,
        }
    }

    pub(super) fn mask(&mut self, x: tree::Operand) -> Result<u32, CompileError> {
        if let Some(x) = self.inverted(x) {
            let (x, all) = (self.mask(x)?, self.everywhere());
            return Ok(self.logic(Logic::NotAnd, x, all));
        }
        match x {
            tree::Operand::Truth(true) => Ok(self.everywhere()),
            tree::Operand::Truth(false) => {
                let all = self.everywhere();
                Ok(self.logic(Logic::NotAnd, all, all))
            }
            tree::Operand::Value(number) => match self.values[number as usize] {
                Some(Operand::Value(value)) => Ok(value),
                _ => Err(CompileError::unknown(&x)),
            },
            tree::Operand::Constant(_) => Err(CompileError::unknown(&x)),
        }
    }

    /// A scalar in scratch memory.
    pub(super) fn cell(&self, cell: &Cell) -> Result<Place, CompileError> {
        let (Some(base), Row::At(row)) = (self.places.memory, cell.row) else {
            return Err(CompileError::unknown(cell));
        };
        let at = cell.table.base + row * cell.table.stride + cell.number;
        let at = at as u32;
        Ok(Place::Array { base, at })
    }

    pub(super) fn everywhere(&mut self) -> u32 {
        let to = self.code.value(Kind::Mask, None);
        self.emit(Instruction::Everywhere { to });
        to
    }

    pub(super) fn input(&mut self, input: u32) -> u32 {
        let home = self.places.inputs[input as usize].into();
        let code = &mut self.code;
        *(self.read.entry(input)).or_insert_with(|| code.value(Kind::Scalar, Some(home)))
    }
}

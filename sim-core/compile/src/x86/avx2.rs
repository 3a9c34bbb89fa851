//! AVX2 with FMA: 8 worlds in a register; a mask is a register whose lanes are all ones or all zeros.

use super::assembler::Assembler;
use super::{InstructionSet, logic};
use crate::code::{Binary, Kind};
use crate::machine::{Form, Machine, Register, Source};
use iced_x86::{Code, IcedError, Instruction, MemoryOperand, Register as X86};

pub(crate) struct Avx2;

/// `a < b`, false where either is NaN, and quiet about it.
const LESS: i32 = 0x11;

impl InstructionSet for Avx2 {
    const WIDTH: usize = 8;
    const BROADCASTS: bool = false;
    const SCALARS: usize = 16;
    const MASKS: Option<usize> = None;

    fn load(_kind: Kind, to: Register, from: MemoryOperand) -> Result<Instruction, IcedError> {
        Instruction::with2(Code::VEX_Vmovups_ymm_ymmm256, Self::scalar(to), from)
    }

    fn store(_kind: Kind, to: MemoryOperand, from: Register) -> Result<Instruction, IcedError> {
        Instruction::with2(Code::VEX_Vmovups_ymmm256_ymm, to, Self::scalar(from))
    }

    fn scalar(register: Register) -> X86 {
        X86::YMM0 + register as u32
    }

    fn copy() -> Code {
        Code::VEX_Vmovaps_ymm_ymmm256
    }

    fn sqrt() -> Code {
        Code::VEX_Vsqrtps_ymm_ymmm256
    }

    fn round() -> Code {
        Code::VEX_Vroundps_ymm_ymmm256_imm8
    }

    fn binary(op: Binary) -> Code {
        match op {
            Binary::Add => Code::VEX_Vaddps_ymm_ymm_ymmm256,
            Binary::Sub => Code::VEX_Vsubps_ymm_ymm_ymmm256,
            Binary::Mul => Code::VEX_Vmulps_ymm_ymm_ymmm256,
            Binary::Div => Code::VEX_Vdivps_ymm_ymm_ymmm256,
            Binary::Min => Code::VEX_Vminps_ymm_ymm_ymmm256,
            Binary::Max => Code::VEX_Vmaxps_ymm_ymm_ymmm256,
            Binary::And => Code::VEX_Vandps_ymm_ymm_ymmm256,
            Binary::Xor => Code::VEX_Vxorps_ymm_ymm_ymmm256,
        }
    }

    fn fma(form: Form, minus_product: bool, minus_c: bool) -> Code {
        match (form, minus_product, minus_c) {
            (Form::F132, false, false) => Code::VEX_Vfmadd132ps_ymm_ymm_ymmm256,
            (Form::F213, false, false) => Code::VEX_Vfmadd213ps_ymm_ymm_ymmm256,
            (Form::F231, false, false) => Code::VEX_Vfmadd231ps_ymm_ymm_ymmm256,
            (Form::F132, true, false) => Code::VEX_Vfnmadd132ps_ymm_ymm_ymmm256,
            (Form::F213, true, false) => Code::VEX_Vfnmadd213ps_ymm_ymm_ymmm256,
            (Form::F231, true, false) => Code::VEX_Vfnmadd231ps_ymm_ymm_ymmm256,
            (Form::F132, false, true) => Code::VEX_Vfmsub132ps_ymm_ymm_ymmm256,
            (Form::F213, false, true) => Code::VEX_Vfmsub213ps_ymm_ymm_ymmm256,
            (Form::F231, false, true) => Code::VEX_Vfmsub231ps_ymm_ymm_ymmm256,
            (Form::F132, true, true) => Code::VEX_Vfnmsub132ps_ymm_ymm_ymmm256,
            (Form::F213, true, true) => Code::VEX_Vfnmsub213ps_ymm_ymm_ymmm256,
            (Form::F231, true, true) => Code::VEX_Vfnmsub231ps_ymm_ymm_ymmm256,
        }
    }

    fn mask(assembler: &mut Assembler, machine: &Machine) -> Result<(), IcedError> {
        let scalar = Self::scalar;
        let instruction = match *machine {
            Machine::Less { to, a, b } => {
                let code = Code::VEX_Vcmpps_ymm_ymm_ymmm256_imm8;
                match b {
                    Source::Register(b) => {
                        Instruction::with4(code, scalar(to), scalar(a), scalar(b), LESS)?
                    }
                    Source::Memory(b) => {
                        Instruction::with4(code, scalar(to), scalar(a), assembler.memory(b)?, LESS)?
                    }
                }
            }
            Machine::Select { to, mask, a, b } => {
                let code = Code::VEX_Vblendvps_ymm_ymm_ymmm256_ymm;
                match a {
                    Source::Register(a) => {
                        Instruction::with4(code, scalar(to), scalar(b), scalar(a), scalar(mask))?
                    }
                    Source::Memory(a) => {
                        let a = assembler.memory(a)?;
                        Instruction::with4(code, scalar(to), scalar(b), a, scalar(mask))?
                    }
                }
            }
            Machine::Keep { to, mask, a } => {
                let code = Code::VEX_Vandps_ymm_ymm_ymmm256;
                match a {
                    Source::Register(a) => {
                        Instruction::with3(code, scalar(to), scalar(mask), scalar(a))?
                    }
                    Source::Memory(a) => {
                        Instruction::with3(code, scalar(to), scalar(mask), assembler.memory(a)?)?
                    }
                }
            }
            Machine::Everywhere { to } => {
                let to = scalar(to);
                Instruction::with3(Code::VEX_Vpcmpeqd_ymm_ymm_ymmm256, to, to, to)?
            }
            Machine::Logic { op, to, a, b } => {
                let codes = [
                    Code::VEX_Vandps_ymm_ymm_ymmm256,
                    Code::VEX_Vorps_ymm_ymm_ymmm256,
                    Code::VEX_Vandnps_ymm_ymm_ymmm256,
                ];
                Instruction::with3(logic(op, codes), scalar(to), scalar(a), scalar(b))?
            }
            ref other => unreachable!("{other:?} is the same in all sets"),
        };
        assembler.push(&instruction)
    }

    fn test(assembler: &mut Assembler, tested: Register) -> Result<(), IcedError> {
        let tested = Self::scalar(tested);
        assembler.push(&Instruction::with2(
            Code::VEX_Vtestps_ymm_ymmm256,
            tested,
            tested,
        )?)
    }
}

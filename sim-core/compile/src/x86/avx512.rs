//! AVX-512: 16 worlds in a register, masks in registers of their own.

use super::assembler::Assembler;
use super::{InstructionSet, logic};
use crate::code::{Binary, Kind};
use crate::machine::{Form, Machine, Memory, Register, Source};
use iced_x86::{Code, IcedError, Instruction, MemoryOperand, Register as X86};

pub(crate) struct Avx512;

/// `a < b`, false where either is NaN, and quiet about it.
const LESS: i32 = 0x11;

/// k0 stands for no mask where an instruction may have one.
fn mask(register: Register) -> X86 {
    X86::K1 + register as u32
}

impl InstructionSet for Avx512 {
    const WIDTH: usize = 16;
    const BROADCASTS: bool = true;
    const SCALARS: usize = 32;
    const MASKS: Option<usize> = Some(7);

    fn load(kind: Kind, to: Register, from: MemoryOperand) -> Result<Instruction, IcedError> {
        match kind {
            Kind::Scalar => {
                Instruction::with2(Code::EVEX_Vmovups_zmm_k1z_zmmm512, Self::scalar(to), from)
            }
            Kind::Mask => Instruction::with2(Code::VEX_Kmovw_kr_km16, mask(to), from),
        }
    }

    fn store(kind: Kind, to: MemoryOperand, from: Register) -> Result<Instruction, IcedError> {
        match kind {
            Kind::Scalar => {
                Instruction::with2(Code::EVEX_Vmovups_zmmm512_k1z_zmm, to, Self::scalar(from))
            }
            Kind::Mask => Instruction::with2(Code::VEX_Kmovw_m16_kr, to, mask(from)),
        }
    }

    fn scalar(register: Register) -> X86 {
        X86::ZMM0 + register as u32
    }

    fn copy() -> Code {
        Code::EVEX_Vmovaps_zmm_k1z_zmmm512
    }

    fn sqrt() -> Code {
        Code::EVEX_Vsqrtps_zmm_k1z_zmmm512b32_er
    }

    fn round() -> Code {
        Code::EVEX_Vrndscaleps_zmm_k1z_zmmm512b32_imm8_sae
    }

    fn binary(op: Binary) -> Code {
        match op {
            Binary::Add => Code::EVEX_Vaddps_zmm_k1z_zmm_zmmm512b32_er,
            Binary::Sub => Code::EVEX_Vsubps_zmm_k1z_zmm_zmmm512b32_er,
            Binary::Mul => Code::EVEX_Vmulps_zmm_k1z_zmm_zmmm512b32_er,
            Binary::Div => Code::EVEX_Vdivps_zmm_k1z_zmm_zmmm512b32_er,
            Binary::Min => Code::EVEX_Vminps_zmm_k1z_zmm_zmmm512b32_sae,
            Binary::Max => Code::EVEX_Vmaxps_zmm_k1z_zmm_zmmm512b32_sae,
            Binary::And => Code::EVEX_Vandps_zmm_k1z_zmm_zmmm512b32,
            Binary::Xor => Code::EVEX_Vxorps_zmm_k1z_zmm_zmmm512b32,
        }
    }

    fn fma(form: Form, minus_product: bool, minus_c: bool) -> Code {
        match (form, minus_product, minus_c) {
            (Form::F132, false, false) => Code::EVEX_Vfmadd132ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F213, false, false) => Code::EVEX_Vfmadd213ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F231, false, false) => Code::EVEX_Vfmadd231ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F132, true, false) => Code::EVEX_Vfnmadd132ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F213, true, false) => Code::EVEX_Vfnmadd213ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F231, true, false) => Code::EVEX_Vfnmadd231ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F132, false, true) => Code::EVEX_Vfmsub132ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F213, false, true) => Code::EVEX_Vfmsub213ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F231, false, true) => Code::EVEX_Vfmsub231ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F132, true, true) => Code::EVEX_Vfnmsub132ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F213, true, true) => Code::EVEX_Vfnmsub213ps_zmm_k1z_zmm_zmmm512b32_er,
            (Form::F231, true, true) => Code::EVEX_Vfnmsub231ps_zmm_k1z_zmm_zmmm512b32_er,
        }
    }

    fn mask(assembler: &mut Assembler, machine: &Machine) -> Result<(), IcedError> {
        let scalar = Self::scalar;
        let instruction = match *machine {
            Machine::Less { to, a, b } => {
                let code = Code::EVEX_Vcmpps_kr_k1_zmm_zmmm512b32_imm8_sae;
                match b {
                    Source::Register(b) => {
                        Instruction::with4(code, mask(to), scalar(a), scalar(b), LESS)?
                    }
                    Source::Memory(b) => {
                        Instruction::with4(code, mask(to), scalar(a), assembler.memory(b)?, LESS)?
                    }
                }
            }
            Machine::Select {
                to,
                mask: chosen,
                a,
                b,
            } => {
                let code = Code::EVEX_Vblendmps_zmm_k1z_zmm_zmmm512b32;
                let mut blend = match a {
                    Source::Register(a) => {
                        Instruction::with3(code, scalar(to), scalar(b), scalar(a))?
                    }
                    Source::Memory(a) => {
                        Instruction::with3(code, scalar(to), scalar(b), assembler.memory(a)?)?
                    }
                };
                blend.set_op_mask(mask(chosen));
                blend
            }
            Machine::Keep { to, mask: kept, a } => {
                let code = Code::EVEX_Vmovups_zmm_k1z_zmmm512;
                let mut keep = match a {
                    Source::Register(a) => Instruction::with2(code, scalar(to), scalar(a))?,
                    Source::Memory(constant @ Memory::Constant(_)) => {
                        let from = MemoryOperand {
                            is_broadcast: false,
                            ..assembler.memory(constant)?
                        };
                        let spread = Code::EVEX_Vbroadcastss_zmm_k1z_xmmm32;
                        Instruction::with2(spread, scalar(to), from)?
                    }
                    Source::Memory(a) => {
                        Instruction::with2(code, scalar(to), assembler.memory(a)?)?
                    }
                };
                keep.set_op_mask(mask(kept));
                keep.set_zeroing_masking(true);
                keep
            }
            Machine::Everywhere { to } => {
                let to = mask(to);
                Instruction::with3(Code::VEX_Kxnorw_kr_kr_kr, to, to, to)?
            }
            Machine::Logic { op, to, a, b } => {
                let codes = [
                    Code::VEX_Kandw_kr_kr_kr,
                    Code::VEX_Korw_kr_kr_kr,
                    Code::VEX_Kandnw_kr_kr_kr,
                ];
                Instruction::with3(logic(op, codes), mask(to), mask(a), mask(b))?
            }
            ref other => unreachable!("{other:?} is the same in all sets"),
        };
        assembler.push(&instruction)
    }

    fn test(assembler: &mut Assembler, tested: Register) -> Result<(), IcedError> {
        let tested = mask(tested);
        assembler.push(&Instruction::with2(
            Code::VEX_Kortestw_kr_kr,
            tested,
            tested,
        )?)
    }
}

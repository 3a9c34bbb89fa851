//! Bytes so far, addresses, and where jumps lead.

use super::{Encoded, InstructionSet};
use crate::code::Unary;
use crate::machine::{Machine, Memory, Source};
use iced_x86::{
    Code, Encoder, FastFormatter, IcedError, Instruction, MemoryOperand, Register as X86,
};
use std::collections::HashMap;

/// Holds the addresses of the caller's arrays.
const ARRAYS: X86 = X86::RDI;
/// Holds the address of the constants.
const CONSTANTS: X86 = X86::RSI;
/// Holds an address amid the slots: near ones are encoded shorter.
const SLOTS: X86 = X86::RDX;
/// Registers from the first slot to that address, and constants from the first one to theirs.
const SLOTS_BEFORE: i64 = 128;
const CONSTANTS_BEFORE: i64 = 128;
/// Hold addresses of arrays. The caller does not expect to find them as they were.
const BASES: [X86; 6] = [X86::RAX, X86::RCX, X86::R8, X86::R9, X86::R10, X86::R11];

pub(crate) struct Assembler {
    encoder: Encoder,
    position: usize,
    instructions: usize,
    /// Bytes of a register.
    bytes: i64,
    broadcasts: bool,
    slots: u32,
    /// Constants by their bits: where each lies.
    constants: HashMap<u32, u32>,
    order: Vec<f32>,
    /// Which array the address in each of [`BASES`] is of, and when it was used last.
    bases: [Option<(u32, usize)>; BASES.len()],
    labels: Vec<Option<usize>>,
    starts: Vec<Option<usize>>,
    /// Jumps to labels and to starts: where they end, and the number.
    to_labels: Vec<(usize, u32)>,
    to_starts: Vec<(usize, u32)>,
    to_refusal: Vec<(usize, u32)>,
    /// Where a program ends that refuses.
    refusal: usize,
    /// Instructions and where they begin, if someone asks for them.
    pub listing: Option<Vec<(u32, Instruction)>>,
}

impl Assembler {
    pub fn new(width: usize, broadcasts: bool, slots: u32, loops: u32, labels: u32) -> Assembler {
        Assembler {
            encoder: Encoder::new(64),
            position: 0,
            instructions: 0,
            bytes: (width * size_of::<f32>()) as i64,
            broadcasts,
            slots,
            constants: HashMap::new(),
            order: Vec::new(),
            bases: [None; BASES.len()],
            labels: vec![None; labels as usize],
            starts: vec![None; loops as usize],
            to_labels: Vec::new(),
            to_starts: Vec::new(),
            to_refusal: Vec::new(),
            refusal: 0,
            listing: None,
        }
    }

    /// Bytes so far.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Moves the addresses of slots and constants to their middle.
    pub fn begin(&mut self) -> Result<(), IcedError> {
        let constants = CONSTANTS_BEFORE * self.constant_bytes();
        for (register, before) in [(SLOTS, SLOTS_BEFORE * self.bytes), (CONSTANTS, constants)] {
            let before = before as i32;
            self.push(&Instruction::with2(Code::Add_rm64_imm32, register, before)?)?;
        }
        Ok(())
    }

    /// Returns to the caller: 0, or 1 where the program refused.
    pub fn end(&mut self) -> Result<(), IcedError> {
        for result in [0, 1] {
            if result == 1 {
                self.refusal = self.position;
            }
            self.push(&Instruction::with2(Code::Mov_r32_imm32, X86::EAX, result)?)?;
            self.push(&Instruction::with(Code::VEX_Vzeroupper))?;
            self.push(&Instruction::with(Code::Retnq))?;
        }
        Ok(())
    }

    /// The bytes, with jumps that lead where they should.
    pub fn finish(mut self, starts: Vec<u32>) -> Encoded {
        let mut listing = self.listing.take().unwrap_or_default();
        let mut bytes = self.encoder.take_buffer();
        let refusal = [Some(self.refusal)];
        let jumps = [
            (&self.to_labels, &self.labels[..]),
            (&self.to_starts, &self.starts[..]),
            (&self.to_refusal, &refusal[..]),
        ];
        for (jumps, places) in jumps {
            for (end, number) in jumps {
                let place = places[*number as usize].expect("a jump leads somewhere");
                let distance = place as i64 - *end as i64;
                let distance = i32::try_from(distance).expect("a program is below 2 GB");
                bytes[end - 4..*end].copy_from_slice(&distance.to_le_bytes());
                // the jump is the last instruction that begins before its end
                let after = listing.partition_point(|(start, _)| (*start as usize) < *end);
                if let Some((_, jump)) = listing[..after].last_mut() {
                    jump.set_near_branch64(place as u64);
                }
            }
        }
        Encoded {
            bytes,
            constants: self.order,
            instructions: self.instructions,
            starts,
            listing: texts(&listing),
        }
    }

    pub fn push(&mut self, instruction: &Instruction) -> Result<(), IcedError> {
        if let Some(listing) = &mut self.listing {
            listing.push((self.position as u32, *instruction));
        }
        self.position += self.encoder.encode(instruction, self.position as u64)?;
        self.instructions += 1;
        Ok(())
    }

    pub fn machine<S: InstructionSet>(&mut self, machine: &Machine) -> Result<(), IcedError> {
        match *machine {
            Machine::Load { kind, to, from } => {
                let memory = self.memory(from)?;
                let instruction = match from {
                    Memory::Constant(_) if self.broadcasts => Instruction::with2(
                        Code::EVEX_Vbroadcastss_zmm_k1z_xmmm32,
                        S::scalar(to),
                        MemoryOperand {
                            is_broadcast: false,
                            ..memory
                        },
                    )?,
                    _ => S::load(kind, to, memory)?,
                };
                self.push(&instruction)
            }
            Machine::Store { kind, to, from } => {
                let memory = self.memory(to)?;
                self.push(&S::store(kind, memory, from)?)
            }
            Machine::Copy { to, from } => self.push(&Instruction::with2(
                S::copy(),
                S::scalar(to),
                S::scalar(from),
            )?),
            Machine::Unary { op, to, a } => {
                let to = S::scalar(to);
                let instruction = match (op, a) {
                    (Unary::Sqrt, Source::Register(a)) => {
                        Instruction::with2(S::sqrt(), to, S::scalar(a))?
                    }
                    (Unary::Sqrt, Source::Memory(a)) => {
                        Instruction::with2(S::sqrt(), to, self.memory(a)?)?
                    }
                    // to the nearest, ties to even; without a report of inexact results
                    (Unary::Round, Source::Register(a)) => {
                        Instruction::with3(S::round(), to, S::scalar(a), 8)?
                    }
                    (Unary::Round, Source::Memory(a)) => {
                        Instruction::with3(S::round(), to, self.memory(a)?, 8)?
                    }
                };
                self.push(&instruction)
            }
            Machine::Binary { op, to, a, b } => self.three::<S>(S::binary(op), to, a, b),
            Machine::Fma {
                form,
                to,
                a,
                b,
                minus_product,
                minus_c,
            } => self.three::<S>(S::fma(form, minus_product, minus_c), to, a, b),
            Machine::Less { .. }
            | Machine::Select { .. }
            | Machine::Keep { .. }
            | Machine::Everywhere { .. }
            | Machine::Logic { .. } => S::mask(self, machine),
            Machine::JumpIfNone { mask, label } => {
                S::test(self, mask)?;
                self.jump(Code::Je_rel32_64)?;
                self.to_labels.push((self.position, label));
                Ok(())
            }
            Machine::RefuseIfAny { mask } => {
                S::test(self, mask)?;
                self.jump(Code::Jne_rel32_64)?;
                self.to_refusal.push((self.position, 0));
                Ok(())
            }
            Machine::Label(label) => {
                self.labels[label as usize] = Some(self.position);
                self.bases = [None; BASES.len()];
                Ok(())
            }
            Machine::LoopStart { number } => {
                let counter = self.counter(number);
                self.push(&Instruction::with2(Code::Mov_rm64_imm32, counter, 0)?)?;
                self.starts[number as usize] = Some(self.position);
                self.bases = [None; BASES.len()];
                Ok(())
            }
            Machine::Count {
                number,
                times,
                exit,
            } => {
                let counter = self.counter(number);
                self.push(&Instruction::with2(Code::Add_rm64_imm32, counter, 1)?)?;
                self.push(&Instruction::with2(
                    Code::Cmp_rm64_imm32,
                    counter,
                    times as i32,
                )?)?;
                self.jump(Code::Jae_rel32_64)?;
                self.to_labels.push((self.position, exit));
                Ok(())
            }
            Machine::Again { number } => {
                self.jump(Code::Jmp_rel32_64)?;
                self.to_starts.push((self.position, number));
                Ok(())
            }
        }
    }

    fn three<S: InstructionSet>(
        &mut self,
        code: Code,
        to: u8,
        a: u8,
        b: Source,
    ) -> Result<(), IcedError> {
        let (to, a) = (S::scalar(to), S::scalar(a));
        let instruction = match b {
            Source::Register(b) => Instruction::with3(code, to, a, S::scalar(b))?,
            Source::Memory(b) => Instruction::with3(code, to, a, self.memory(b)?)?,
        };
        self.push(&instruction)
    }

    /// A jump whose distance is not known yet.
    fn jump(&mut self, code: Code) -> Result<(), IcedError> {
        // far, so that the distance has four bytes
        let target = self.position as u64 + 0x1000_0000;
        self.push(&Instruction::with_branch(code, target)?)
    }

    fn counter(&self, number: u32) -> MemoryOperand {
        let first = (i64::from(self.slots) - SLOTS_BEFORE) * self.bytes;
        address(
            SLOTS,
            first + i64::from(number) * size_of::<u64>() as i64,
            false,
        )
    }

    /// An operand in memory.
    pub fn memory(&mut self, memory: Memory) -> Result<MemoryOperand, IcedError> {
        Ok(match memory {
            Memory::Slot(slot) => {
                let at = (i64::from(slot) - SLOTS_BEFORE) * self.bytes;
                address(SLOTS, at, false)
            }
            Memory::Constant(bits) => {
                let at = self.constant(bits);
                address(CONSTANTS, at, self.broadcasts)
            }
            Memory::Array { base, at } => {
                let register = self.base(base)?;
                address(register, i64::from(at) * self.bytes, false)
            }
            Memory::Spilled(value) => unreachable!("value {value} has a slot by now"),
        })
    }

    /// Bytes of a constant.
    fn constant_bytes(&self) -> i64 {
        match self.broadcasts {
            true => size_of::<f32>() as i64,
            false => self.bytes,
        }
    }

    fn constant(&mut self, bits: u32) -> i64 {
        let copies = self.constant_bytes() as usize / size_of::<f32>();
        let next = self.constants.len() as u32;
        let order = &mut self.order;
        let place = *self.constants.entry(bits).or_insert_with(|| {
            order.extend(std::iter::repeat_n(f32::from_bits(bits), copies));
            next
        });
        (i64::from(place) - CONSTANTS_BEFORE) * self.constant_bytes()
    }

    /// A register with the address of an array.
    fn base(&mut self, array: u32) -> Result<X86, IcedError> {
        let now = self.position;
        let held = (self.bases.iter()).position(|held| held.is_some_and(|(a, _)| a == array));
        let k = match held {
            Some(k) => k,
            None => {
                let oldest =
                    (0..BASES.len()).min_by_key(|&k| self.bases[k].map_or(0, |(_, at)| at + 1));
                let k = oldest.expect("there are some");
                let from = address(ARRAYS, i64::from(array) * size_of::<u64>() as i64, false);
                self.push(&Instruction::with2(Code::Mov_r64_rm64, BASES[k], from)?)?;
                k
            }
        };
        self.bases[k] = Some((array, now));
        Ok(BASES[k])
    }
}

/// Instructions for people.
fn texts(listing: &[(u32, Instruction)]) -> Vec<(u32, String)> {
    let mut formatter = FastFormatter::new();
    let texts = listing.iter().map(|(start, instruction)| {
        let mut text = String::new();
        formatter.format(instruction, &mut text);
        (*start, text)
    });
    texts.collect()
}

fn address(base: X86, displacement: i64, is_broadcast: bool) -> MemoryOperand {
    // the encoder shortens it where it can
    let size = 1;
    MemoryOperand::new(
        base,
        X86::None,
        1,
        displacement,
        size,
        is_broadcast,
        X86::None,
    )
}

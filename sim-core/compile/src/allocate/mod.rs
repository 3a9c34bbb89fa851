//! Register allocation: what is used farthest ahead leaves first (Belady 1966), over the linear order.
//!
//! A value that leaves is stored once, where it was assigned, so that every path finds it in memory. Where paths meet, a register
//! keeps what all of them left in it. A loop ends with the registers as it began.

mod registers;
mod select;
mod slots;
mod uses;

use crate::code::{Code, Kind, Operand};
use crate::machine::{Machine, Memory, Register, Source};
pub(crate) use registers::Files;
use registers::Registers;
use slots::Lifetime;
use uses::Uses;

/// Machine instructions, and how many registers of memory they use.
pub(crate) struct Allocated {
    pub machine: Vec<Machine>,
    /// The instruction that each belongs to.
    pub sources: Vec<u32>,
    pub slots: u32,
    /// Values that had to leave the registers.
    pub spills: usize,
}

/// Gives out the registers.
pub(crate) fn allocate(code: &Code, files: Files) -> Allocated {
    let mut allocation = Allocation {
        code,
        uses: Uses::find(code),
        registers: Registers::new(files),
        register_of: vec![None; code.kinds.len()],
        pinned: Vec::new(),
        spilled: vec![false; code.kinds.len()],
        assigned_at: vec![0; code.kinds.len()],
        at: 0,
        machine: Vec::with_capacity(code.instructions.len() * 2),
        labels: (0..code.labels).map(|_| None).collect(),
        starts: (0..code.loops).map(|_| None).collect(),
        reachable: true,
    };
    for (at, instruction) in code.instructions.iter().enumerate() {
        allocation.at = at as u32;
        allocation.instruction(instruction);
    }
    allocation.finish()
}

/// A machine instruction.
struct Emitted {
    machine: Machine,
    /// The instruction that it belongs to.
    source: u32,
    /// The value that it assigns, and its register.
    assigned: Option<(u32, Register)>,
}

struct Allocation<'a> {
    code: &'a Code,
    uses: Uses,
    registers: Registers,
    register_of: Vec<Option<Register>>,
    /// Values that the present instruction needs.
    pinned: Vec<u32>,
    spilled: Vec<bool>,
    assigned_at: Vec<u32>,
    at: u32,
    machine: Vec<Emitted>,
    /// What the registers hold where a label is jumped to.
    labels: Vec<Option<Registers>>,
    /// What they held where a loop began.
    starts: Vec<Option<Registers>>,
    /// Does the instruction before lead here?
    reachable: bool,
}

impl Allocation<'_> {
    /// Two operands, the second of which may lie in memory.
    fn pair(&mut self, a: Operand, b: Operand) -> (Register, Source) {
        (self.register(a), self.source(b))
    }

    /// Is it in memory, and not needed soon after?
    fn prefers_memory(&mut self, x: Operand) -> bool {
        match x {
            Operand::Constant(_) => true,
            Operand::Value(value) => {
                self.register_of[value as usize].is_none()
                    && self.uses.after(value, self.at).is_none()
            }
        }
    }

    /// Where an operand that may lie in memory is.
    fn source(&mut self, x: Operand) -> Source {
        match self.prefers_memory(x) {
            true => Source::Memory(self.memory(x)),
            false => Source::Register(self.register(x)),
        }
    }

    fn memory(&mut self, x: Operand) -> Memory {
        match x {
            Operand::Constant(bits) => Memory::Constant(bits),
            Operand::Value(value) => match self.code.homes[value as usize] {
                Some(home) => home.into(),
                None => {
                    self.spilled[value as usize] = true;
                    Memory::Spilled(value)
                }
            },
        }
    }

    fn kind(&self, x: Operand) -> Kind {
        match x {
            Operand::Constant(_) => Kind::Scalar,
            Operand::Value(value) => self.code.kinds[value as usize],
        }
    }

    /// The register of an operand, which is loaded if it is in none.
    fn register(&mut self, x: Operand) -> Register {
        let Operand::Value(value) = x else {
            unreachable!("a constant that must be in a register is a value");
        };
        self.pinned.push(value);
        if let Some(register) = self.register_of[value as usize] {
            return register;
        }
        let kind = self.code.kinds[value as usize];
        let from = self.memory(x);
        let to = self.free(kind);
        self.push(Machine::Load { kind, to, from });
        self.hold(value, to);
        to
    }

    /// A register that holds nothing: if none does, the one whose value is used farthest ahead.
    fn free(&mut self, kind: Kind) -> Register {
        let file = self.registers.file(kind);
        if let Some(register) = file.iter().position(Option::is_none) {
            return register as Register;
        }
        let (mut farthest, mut register) = (0, None);
        for (k, value) in file.iter().enumerate() {
            let value = value.expect("no register is empty");
            if self.pinned.contains(&value) {
                continue;
            }
            let next = self.uses.after(value, self.at).unwrap_or(u32::MAX);
            if register.is_none() || next > farthest {
                (farthest, register) = (next, Some((k, value)));
            }
        }
        let (register, value) = register.expect("more registers than operands");
        self.drop_value(value);
        register as Register
    }

    /// A value leaves its register.
    fn drop_value(&mut self, value: u32) {
        if let Some(register) = self.register_of[value as usize].take() {
            let kind = self.code.kinds[value as usize];
            self.registers.file_mut(kind)[register as usize] = None;
        }
    }

    /// Frees the registers of operands that are not used again.
    fn release(&mut self, operands: &[Operand]) {
        for x in operands {
            if let Operand::Value(value) = *x
                && self.uses.after(value, self.at).is_none()
            {
                self.drop_value(value);
            }
        }
    }

    fn hold(&mut self, value: u32, register: Register) {
        let kind = self.code.kinds[value as usize];
        self.registers.file_mut(kind)[register as usize] = Some(value);
        self.register_of[value as usize] = Some(register);
    }

    /// A register for a value that the instruction assigns.
    fn assign(&mut self, value: u32) -> Register {
        let register = self.free(self.code.kinds[value as usize]);
        self.hold(value, register);
        register
    }

    /// An instruction that assigns a value; its operands may give their registers to it.
    fn result(&mut self, value: u32, operands: &[Operand], make: impl FnOnce(Register) -> Machine) {
        self.release(operands);
        let register = self.assign(value);
        self.push_assigning(make(register), value, register);
    }

    fn push(&mut self, machine: Machine) {
        self.emit(machine, None);
    }

    fn emit(&mut self, machine: Machine, assigned: Option<(u32, Register)>) {
        self.machine.push(Emitted {
            machine,
            source: self.at,
            assigned,
        });
    }

    fn push_assigning(&mut self, machine: Machine, value: u32, register: Register) {
        self.emit(machine, Some((value, register)));
        self.assigned_at[value as usize] = self.at;
        if self.uses.after(value, self.at).is_none() {
            self.drop_value(value);
        }
    }

    /// A jump leads to the label with the registers as they are.
    fn meet(&mut self, label: u32) {
        let at_label = &mut self.labels[label as usize];
        match at_label {
            Some(at_label) => at_label.keep_common(&self.registers),
            None => *at_label = Some(self.registers.clone()),
        }
    }

    fn label(&mut self, label: u32) {
        if self.reachable {
            self.meet(label);
        }
        self.reachable = true;
        self.push(Machine::Label(label));
        let mut registers = (self.labels[label as usize].take()).expect("something leads here");
        let held: Vec<(Register, u32)> = registers.held().collect();
        // what is not used again needs no register
        for (register, value) in held {
            if self.uses.after(value, self.at).is_none() {
                let kind = self.code.kinds[value as usize];
                registers.file_mut(kind)[register as usize] = None;
            }
        }
        self.go_on_with(registers);
    }

    fn go_on_with(&mut self, registers: Registers) {
        let before: Vec<u32> = self.registers.held().map(|(_, value)| value).collect();
        for value in before {
            self.register_of[value as usize] = None;
        }
        for (register, value) in registers.held() {
            self.register_of[value as usize] = Some(register);
        }
        self.registers = registers;
    }

    /// What the loop does not use leaves: its registers are the loop's.
    fn loop_start(&mut self, number: u32) {
        let end = self.uses.ends[number as usize];
        let held: Vec<u32> = self.registers.held().map(|(_, value)| value).collect();
        for value in held {
            if self
                .uses
                .after(value, self.at)
                .is_none_or(|next| next > end)
            {
                self.drop_value(value);
            }
        }
        self.push(Machine::LoopStart { number });
        self.starts[number as usize] = Some(self.registers.clone());
    }

    fn loop_end(&mut self, number: u32, times: u32, exit: u32) {
        self.push(Machine::Count {
            number,
            times,
            exit,
        });
        self.meet(exit);
        let start = self.starts[number as usize].take().expect("the loop began");
        for (register, value) in start.held().collect::<Vec<_>>() {
            let kind = self.code.kinds[value as usize];
            if self.registers.file(kind)[register as usize] != Some(value) {
                let from = self.memory(Operand::Value(value));
                self.push(Machine::Load {
                    kind,
                    to: register,
                    from,
                });
            }
        }
        self.push(Machine::Again { number });
        self.reachable = false;
    }

    fn finish(self) -> Allocated {
        let spilled = (0..self.code.kinds.len() as u32).filter(|v| self.spilled[*v as usize]);
        let mut lifetimes: Vec<Lifetime> = spilled
            .map(|value| Lifetime {
                value,
                first: self.assigned_at[value as usize],
                last: self.uses.last(value).expect("what is stored is used"),
            })
            .collect();
        let (slots, end) = slots::give(&mut lifetimes, self.code.kinds.len(), self.code.variables);
        let length = self.machine.len() + lifetimes.len();
        let (mut machine, mut sources) = (Vec::with_capacity(length), Vec::with_capacity(length));
        for mut emitted in self.machine {
            slots::settle(&mut emitted.machine, &slots);
            machine.push(emitted.machine);
            sources.push(emitted.source);
            if let Some((value, from)) = emitted.assigned
                && self.spilled[value as usize]
            {
                machine.push(Machine::Store {
                    kind: self.code.kinds[value as usize],
                    to: Memory::Slot(slots[value as usize]),
                    from,
                });
                sources.push(emitted.source);
            }
        }
        Allocated {
            machine,
            sources,
            slots: end,
            spills: lifetimes.len(),
        }
    }
}

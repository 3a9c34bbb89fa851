//! Runs a recording on the CPU, one world at a time: the check on the program where no GPU is.

use super::Recording;
use super::tree::{Binary, Cell, Op, Operand, Rounds, Row, Statement, Unary};
use crate::lane::Num;

/// Should the statements after this one be run?
#[derive(PartialEq)]
enum Flow {
    On,
    LoopEnds,
}

struct Machine<'a> {
    recording: &'a Recording,
    inputs: &'a [f32],
    scratch: &'a mut [f32],
    /// Results by number; masks are 1 or 0.
    values: Vec<f32>,
    variables: Vec<f32>,
    /// Lengths of lists, indices of loops, rows.
    counts: Vec<usize>,
}

impl Recording {
    /// The outputs for these inputs, in `f32` with fused `fma`, for one world.
    ///
    /// Equal to what the text gives in scalar `f32`, bit for bit up to the sign of zeros, as long
    /// as the numbers are finite: folding keeps every rounding.
    ///
    /// # Panics
    /// If there are not as many inputs as were recorded, or fewer numbers of scratch memory than
    /// [`Recording::scratch`] says.
    pub fn evaluate(&self, inputs: &[f32], scratch: &mut [f32]) -> Vec<f32> {
        assert_eq!(
            inputs.len(),
            self.inputs,
            "one number for every recorded input"
        );
        assert!(
            scratch.len() >= self.scratch(),
            "scratch memory for every table"
        );
        let mut machine = Machine {
            recording: self,
            inputs,
            scratch,
            values: vec![0.0; self.values.len()],
            variables: vec![0.0; self.names],
            counts: vec![0; self.names],
        };
        machine.values[..inputs.len()].copy_from_slice(inputs);
        machine.run(&self.body);
        self.outputs.iter().map(|x| machine.operand(*x)).collect()
    }
}

impl Machine<'_> {
    fn run(&mut self, body: &[Statement]) -> Flow {
        for statement in body {
            match statement {
                Statement::Let(number) => {
                    let op = self.recording.values[*number as usize];
                    self.values[*number as usize] = self.compute(op);
                }
                Statement::Var { name, value } | Statement::Set { name, value } => {
                    self.variables[*name as usize] = self.operand(*value);
                }
                Statement::Store { cell, value } => {
                    let address = self.address(cell);
                    self.scratch[address] = self.operand(*value);
                }
                Statement::List { name } => self.counts[*name as usize] = 0,
                Statement::When { mask, body } => {
                    if self.holds(*mask) {
                        self.run(body);
                    }
                }
                Statement::Push {
                    list,
                    capacity,
                    row,
                    mask,
                    body,
                } => {
                    if self.holds(*mask) {
                        let fresh = self.counts[*list as usize];
                        self.counts[*list as usize] += 1;
                        self.counts[*row as usize] = fresh;
                        if fresh < *capacity {
                            self.run(body);
                        }
                    }
                }
                Statement::Loop {
                    index,
                    rounds,
                    body,
                } => {
                    let n = match *rounds {
                        Rounds::Times(n) => n,
                        Rounds::Rows { list, capacity } => self.counts[list as usize].min(capacity),
                    };
                    for i in 0..n {
                        self.counts[*index as usize] = i;
                        if self.run(body) == Flow::LoopEnds {
                            break;
                        }
                    }
                }
                Statement::Stop(mask) => {
                    if self.holds(*mask) {
                        return Flow::LoopEnds;
                    }
                }
            }
        }
        Flow::On
    }

    fn compute(&self, op: Op) -> f32 {
        let x = |a: Operand| self.operand(a);
        let truth = |mask: bool| f32::from(u8::from(mask));
        match op {
            Op::Input(i) => self.inputs[i as usize],
            Op::Get(name) => self.variables[name as usize],
            Op::Load(cell) => self.scratch[self.address(&cell)],
            Op::Count(list) => self.counts[list as usize] as f32,
            Op::Unary(unary, a) => match unary {
                Unary::Neg => -x(a),
                Unary::Sqrt => x(a).sqrt(),
                Unary::Abs => x(a).abs(),
                Unary::Round => Num::round(x(a)),
                Unary::Not => truth(!self.holds(a)),
            },
            Op::Binary(binary, a, b) => match binary {
                Binary::Add => x(a) + x(b),
                Binary::Sub => x(a) - x(b),
                Binary::Mul => x(a) * x(b),
                Binary::Div => x(a) / x(b),
                Binary::Min => Num::min(x(a), x(b)),
                Binary::Max => Num::max(x(a), x(b)),
                Binary::Lt => truth(x(a) < x(b)),
                Binary::And => truth(self.holds(a) && self.holds(b)),
                Binary::Or => truth(self.holds(a) || self.holds(b)),
            },
            Op::Fma(a, b, c) => x(a).mul_add(x(b), x(c)),
            Op::Select(mask, a, b) => {
                if self.holds(mask) {
                    x(a)
                } else {
                    x(b)
                }
            }
        }
    }

    fn operand(&self, a: Operand) -> f32 {
        match a {
            Operand::Constant(bits) => f32::from_bits(bits),
            Operand::Truth(mask) => f32::from(u8::from(mask)),
            Operand::Value(number) => self.values[number as usize],
        }
    }

    fn holds(&self, mask: Operand) -> bool {
        self.operand(mask) != 0.0
    }

    fn address(&self, cell: &Cell) -> usize {
        let row = match cell.row {
            Row::At(i) => i,
            Row::Name(name) => self.counts[name as usize],
        };
        cell.table.base + row * cell.table.stride + cell.number
    }
}

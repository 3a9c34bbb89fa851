//! Runs a recording on the CPU, one world at a time: the check on the program where there is no GPU.

use super::recording::Recording;
use super::tree::{Binary, Bounds, Cell, Entry, Op, Operand, Quad, Row, Statement, Unary};
use super::vectorize::WIDTH;
use sim_physics::lane::{Num, Real, Tables};
use std::collections::HashMap;

/// Should the statements after this one be run?
#[derive(PartialEq)]
enum Flow {
    On,
    LoopEnds,
}

struct Interpreter<'a> {
    recording: &'a Recording,
    inputs: &'a [f32],
    scratch: &'a mut [f32],
    tables: &'a Tables<f32>,
    /// Results by number; masks are 1 or 0.
    values: Vec<f32>,
    /// Results that are vectors, by number.
    quads: HashMap<u32, [f32; WIDTH]>,
    /// Results that are indices, by number.
    indices: Vec<usize>,
    variables: Vec<f32>,
    /// Lengths of lists, indices of loops, rows.
    counts: Vec<usize>,
}

impl Recording {
    /// The outputs for these inputs and the tables of a model, in `f32` with fused `fma`, for one world.
    ///
    /// Equal to a scalar `f32` run of the code, bit for bit up to the sign of zeros, as long as values are finite: folding keeps every
    /// rounding.
    ///
    /// # Panics
    /// If there are not as many inputs as were recorded, less scratch memory than [`Recording::scratch`], or if an
    /// index of the tables is not below its end.
    pub fn evaluate(&self, inputs: &[f32], scratch: &mut [f32], tables: &Tables<f32>) -> Vec<f32> {
        assert_eq!(
            inputs.len(),
            self.inputs,
            "one number for every recorded input"
        );
        assert!(
            scratch.len() >= self.scratch(),
            "scratch memory for every table"
        );
        let mut interpreter = Interpreter {
            recording: self,
            inputs,
            scratch,
            tables,
            quads: HashMap::new(),
            indices: vec![0; self.values.len()],
            values: vec![0.0; self.values.len()],
            variables: vec![0.0; self.names],
            counts: vec![0; self.names],
        };
        interpreter.values[..inputs.len()].copy_from_slice(inputs);
        interpreter.run(&self.body);
        self.outputs
            .iter()
            .map(|x| interpreter.operand(*x))
            .collect()
    }
}

impl Interpreter<'_> {
    fn run(&mut self, body: &[Statement]) -> Flow {
        for statement in body {
            match statement {
                Statement::Let(number) => {
                    let (number, number_of) = (*number as usize, *number);
                    match self.recording.values[number] {
                        Op::Index { entry, end } => {
                            let index = self.tables.indices[self.place(&entry)] as usize;
                            assert!(index < end, "index {index} of {entry:?} is not below {end}");
                            self.indices[number] = index;
                        }
                        Op::Quad(quad) => {
                            let first = self.first(&quad);
                            // the last vector of a memory need not be whole
                            let number = |k| self.scratch.get(first + k).copied().unwrap_or(0.0);
                            let numbers = std::array::from_fn(number);
                            self.quads.insert(number_of, numbers);
                        }
                        Op::After(row, x) => {
                            self.indices[number] = self.row(row) + self.operand(x).to_usize();
                        }
                        op => self.values[number] = self.compute(op),
                    }
                }
                Statement::Var { name, value } | Statement::Set { name, value } => {
                    self.variables[*name as usize] = self.operand(*value);
                }
                Statement::Store { cell, value } => {
                    let address = self.address(cell);
                    self.scratch[address] = self.operand(*value);
                }
                Statement::StoreQuad { quad, numbers } => {
                    let first = self.first(quad);
                    for (k, number) in numbers.iter().enumerate() {
                        if let Some(x) = number
                            && first + k < self.scratch.len()
                        {
                            self.scratch[first + k] = self.operand(*x);
                        }
                    }
                }
                Statement::List { name, rows } => {
                    self.counts[*name as usize] = self.operand(*rows).to_usize();
                }
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
                    bounds,
                    body,
                } => {
                    let (first, end) = match *bounds {
                        Bounds::Span { first, end } => (self.row(first), self.row(end)),
                        Bounds::Rows { list, capacity } => {
                            (0, self.counts[list as usize].min(capacity))
                        }
                    };
                    for i in first..end {
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
            Op::Number(row) => self.row(row) as f32,
            Op::Constant(entry) => self.tables.numbers[self.place(&entry)],
            Op::Pick { table, row, number } => {
                let row = x(row).to_usize();
                self.tables.numbers[table.base + row * table.stride + number]
            }
            Op::Part(four, k) => self.quads[&four][k],
            Op::Index { .. } | Op::After(..) => unreachable!("the value is an index"),
            Op::Quad(_) => unreachable!("the value is a vector"),
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
        cell.table.base + self.row(cell.row) * cell.table.stride + cell.number
    }

    /// Index of the first scalar of a vector.
    fn first(&self, quad: &Quad) -> usize {
        WIDTH * (self.row(quad.row) * quad.stride + quad.first)
    }

    fn place(&self, entry: &Entry) -> usize {
        entry.table.base + self.row(entry.row) * entry.table.stride + entry.number
    }

    fn row(&self, row: Row) -> usize {
        match row {
            Row::At(i) => i,
            Row::Name(name) => self.counts[name as usize],
            Row::Value(number) => self.indices[number as usize],
        }
    }
}

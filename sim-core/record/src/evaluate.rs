//! Runs a recording on the CPU, one world at a time: the check on the program where there is no GPU.

use crate::ir::recording::Recording;
use crate::ir::tree::{Binary, Bounds, Cell, Entry, Op, Operand, Quad, Row, Statement, Unary};
use crate::passes::vectorize::WIDTH;
use sim_physics::lane::{Num, Real, Tables};
use std::collections::HashMap;

/// The lanes of a world that run a statement, a bit each.
type Active = u32;

struct Interpreter<'a> {
    recording: &'a Recording,
    inputs: &'a [f32],
    scratch: &'a mut [f32],
    tables: &'a Tables<f32>,
    /// Results of every lane, by number; masks are 1 or 0.
    values: Vec<f32>,
    /// Results that are vectors, by number, and by lane.
    quads: HashMap<(u32, usize), [f32; WIDTH]>,
    /// Results that are indices, of every lane, by number.
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
    /// If what was assumed to hold nowhere holds, if there are not as many inputs as were recorded, less scratch memory than
    /// [`Recording::scratch`], or if an index of the tables is not below its end.
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
        let lanes = self.lanes;
        let mut interpreter = Interpreter {
            recording: self,
            inputs,
            scratch,
            tables,
            quads: HashMap::new(),
            indices: vec![0; self.values.len() * lanes],
            values: vec![0.0; self.values.len() * lanes],
            variables: vec![0.0; self.names * lanes],
            counts: vec![0; self.names * lanes],
        };
        for (values, x) in interpreter.values.chunks_exact_mut(lanes).zip(inputs) {
            values.fill(*x);
        }
        let all = Active::MAX >> (Active::BITS as usize - lanes);
        interpreter.run(&self.body, all);
        let refuses = (self.assumed).is_some_and(|mask| interpreter.operand(mask, 0) != 0.0);
        assert!(!refuses, "what was assumed to hold nowhere holds");
        self.outputs
            .iter()
            .map(|x| interpreter.operand(*x, 0))
            .collect()
    }
}

/// The lanes among them.
fn each(active: Active) -> impl Iterator<Item = usize> {
    (0..Active::BITS as usize).filter(move |lane| active >> lane & 1 == 1)
}

impl Interpreter<'_> {
    /// Runs statements; returns the lanes that did not leave the loop around them.
    fn run(&mut self, body: &[Statement], mut active: Active) -> Active {
        for statement in body {
            if active == 0 {
                break;
            }
            match statement {
                Statement::When { mask, body } => {
                    let inside = self.where_holds(*mask, active);
                    self.run(body, inside);
                }
                Statement::Push {
                    list,
                    capacity,
                    row,
                    mask,
                    body,
                } => {
                    let mut inside = self.where_holds(*mask, active);
                    for lane in each(inside) {
                        let (list, row) = (self.at(*list, lane), self.at(*row, lane));
                        let fresh = self.counts[list];
                        self.counts[list] += 1;
                        self.counts[row] = fresh;
                        if fresh >= *capacity {
                            inside &= !(1 << lane);
                        }
                    }
                    self.run(body, inside);
                }
                Statement::Loop {
                    index,
                    bounds,
                    body,
                } => self.run_loop(*index, *bounds, body, active),
                Statement::Stop(mask) => active &= !self.where_holds(*mask, active),
                _ => each(active).for_each(|lane| self.run_plain(statement, lane)),
            }
        }
        active
    }

    fn run_loop(&mut self, index: u32, bounds: Bounds, body: &[Statement], mut active: Active) {
        let lanes = self.recording.lanes;
        let (mut next, mut ends) = (vec![0; lanes], vec![0; lanes]);
        let mut step = 1;
        for lane in each(active) {
            (next[lane], ends[lane]) = match bounds {
                Bounds::Span { first, end } => (self.row(first, lane), self.row(end, lane)),
                Bounds::Rows { list, capacity } => {
                    (0, self.counts[self.at(list, lane)].min(capacity))
                }
                Bounds::Shared { first, end } => {
                    step = lanes;
                    (self.row(first, lane) + lane, self.row(end, lane))
                }
            };
        }
        loop {
            for lane in each(active) {
                if next[lane] >= ends[lane] {
                    active &= !(1 << lane);
                    continue;
                }
                let at = self.at(index, lane);
                self.counts[at] = next[lane];
                next[lane] += step;
            }
            if active == 0 {
                return;
            }
            active = self.run(body, active);
        }
    }

    /// Runs a statement without statements inside it.
    fn run_plain(&mut self, statement: &Statement, lane: usize) {
        match statement {
            Statement::Let(number) => {
                let at = self.at(*number, lane);
                match self.recording.values[*number as usize] {
                    Op::Index { entry, end } => {
                        let index = self.tables.indices[self.place(&entry, lane)] as usize;
                        assert!(index < end, "index {index} of {entry:?} is not below {end}");
                        self.indices[at] = index;
                    }
                    Op::Quad(quad) => {
                        let first = self.first(&quad, lane);
                        // the last vector of a memory need not be whole
                        let numbers = std::array::from_fn(|k| {
                            self.scratch.get(first + k).copied().unwrap_or(0.0)
                        });
                        self.quads.insert((*number, lane), numbers);
                    }
                    Op::After(row, x) => {
                        self.indices[at] = self.row(row, lane) + self.operand(x, lane).to_usize();
                    }
                    op => self.values[at] = self.compute(op, lane),
                }
            }
            Statement::Var { name, value } | Statement::Set { name, value } => {
                let at = self.at(*name, lane);
                self.variables[at] = self.operand(*value, lane);
            }
            Statement::Store { cell, value } => {
                let address = self.address(cell, lane);
                self.scratch[address] = self.operand(*value, lane);
            }
            Statement::StoreQuad { quad, numbers } => {
                let first = self.first(quad, lane);
                for (k, number) in numbers.iter().enumerate() {
                    if let Some(x) = number
                        && first + k < self.scratch.len()
                    {
                        self.scratch[first + k] = self.operand(*x, lane);
                    }
                }
            }
            Statement::List { name, rows } => {
                let at = self.at(*name, lane);
                self.counts[at] = self.operand(*rows, lane).to_usize();
            }
            Statement::When { .. }
            | Statement::Push { .. }
            | Statement::Loop { .. }
            | Statement::Stop(_) => unreachable!("it has statements inside, or ends them"),
        }
    }

    fn compute(&self, op: Op, lane: usize) -> f32 {
        let x = |a: Operand| self.operand(a, lane);
        let holds = |a: Operand| x(a) != 0.0;
        let truth = |mask: bool| f32::from(u8::from(mask));
        match op {
            Op::Input(i) => self.inputs[i as usize],
            Op::Get(name) => self.variables[self.at(name, lane)],
            Op::Load(cell) => self.scratch[self.address(&cell, lane)],
            Op::LoadAt(cell, column) => {
                self.scratch[self.address(&cell, lane) + x(column).to_usize()]
            }
            Op::Count(list) => self.counts[self.at(list, lane)] as f32,
            Op::Lane => lane as f32,
            Op::Alike(a) => x(a),
            Op::FromLane(a, from) => self.operand(a, from),
            Op::AcrossLanes(a, apart) => self.operand(a, lane ^ apart),
            Op::Unary(unary, a) => match unary {
                Unary::Neg => -x(a),
                Unary::Sqrt => x(a).sqrt(),
                Unary::Abs => x(a).abs(),
                Unary::Round => Num::round(x(a)),
                Unary::Not => truth(!holds(a)),
            },
            Op::Binary(binary, a, b) => match binary {
                Binary::Add => x(a) + x(b),
                Binary::Sub => x(a) - x(b),
                Binary::Mul => x(a) * x(b),
                Binary::Div => x(a) / x(b),
                Binary::Min => Num::min(x(a), x(b)),
                Binary::Max => Num::max(x(a), x(b)),
                Binary::Lt => truth(x(a) < x(b)),
                Binary::And => truth(holds(a) && holds(b)),
                Binary::Or => truth(holds(a) || holds(b)),
            },
            Op::Fma(a, b, c) => x(a).mul_add(x(b), x(c)),
            Op::Select(mask, a, b) => {
                if holds(mask) {
                    x(a)
                } else {
                    x(b)
                }
            }
            Op::Number(row) => self.row(row, lane) as f32,
            Op::Constant(entry) => self.tables.numbers[self.place(&entry, lane)],
            Op::Pick { table, row, number } => {
                let row = x(row).to_usize();
                self.tables.numbers[table.base + row * table.stride + number]
            }
            Op::Part(four, k) => self.quads[&(four, lane)][k],
            Op::Index { .. } | Op::After(..) => unreachable!("the value is an index"),
            Op::Quad(_) => unreachable!("the value is a vector"),
        }
    }

    /// Place of a lane's value or variable.
    fn at(&self, number: u32, lane: usize) -> usize {
        number as usize * self.recording.lanes + lane
    }

    fn operand(&self, a: Operand, lane: usize) -> f32 {
        match a {
            Operand::Constant(bits) => f32::from_bits(bits),
            Operand::Truth(mask) => f32::from(u8::from(mask)),
            Operand::Value(number) => self.values[self.at(number, lane)],
        }
    }

    fn where_holds(&self, mask: Operand, active: Active) -> Active {
        let lanes = each(active).filter(|&lane| self.operand(mask, lane) != 0.0);
        lanes.fold(0, |holding, lane| holding | 1 << lane)
    }

    fn address(&self, cell: &Cell, lane: usize) -> usize {
        cell.table.base + self.row(cell.row, lane) * cell.table.stride + cell.number
    }

    /// Index of the first scalar of a vector.
    fn first(&self, quad: &Quad, lane: usize) -> usize {
        WIDTH * (self.row(quad.row, lane) * quad.stride + quad.first)
    }

    fn place(&self, entry: &Entry, lane: usize) -> usize {
        entry.table.base + self.row(entry.row, lane) * entry.table.stride + entry.number
    }

    fn row(&self, row: Row, lane: usize) -> usize {
        match row {
            Row::At(i) => i,
            Row::Name(name) => self.counts[self.at(name, lane)],
            Row::Value(number) => self.indices[self.at(number, lane)],
        }
    }
}

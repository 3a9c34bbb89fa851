//! Vectorizes accesses to scratch memory: four neighbouring scalars are read and written together.
//!
//! A driver's compile time grows faster than linearly with the memory accesses of a kernel: the software driver compiles each to a loop
//! over the lanes. Scalars 4 i .. 4 i + 4 are therefore one vector. A load reads the whole vector, and later loads use it for as long as
//! no store may have changed it. Stores wait for their neighbours until a load or another store may touch the same memory, or
//! the block ends.

use crate::ir::recording::Recording;
use crate::ir::tree::{Cell, Op, Operand, Quad, Row, Statement};
use std::collections::HashMap;

/// Components of a vector.
pub(crate) const WIDTH: usize = 4;

impl Recording {
    /// The recording with scratch memory in vectors of four scalars. It gives the same bits.
    pub fn vectorized(&self) -> Recording {
        let (body, values) = vectorize(&self.body, &self.values);
        Recording {
            inputs: self.inputs,
            outputs: self.outputs.clone(),
            values,
            origins: Vec::new(),
            names: self.names,
            scratch: self.scratch,
            lanes: self.lanes,
            assumed: self.assumed,
            body,
        }
    }
}

/// Statements, with what they load and store in vectors, and all values.
pub(crate) fn vectorize(body: &[Statement], values: &[Op]) -> (Vec<Statement>, Vec<Op>) {
    let mut vectorizer = Vectorizer {
        values: values.to_vec(),
    };
    let body = vectorizer.block(body, Vec::new());
    (body, vectorizer.values)
}

impl Recording {
    /// Vectors of which a single component is used, and which.
    pub(crate) fn single_parts(&self) -> HashMap<u32, usize> {
        let mut used: HashMap<u32, [bool; WIDTH]> = HashMap::new();
        self.each_operand(&mut |x| {
            if let Operand::Value(number) = x
                && let Op::Part(four, k) = self.values[number as usize]
            {
                used.entry(four).or_default()[k] = true;
            }
        });
        let single = |(four, parts): (u32, [bool; WIDTH])| {
            let mut parts = (0..WIDTH).filter(|k| parts[*k]);
            let first = parts.next()?;
            parts.next().is_none().then_some((four, first))
        };
        used.into_iter().filter_map(single).collect()
    }
}

/// Where an access may touch scratch memory, in scalars: `row * stride + first ..+ span`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Reach {
    row: Row,
    stride: usize,
    first: usize,
    span: usize,
    /// For any row, the scalars lie in `from..end`.
    from: usize,
    end: usize,
}

impl Reach {
    fn new(row: Row, stride: usize, first: usize, rows: usize, span: usize) -> Reach {
        let (row, stride, first, rows) = match row {
            Row::At(i) => (Row::At(0), 0, first + i * stride, 1),
            row => (row, stride, first, rows),
        };
        Reach {
            row,
            stride,
            first,
            span,
            from: first,
            end: first + rows.saturating_sub(1) * stride + span,
        }
    }

    fn of_cell(cell: &Cell) -> Reach {
        let Cell { table, row, number } = cell;
        Reach::new(*row, table.stride, table.base + number, table.rows, 1)
    }

    /// Of a cell and all columns behind it.
    fn of_columns(cell: &Cell) -> Reach {
        let Cell { table, row, number } = cell;
        let span = table.stride - number;
        Reach::new(*row, table.stride, table.base + number, table.rows, span)
    }

    /// Whether the two may share a scalar.
    fn meets(&self, other: &Reach) -> bool {
        if self.end <= other.from || other.end <= self.from {
            return false;
        }
        if self.row == other.row && self.stride == other.stride {
            return self.first < other.first + other.span && other.first < self.first + self.span;
        }
        // the rows may be any distance apart: the first scalars differ by any multiple of the common stride
        let step = gcd(self.stride, other.stride);
        let apart = (self.first as isize - other.first as isize).rem_euclid(step as isize) as usize;
        apart < other.span || step - apart < self.span
    }

    fn meets_any(&self, others: &[Reach]) -> bool {
        others.iter().any(|other| self.meets(other))
    }
}

/// One of them is not 0.
fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The vector that holds a cell, and the cell's place in it; none where the place is found at run time.
fn quad_of(cell: &Cell) -> Option<(Quad, usize)> {
    let Cell { table, row, number } = cell;
    let first = table.base + number;
    match *row {
        Row::At(i) => {
            let place = first + i * table.stride;
            let (row, stride, first) = (Row::At(0), 0, place / WIDTH);
            Some((Quad { row, stride, first }, place % WIDTH))
        }
        row if table.stride.is_multiple_of(WIDTH) => {
            let (stride, first, place) = (table.stride / WIDTH, first / WIDTH, first % WIDTH);
            Some((Quad { row, stride, first }, place))
        }
        _ => None,
    }
}

/// Where the accesses of a cell's vector may touch memory.
fn reach_of_quad(quad: Quad, cell: &Cell) -> Reach {
    let Quad { row, stride, first } = quad;
    Reach::new(row, stride * WIDTH, first * WIDTH, cell.table.rows, WIDTH)
}

/// A vector of which something is known, or waits to be written.
#[derive(Clone, Copy)]
struct Four {
    quad: Quad,
    reach: Reach,
    numbers: [Option<Operand>; WIDTH],
}

impl Four {
    fn count(&self) -> usize {
        self.numbers.iter().flatten().count()
    }
}

/// What the statements of a block may read and write.
#[derive(Default)]
struct Accesses {
    loads: Vec<Reach>,
    stores: Vec<Reach>,
}

struct Vectorizer {
    values: Vec<Op>,
}

/// A block that is being written.
struct Scope {
    body: Vec<Statement>,
    /// Values of memory, once `waiting` is written.
    known: Vec<Four>,
    waiting: Vec<Four>,
}

impl Vectorizer {
    fn block(&mut self, body: &[Statement], known: Vec<Four>) -> Vec<Statement> {
        let mut block = Scope {
            body: Vec::with_capacity(body.len()),
            known,
            waiting: Vec::new(),
        };
        for statement in body {
            self.statement(statement, &mut block);
        }
        self.write(&mut block, |_| true);
        block.body
    }

    fn statement(&mut self, statement: &Statement, block: &mut Scope) {
        match statement {
            Statement::Let(number) => match self.values[*number as usize] {
                Op::Load(cell) => self.load(*number, cell, block),
                Op::LoadAt(cell, _) => {
                    let reach = Reach::of_columns(&cell);
                    self.write(block, |r| r.meets(&reach));
                    block.body.push(statement.clone());
                }
                _ => block.body.push(statement.clone()),
            },
            Statement::Store { cell, value } => self.store(cell, *value, block),
            Statement::When { mask, body } => {
                let body = self.nested(body, false, block);
                block.body.push(Statement::When { mask: *mask, body });
            }
            Statement::Push {
                list,
                capacity,
                row,
                mask,
                body,
            } => {
                let body = self.nested(body, false, block);
                block.body.push(Statement::Push {
                    list: *list,
                    capacity: *capacity,
                    row: *row,
                    mask: *mask,
                    body,
                });
            }
            Statement::Loop {
                index,
                bounds,
                body,
            } => {
                let body = self.nested(body, true, block);
                block.body.push(Statement::Loop {
                    index: *index,
                    bounds: *bounds,
                    body,
                });
            }
            // a world that leaves the loop must have its values in memory
            Statement::Stop(_) => {
                self.write(block, |_| true);
                block.body.push(statement.clone());
            }
            Statement::Var { .. }
            | Statement::Set { .. }
            | Statement::List { .. }
            | Statement::StoreQuad { .. } => block.body.push(statement.clone()),
        }
    }

    fn nested(&mut self, body: &[Statement], again: bool, block: &mut Scope) -> Vec<Statement> {
        let mut inside = Accesses::default();
        self.accesses(body, &mut inside);
        let Accesses { loads, stores } = inside;
        self.write(block, |r| r.meets_any(&loads) || r.meets_any(&stores));
        let outside = block.known.clone();
        block.known.retain(|four| !four.reach.meets_any(&stores));
        // the first iteration, too, starts from what every iteration may rely on
        let start = if again { block.known.clone() } else { outside };
        self.block(body, start)
    }

    fn accesses(&self, body: &[Statement], accesses: &mut Accesses) {
        let reach = |cell: &Cell| match quad_of(cell) {
            Some((quad, _)) => reach_of_quad(quad, cell),
            None => Reach::of_cell(cell),
        };
        for statement in body {
            match statement {
                Statement::Let(number) => match &self.values[*number as usize] {
                    Op::Load(cell) => accesses.loads.push(reach(cell)),
                    Op::LoadAt(cell, _) => accesses.loads.push(Reach::of_columns(cell)),
                    _ => {}
                },
                Statement::Store { cell, .. } => accesses.stores.push(reach(cell)),
                Statement::When { body, .. }
                | Statement::Push { body, .. }
                | Statement::Loop { body, .. } => self.accesses(body, accesses),
                _ => {}
            }
        }
    }

    fn load(&mut self, number: u32, cell: Cell, block: &mut Scope) {
        let Some((quad, place)) = quad_of(&cell) else {
            let reach = Reach::of_cell(&cell);
            self.write(block, |r| r.meets(&reach));
            return block.body.push(Statement::Let(number));
        };
        let reach = reach_of_quad(quad, &cell);
        let known = block.known.iter().find(|four| four.quad == quad);
        if let Some(Operand::Value(known)) = known.and_then(|four| four.numbers[place])
            && let part @ Op::Part(..) = self.values[known as usize]
        {
            self.values[number as usize] = part;
            return block.body.push(Statement::Let(number));
        }
        // other components of this vector may go on waiting: they are not read
        let waits_here = |four: &Four| four.quad == quad && four.numbers[place].is_some();
        let here = block.waiting.iter().any(waits_here);
        self.write(block, |r| r.meets(&reach) && (here || !is_at(r, &reach)));
        let mut numbers = self.read(quad, &mut block.body);
        let Some(Operand::Value(read)) = numbers[place] else {
            unreachable!("a vector has four numbers")
        };
        self.values[number as usize] = self.values[read as usize];
        block.body.push(Statement::Let(number));
        if let Some(waiting) = block.waiting.iter().find(|four| four.quad == quad) {
            for (number, waiting) in numbers.iter_mut().zip(waiting.numbers) {
                *number = waiting.or(*number);
            }
        }
        block.known.retain(|four| four.quad != quad);
        block.known.push(Four {
            quad,
            reach,
            numbers,
        });
    }

    /// Reads a vector; its components become values.
    fn read(&mut self, quad: Quad, body: &mut Vec<Statement>) -> [Option<Operand>; WIDTH] {
        let mut value = |op| {
            let number = self.values.len() as u32;
            self.values.push(op);
            body.push(Statement::Let(number));
            number
        };
        let four = value(Op::Quad(quad));
        std::array::from_fn(|k| Some(Operand::Value(value(Op::Part(four, k)))))
    }

    fn store(&mut self, cell: &Cell, value: Operand, block: &mut Scope) {
        let Some((quad, place)) = quad_of(cell) else {
            let reach = Reach::of_cell(cell);
            self.write(block, |r| r.meets(&reach));
            block.known.retain(|four| !four.reach.meets(&reach));
            return block.body.push(Statement::Store { cell: *cell, value });
        };
        let reach = reach_of_quad(quad, cell);
        self.write(block, |r| r.meets(&reach) && !is_at(r, &reach));
        block
            .known
            .retain(|four| four.quad == quad || !four.reach.meets(&reach));
        for fours in [&mut block.known, &mut block.waiting] {
            match fours.iter_mut().find(|four| four.quad == quad) {
                Some(four) => four.numbers[place] = Some(value),
                None => {
                    let mut numbers = [None; WIDTH];
                    numbers[place] = Some(value);
                    fours.push(Four {
                        quad,
                        reach,
                        numbers,
                    });
                }
            }
        }
    }

    /// Writes what waits and is chosen.
    fn write(&mut self, block: &mut Scope, chosen: impl Fn(&Reach) -> bool) {
        let (written, waiting) = std::mem::take(&mut block.waiting)
            .into_iter()
            .partition(|four| chosen(&four.reach));
        block.waiting = waiting;
        let written: Vec<Four> = written;
        for four in written {
            let Four { quad, reach, .. } = four;
            let mut numbers = four.numbers;
            let known = block.known.iter().find(|known| known.quad == quad);
            let mut rest = known.map_or([None; WIDTH], |known| known.numbers);
            // reading one vector is cheaper than writing three components one by one
            if four.count() + 1 == WIDTH && (0..WIDTH).any(|k| numbers[k].or(rest[k]).is_none()) {
                rest = self.read(quad, &mut block.body);
                block.known.retain(|known| known.quad != quad);
                let now = std::array::from_fn(|k| numbers[k].or(rest[k]));
                block.known.push(Four {
                    quad,
                    reach,
                    numbers: now,
                });
            }
            let whole = std::array::from_fn(|k| numbers[k].or(rest[k]));
            if four.count() > 1 && whole.iter().all(Option::is_some) {
                numbers = whole;
            }
            block.body.push(Statement::StoreQuad { quad, numbers });
        }
    }
}

/// Is it the very same vector?
fn is_at(a: &Reach, b: &Reach) -> bool {
    (a.row, a.stride, a.first) == (b.row, b.stride, b.first)
}

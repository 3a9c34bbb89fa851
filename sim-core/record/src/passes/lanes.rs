//! Several threads per world: the iterations of a loop over rows are shared among the *lanes* of a world.
//!
//! Lane l of n runs the iterations l, l + n, l + 2 n, … of a loop in which each iteration touches rows of its own. A variable that the
//! loop adds to becomes a sum per lane, which starts at 0. After the loop the sums of the lanes are added in a fixed order:
//!
//! ```text
//! for r in rows { v += x(r) }    →    p = 0; for r in rows of this lane { p += x(r) }; v += sum of p over the lanes
//! ```
//!
//! All lanes compute everything else, with the same values. The order of a sum depends on the number of lanes alone.

use crate::ir::recording::Recording;
use crate::ir::tree::{Binary, Bounds, Cell, Op, Operand, Row, Statement};
use std::collections::{BTreeSet, HashMap, HashSet};

/// Shares what loops can be shared. The recording is not yet vectorized.
pub(crate) fn share(recording: &mut Recording) {
    let body = std::mem::take(&mut recording.body);
    let mut sharer = Sharer {
        values: &mut recording.values,
        names: &mut recording.names,
        lanes: recording.lanes,
    };
    recording.body = sharer.block(body);
}

/// Values, by number, and variables that may differ between the lanes of a world.
pub(crate) fn varying(recording: &Recording) -> (Vec<bool>, HashSet<u32>) {
    let mut varies = vec![false; recording.values.len()];
    let mut names = HashSet::new();
    if recording.lanes == 1 {
        return (varies, names);
    }
    // what one iteration of a loop leaves, the next one may read
    loop {
        let before = names.len();
        recording.each_statement(&mut |statement| match statement {
            Statement::Let(number) => {
                let op = recording.values[*number as usize];
                let mut varying = match op {
                    Op::Lane => true,
                    Op::Get(name) => names.contains(&name),
                    _ => false,
                };
                op.each_operand(|x| {
                    if let Operand::Value(x) = x {
                        varying |= varies[x as usize];
                    }
                });
                varies[*number as usize] =
                    varying && !matches!(op, Op::FromLane(..) | Op::Alike(_));
            }
            Statement::Var { name, value } | Statement::Set { name, value } => {
                if let Operand::Value(x) = value
                    && varies[*x as usize]
                {
                    names.insert(*name);
                }
            }
            _ => {}
        });
        if names.len() == before {
            return (varies, names);
        }
    }
}

/// Do the lanes of a world share work of this statement: values that they exchange, or a loop over rows, as many as are found at run
/// time?
pub(crate) fn needs_lanes(statement: &Statement, values: &[Op]) -> bool {
    match statement {
        Statement::Let(number) => matches!(
            values[*number as usize],
            Op::Lane | Op::FromLane(..) | Op::AcrossLanes(..)
        ),
        Statement::Loop { bounds, body, .. } => {
            let is_found = match bounds {
                Bounds::Span { end, .. } | Bounds::Shared { end, .. } => {
                    matches!(end, Row::Value(_))
                }
                Bounds::Rows { .. } => false,
            };
            (is_found && sums(statement, values).is_some())
                || body.iter().any(|inner| needs_lanes(inner, values))
        }
        Statement::When { body, .. } | Statement::Push { body, .. } => {
            body.iter().any(|inner| needs_lanes(inner, values))
        }
        _ => false,
    }
}

struct Sharer<'a> {
    values: &'a mut Vec<Op>,
    names: &'a mut usize,
    lanes: usize,
}

impl Sharer<'_> {
    fn block(&mut self, body: Vec<Statement>) -> Vec<Statement> {
        let mut done = Vec::with_capacity(body.len());
        for mut statement in body {
            if let Some(sums) = sums(&statement, self.values) {
                self.shared(statement, &sums, &mut done);
                continue;
            }
            if let Statement::When { body, .. }
            | Statement::Push { body, .. }
            | Statement::Loop { body, .. } = &mut statement
            {
                *body = self.block(std::mem::take(body));
            }
            done.push(statement);
        }
        done
    }

    fn compute(&mut self, op: Op, to: &mut Vec<Statement>) -> u32 {
        let number = self.values.len() as u32;
        self.values.push(op);
        to.push(Statement::Let(number));
        number
    }

    /// Writes a shared loop, with its sums, inside a block for worlds that have an iteration.
    fn shared(&mut self, statement: Statement, sums: &BTreeSet<u32>, done: &mut Vec<Statement>) {
        let Statement::Loop {
            index,
            bounds: Bounds::Span { first, end },
            mut body,
        } = statement
        else {
            unreachable!("it has sums")
        };
        let first_number = self.compute(Op::Number(first), done);
        let end_number = self.compute(Op::Number(end), done);
        let (a, b) = (Operand::Value(first_number), Operand::Value(end_number));
        let some = self.compute(Op::Binary(Binary::Lt, a, b), done);
        let mut inside = Vec::new();
        let mut of_lane = HashMap::new();
        for name in sums {
            let lane_name = *self.names as u32;
            *self.names += 1;
            of_lane.insert(*name, lane_name);
            inside.push(Statement::Var {
                name: lane_name,
                value: Operand::number(0.0),
            });
        }
        self.rename(&mut body, &of_lane);
        inside.push(Statement::Loop {
            index,
            bounds: Bounds::Shared { first, end },
            body,
        });
        for name in sums {
            let lane_name = of_lane[name];
            let mut added = Operand::Value(self.compute(Op::Get(lane_name), &mut inside));
            let mut apart = 1;
            while apart < self.lanes {
                let other = self.compute(Op::AcrossLanes(added, apart), &mut inside);
                let both = Op::Binary(Binary::Add, added, Operand::Value(other));
                added = Operand::Value(self.compute(both, &mut inside));
                apart *= 2;
            }
            let added = Operand::Value(self.compute(Op::Alike(added), &mut inside));
            let before = Operand::Value(self.compute(Op::Get(*name), &mut inside));
            let sum = self.compute(Op::Binary(Binary::Add, before, added), &mut inside);
            inside.push(Statement::Set {
                name: *name,
                value: Operand::Value(sum),
            });
        }
        done.push(Statement::When {
            mask: Operand::Value(some),
            body: inside,
        });
    }

    fn rename(&mut self, body: &mut [Statement], of_lane: &HashMap<u32, u32>) {
        for statement in body {
            match statement {
                Statement::Let(number) => {
                    if let Op::Get(name) = &mut self.values[*number as usize]
                        && let Some(lane_name) = of_lane.get(name)
                    {
                        *name = *lane_name;
                    }
                }
                Statement::Set { name, .. } => {
                    if let Some(lane_name) = of_lane.get(name) {
                        *name = *lane_name;
                    }
                }
                Statement::When { body, .. }
                | Statement::Push { body, .. }
                | Statement::Loop { body, .. } => self.rename(body, of_lane),
                _ => {}
            }
        }
    }
}

/// The variables that a loop adds to, if its iterations can be shared: then all others are its own, and it stores in rows of its own.
fn sums(statement: &Statement, values: &[Op]) -> Option<BTreeSet<u32>> {
    let Statement::Loop {
        index,
        bounds: Bounds::Span { end, .. },
        body,
    } = statement
    else {
        return None;
    };
    let mut declared = HashSet::new();
    let mut assigned = BTreeSet::new();
    names(body, &mut declared, &mut assigned);
    assigned.retain(|name| !declared.contains(name));
    let mut iteration = Iteration {
        values,
        index: *index,
        end: *end,
        sums: &assigned,
        partial: HashMap::new(),
        loads: Vec::new(),
        stores: Vec::new(),
    };
    let is_own = iteration.block(body, true)? && iteration.touches_rows_of_its_own();
    is_own.then_some(assigned)
}

/// Variables that statements start, and those that they assign.
fn names(body: &[Statement], declared: &mut HashSet<u32>, assigned: &mut BTreeSet<u32>) {
    for statement in body {
        match statement {
            Statement::Var { name, .. } => {
                declared.insert(*name);
            }
            Statement::Set { name, .. } => {
                assigned.insert(*name);
            }
            Statement::When { body, .. }
            | Statement::Push { body, .. }
            | Statement::Loop { body, .. } => names(body, declared, assigned),
            _ => {}
        }
    }
}

/// One iteration of a loop, as far as it was read.
struct Iteration<'a> {
    values: &'a [Op],
    index: u32,
    /// What follows the last row: no iteration has it.
    end: Row,
    sums: &'a BTreeSet<u32>,
    /// Values that are a variable plus something that does not depend on it.
    partial: HashMap<u32, u32>,
    loads: Vec<Cell>,
    stores: Vec<Cell>,
}

impl Iteration<'_> {
    /// Reads statements; none where one cannot be shared.
    fn block(&mut self, body: &[Statement], is_outermost: bool) -> Option<bool> {
        for statement in body {
            match statement {
                Statement::Let(number) => self.value(*number)?,
                Statement::Var { value, .. } => self.free(*value)?,
                Statement::Set { name, value } => {
                    let is_sum = self.sums.contains(name);
                    match self.partial_of(*value) {
                        Some(of) if is_sum && of == *name => {}
                        None if !is_sum => {}
                        _ => return None,
                    }
                }
                Statement::Store { cell, value } => {
                    self.free(*value)?;
                    self.stores.push(*cell);
                }
                Statement::When { mask, body } => {
                    self.free(*mask)?;
                    self.block(body, is_outermost)?;
                }
                Statement::Loop { body, .. } => {
                    self.block(body, false)?;
                }
                Statement::Stop(mask) if !is_outermost => self.free(*mask)?,
                Statement::Stop(_)
                | Statement::Push { .. }
                | Statement::List { .. }
                | Statement::StoreQuad { .. } => return None,
            }
        }
        Some(true)
    }

    fn value(&mut self, number: u32) -> Option<()> {
        let op = self.values[number as usize];
        let of = match op {
            Op::Get(name) => self.sums.contains(&name).then_some(name),
            Op::Load(cell) => {
                self.loads.push(cell);
                None
            }
            Op::Binary(Binary::Add, a, b) => match (self.partial_of(a), self.partial_of(b)) {
                (Some(_), Some(_)) => return None,
                (a, b) => a.or(b),
            },
            Op::Binary(Binary::Sub, a, b) => {
                self.free(b)?;
                self.partial_of(a)
            }
            Op::Fma(a, b, c) => {
                self.free(a)?;
                self.free(b)?;
                self.partial_of(c)
            }
            // a column that does not depend on which lane runs the iteration
            Op::LoadAt(cell, column) if self.is_of_iteration(column) => {
                self.loads.push(cell);
                None
            }
            // lanes exchange values outside of shared loops, and each has its own
            Op::Lane | Op::FromLane(..) | Op::AcrossLanes(..) | Op::Alike(_) | Op::LoadAt(..) => {
                return None;
            }
            Op::Quad(_) | Op::Part(..) => return None,
            op => {
                let mut is_free = true;
                op.each_operand(|x| is_free &= self.partial_of(x).is_none());
                if !is_free {
                    return None;
                }
                None
            }
        };
        if let Some(of) = of {
            self.partial.insert(number, of);
        }
        Some(())
    }

    /// Is a value an index, or read from a table of the model? Neither names a lane. A value that was computed before the loop may differ
    /// between lanes.
    fn is_of_iteration(&self, x: Operand) -> bool {
        match x {
            Operand::Value(number) => {
                matches!(
                    self.values[number as usize],
                    Op::Number(_) | Op::Constant(_)
                )
            }
            _ => false,
        }
    }

    fn partial_of(&self, x: Operand) -> Option<u32> {
        match x {
            Operand::Value(number) => self.partial.get(&number).copied(),
            _ => None,
        }
    }

    /// Whether a value does not depend on a sum.
    fn free(&self, x: Operand) -> Option<()> {
        self.partial_of(x).is_none().then_some(())
    }

    /// Whether no other iteration touches what this one stores. Only loop fusion makes indices after a loop's: each iteration of a
    /// fused loop has a row of its own.
    fn touches_rows_of_its_own(&self) -> bool {
        let is_own = |row: Row| match row {
            Row::Name(name) => name == self.index,
            Row::Value(number) => {
                matches!(self.values[number as usize], Op::After(Row::Name(name), _) if name == self.index)
            }
            Row::At(_) => false,
        };
        let stores = &self.stores;
        let meets = |a: &Cell, b: &Cell| {
            let end = |cell: &Cell| cell.table.base + cell.table.rows * cell.table.stride;
            a.table.base < end(b) && b.table.base < end(a)
        };
        stores.iter().all(|cell| is_own(cell.row))
            && (self.loads.iter())
                .filter(|load| stores.iter().any(|store| meets(load, store)))
                .all(|load| is_own(load.row) || load.row == self.end)
    }
}

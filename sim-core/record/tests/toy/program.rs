//! Random programs over the execution context, made from a seed.

use super::{Random, on_cpu_with};
use sim_physics::lane::memory::Cpu;
use sim_physics::lane::{Cx, Fixed, Lane, MaskOf, Num, Real, Table, Tables};
use sim_physics::{break_if, each, push, span, when};
use sim_record::{Recording, record};

/// Numbers that a program reads.
pub const INPUTS: usize = 4;
/// Variables that a program has from its start.
pub const VARIABLES: usize = 4;
/// Rows that a list holds; programs push more.
pub const CAPACITY: usize = 3;
const LISTS: usize = 2;
const WORK: Table = Table {
    base: 0,
    stride: 4,
    rows: 5,
};
const ROWS: [Table; LISTS] = [
    Table {
        base: 20,
        stride: 8,
        rows: CAPACITY,
    },
    Table {
        base: 44,
        stride: 2,
        rows: CAPACITY,
    },
];
/// Lengths of the kept lists.
const COUNTS: Table = Table {
    base: 50,
    stride: 1,
    rows: 2,
};
/// Rows of the kept lists.
const KEPT: Table = Table {
    base: 54,
    stride: 4,
    rows: 6,
};
/// Scratch memory of a program, in numbers per world.
pub const SCRATCH: usize = 78;

/// Numbers of the model.
const NUMBERS: Fixed = Fixed {
    base: 1,
    stride: 2,
    rows: 6,
};
/// First row and capacity of each kept list.
const SEGMENTS: Fixed = Fixed {
    base: 0,
    stride: 2,
    rows: 2,
};
/// First and end of spans of rows, one of which is empty.
const SPANS: Fixed = Fixed {
    base: 4,
    stride: 2,
    rows: 3,
};
const SPANS_END: usize = WORK.rows + 1;

/// The tables of the model that programs read.
pub fn tables<R: Real>() -> Tables<R> {
    let numbers = [
        9.0, 0.5, -1.0, 2.0, 0.25, -0.75, 3.0, 1.0, 1.5, -2.0, 0.125, 7.0, -0.5,
    ];
    Tables {
        numbers: numbers.map(R::from_f64).to_vec(),
        indices: vec![0, 3, 3, 2, 1, 4, 3, 3, 0, 5],
    }
}

/// An operation on three of the values made so far; they are counted from the latest.
#[derive(Clone, Debug)]
pub struct Formula {
    kind: usize,
    of: [usize; 3],
    constant: f64,
}

#[derive(Clone, Debug)]
pub enum Step {
    Compute(Formula),
    Get(usize),
    Set(usize, usize),
    Load(usize, usize),
    Store(usize, usize, usize),
    When(Formula, Vec<Step>),
    Times(usize, Vec<Step>, Formula, Vec<Step>),
    Push(usize, Formula, Vec<Step>),
    Each(usize, Vec<Step>, Option<Formula>, Vec<Step>),
    Pushed(usize),
    /// Number of the innermost loop's index, or of a constant one.
    Number(usize),
    /// From the table of numbers, at the innermost loop's index or a constant one.
    Constant(usize, usize),
    /// From the table of numbers, at the row that a value is.
    Pick(usize, usize),
    /// A number of the row that an index table names, and a store there.
    Named(usize, usize, Option<usize>),
    Span(usize, Vec<Step>, Formula, Vec<Step>),
    /// Adds to a variable without a mask.
    Add(usize, usize),
    PushKept(usize, Formula, Vec<Step>),
    EachKept(usize, Vec<Step>),
    PushedKept(usize),
}

fn formula(random: &mut Random) -> Formula {
    let constant = [0.0, 1.0, -1.0, 2.0, 0.5, random.unit() * 3.0][random.below(6)];
    let of = [random.below(6), random.below(6), random.below(6)];
    Formula {
        kind: random.below(20),
        of,
        constant,
    }
}

/// A program of nested blocks; `loops` and `blocks` more may be opened inside.
pub fn program(random: &mut Random, loops: usize, blocks: usize, length: usize) -> Vec<Step> {
    let mut steps = Vec::new();
    for _ in 0..length {
        let inner = length * 2 / 3;
        let kind = random.below(26);
        steps.push(match kind {
            10 if blocks > 0 => {
                Step::When(formula(random), program(random, loops, blocks - 1, inner))
            }
            11 if loops > 0 => {
                let before = program(random, loops - 1, blocks, inner);
                let n = random.below(4);
                Step::Times(
                    n,
                    before,
                    formula(random),
                    program(random, loops - 1, blocks, 2),
                )
            }
            12 | 13 if blocks > 0 => {
                let list = random.below(LISTS);
                Step::Push(
                    list,
                    formula(random),
                    program(random, loops, blocks - 1, inner / 2),
                )
            }
            14 if loops > 0 => {
                let stops = (random.below(2) == 0).then(|| formula(random));
                let list = random.below(LISTS);
                let before = program(random, loops - 1, blocks, inner);
                Step::Each(list, before, stops, program(random, loops - 1, blocks, 2))
            }
            16 => Step::Number(random.below(6)),
            17 => Step::Constant(random.below(NUMBERS.rows), random.below(2)),
            18 => Step::Pick(random.below(4), random.below(2)),
            19 => {
                let stored = (random.below(2) == 0).then(|| random.below(4));
                Step::Named(random.below(SPANS.rows), random.below(2), stored)
            }
            20 if loops > 0 => {
                let before = program(random, loops - 1, blocks, inner);
                Step::Span(
                    random.below(SPANS.rows),
                    before,
                    formula(random),
                    program(random, loops - 1, blocks, 2),
                )
            }
            21 => Step::Add(random.below(VARIABLES), random.below(4)),
            22 | 23 if blocks > 0 => Step::PushKept(
                random.below(LISTS),
                formula(random),
                program(random, loops, blocks - 1, inner / 2),
            ),
            24 if loops > 0 => Step::EachKept(
                random.below(LISTS),
                program(random, loops - 1, blocks, inner),
            ),
            25 => Step::PushedKept(random.below(LISTS)),
            15 => Step::Pushed(random.below(LISTS)),
            5 | 6 => Step::Set(random.below(VARIABLES), random.below(4)),
            7 => Step::Get(random.below(VARIABLES)),
            8 => Step::Load(random.below(WORK.rows), random.below(WORK.stride)),
            9 => Step::Store(
                random.below(WORK.rows),
                random.below(WORK.stride),
                random.below(4),
            ),
            _ => Step::Compute(formula(random)),
        });
    }
    steps
}

/// Within ±8, so that every number stays finite.
fn within<F: Num>(x: F) -> F {
    x.max(F::c(-8.0)).min(F::c(8.0))
}

/// What a program can reach.
struct Reach<C: Cx> {
    values: Vec<C::F>,
    variables: [C::V; VARIABLES],
    lists: [C::List; LISTS],
    /// Row index of the innermost loop, and the table that it is good for.
    row: Option<(C::I, Table)>,
}

impl<C: Cx> Reach<C> {
    fn value(&self, from_latest: usize) -> C::F {
        let n = self.values.len();
        self.values[n - 1 - from_latest % n]
    }

    fn compute(&self, f: &Formula) -> C::F {
        let [a, b, d] = f.of.map(|i| self.value(i));
        let (k, one) = (C::F::c(f.constant), C::F::c(1.0));
        let x = match f.kind {
            0 => a + b,
            1 => a - b,
            2 => a * b,
            3 => a * k,
            4 => a + k,
            5 => k - a,
            6 => a.fma(b, d),
            7 => a.fnma(b, d),
            8 => a.fma(k, d),
            9 => a.fnma(b, k),
            10 => a.div(b.fma(b, one)),
            // signs are left bare, so that they meet every rule
            11 => return -a,
            12 => a.min(b),
            13 => (a.abs() + one).sqrt(),
            14 => a.round(),
            15 => C::F::select(self.mask(f), a, b),
            16 => a.div(C::F::c(4.0)) - b,
            17 => k.fma(C::F::c(3.0), a),
            18 => return -a.round(),
            _ => a.sincos().0,
        };
        within(x)
    }

    fn mask(&self, f: &Formula) -> MaskOf<C> {
        let [a, b, d] = f.of.map(|i| self.value(i));
        let first = a.lt(C::F::c(f.constant));
        match f.kind % 4 {
            0 => first,
            1 => !first & d.lt(b),
            2 => first | b.lt(d),
            _ => b.lt(a),
        }
    }
}

fn kept<C: Cx>(cx: &mut C, list: usize) -> C::List {
    let at = cx.at(list);
    let first = cx.index(SEGMENTS, at, 0, 4);
    let capacity = cx.index(SEGMENTS, at, 1, 4);
    cx.kept(COUNTS, at, first, capacity)
}

fn body<C: Cx>(cx: &mut C, reach: &mut Reach<C>, steps: &[Step]) {
    let outside = reach.values.len();
    for step in steps {
        let made = match step {
            Step::Compute(f) => Some(reach.compute(f)),
            Step::Get(v) => Some(cx.get(&reach.variables[*v])),
            Step::Set(v, x) => {
                let x = reach.value(*x);
                cx.set(&mut reach.variables[*v], x);
                None
            }
            Step::Load(row, k) => Some(match reach.row {
                // every other load inside a loop is of the loop's row
                Some((index, table)) if row % 2 == 0 => cx.load(table, index, k % table.stride),
                _ => {
                    let at = cx.at(*row);
                    cx.load(WORK, at, *k)
                }
            }),
            Step::Store(row, k, x) => {
                let x = reach.value(*x);
                match reach.row {
                    Some((index, table)) if row % 2 == 0 => {
                        cx.store(table, index, k % table.stride, x);
                    }
                    _ => {
                        let at = cx.at(*row);
                        cx.store(WORK, at, *k, x);
                    }
                }
                None
            }
            Step::When(f, steps) => {
                let mask = reach.mask(f);
                when!(cx, mask, { body(cx, reach, steps) });
                None
            }
            Step::Times(n, before, stop, after) => {
                let outer = reach.row;
                let mut rounds = cx.times(*n);
                while let Some(i) = cx.next(&mut rounds) {
                    reach.row = Some((i, WORK));
                    body(cx, reach, before);
                    let mask = reach.mask(stop);
                    break_if!(cx, mask);
                    body(cx, reach, after);
                }
                reach.row = outer;
                None
            }
            Step::Push(list, f, steps) => {
                let mask = reach.mask(f);
                push!(cx, reach.lists[*list], mask, row, {
                    for k in 0..ROWS[*list].stride {
                        let x = reach.value(k);
                        cx.init(ROWS[*list], row, k, x);
                    }
                    body(cx, reach, steps);
                });
                None
            }
            Step::Each(list, before, stop, after) => {
                let outer = reach.row;
                each!(cx, row in reach.lists[*list], {
                    reach.row = Some((row, ROWS[*list]));
                    body(cx, reach, before);
                    if let Some(stop) = stop {
                        let mask = reach.mask(stop);
                        break_if!(cx, mask);
                    }
                    body(cx, reach, after);
                });
                reach.row = outer;
                None
            }
            Step::Pushed(list) => Some(cx.pushed(&reach.lists[*list])),
            Step::Number(i) => {
                let at = cx.at(*i);
                Some(cx.number(reach.row.map_or(at, |(index, _)| index)))
            }
            Step::Constant(row, k) => {
                let at = cx.at(*row);
                let row = reach.row.map_or(at, |(index, _)| index);
                Some(cx.constant(NUMBERS, row, *k))
            }
            Step::Pick(x, k) => {
                let row = reach.value(*x).round();
                Some(cx.pick(NUMBERS, row, *k))
            }
            Step::Named(row, k, stored) => {
                let at = cx.at(*row);
                let named = cx.index(SPANS, at, 0, WORK.rows);
                let before = cx.load(WORK, named, *k);
                if let Some(x) = stored {
                    let x = reach.value(*x);
                    cx.store(WORK, named, *k, x);
                }
                Some(before)
            }
            Step::Span(which, before, stop, after) => {
                let outer = reach.row;
                let at = cx.at(*which);
                let first = cx.index(SPANS, at, 0, SPANS_END);
                let end = cx.index(SPANS, at, 1, SPANS_END);
                span!(cx, i in first, end, {
                    reach.row = Some((i, WORK));
                    body(cx, reach, before);
                    let mask = reach.mask(stop);
                    break_if!(cx, mask);
                    body(cx, reach, after);
                });
                reach.row = outer;
                None
            }
            Step::Add(v, x) => {
                let more = cx.only(reach.value(*x));
                let sum = within(cx.get(&reach.variables[*v]) + more);
                cx.put(&mut reach.variables[*v], sum);
                None
            }
            Step::PushKept(list, f, steps) => {
                let mask = reach.mask(f);
                let mut list = kept(cx, *list);
                push!(cx, list, mask, row, {
                    for k in 0..KEPT.stride {
                        let x = reach.value(k);
                        cx.init(KEPT, row, k, x);
                    }
                    body(cx, reach, steps);
                });
                None
            }
            Step::EachKept(list, steps) => {
                let outer = reach.row;
                let list = kept(cx, *list);
                each!(cx, row in list, {
                    reach.row = Some((row, KEPT));
                    body(cx, reach, steps);
                });
                reach.row = outer;
                None
            }
            Step::PushedKept(list) => {
                let list = kept(cx, *list);
                Some(cx.pushed(&list))
            }
        };
        reach.values.extend(made);
    }
    reach.values.truncate(outside);
}

fn sum_of_rows<C: Cx>(cx: &mut C, list: &C::List, table: Table) -> C::F {
    let mut sum = cx.var(C::F::c(0.0));
    each!(cx, row in *list, {
        for k in 0..table.stride {
            let x = cx.get(&sum).fma(C::F::c(0.5), cx.load(table, row, k));
            cx.set(&mut sum, x);
        }
    });
    cx.get(&sum)
}

/// Runs a program in an execution context; the variables, the lengths of the lists and the rows come out.
pub fn run<C: Cx>(cx: &mut C, steps: &[Step], inputs: &[C::F]) -> Vec<C::F> {
    for row in 0..WORK.rows {
        for k in 0..WORK.stride {
            let at = cx.at(row);
            cx.fill(WORK, at, k, inputs[(row + k) % INPUTS]);
        }
    }
    for list in 0..LISTS {
        let at = cx.at(list);
        cx.fill(COUNTS, at, 0, C::F::c(0.0));
    }
    let variables = std::array::from_fn(|i| cx.var(inputs[i]));
    let lists = [cx.list(CAPACITY), cx.list(CAPACITY)];
    let mut reach: Reach<C> = Reach {
        values: inputs.to_vec(),
        variables,
        lists,
        row: None,
    };
    body(cx, &mut reach, steps);
    let mut results: Vec<C::F> = reach.variables.iter().map(|v| cx.get(v)).collect();
    for (list, table) in reach.lists.iter().zip(ROWS) {
        results.push(cx.pushed(list));
        results.push(sum_of_rows(cx, list, table));
    }
    for list in 0..LISTS {
        let list = kept(cx, list);
        results.push(cx.pushed(&list));
        results.push(sum_of_rows(cx, &list, KEPT));
    }
    results
}

/// Runs a program on the CPU, `F::WIDTH` worlds at a time; one row of numbers per world.
pub fn on_cpu<F: Lane>(steps: &[Step], worlds: &[[F::Real; INPUTS]]) -> Vec<Vec<F::Real>> {
    on_cpu_with(worlds, SCRATCH, &tables(), |cx: &mut Cpu<'_, F>, inputs| {
        run(cx, steps, inputs)
    })
}

/// Records a program.
pub fn recorded(steps: &[Step]) -> Recording {
    record(INPUTS, |cx, inputs| run(cx, steps, inputs)).expect("a correct text is recorded")
}

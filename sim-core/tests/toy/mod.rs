//! Random texts: programs over the machine, made from a seed, and what runs and checks them.
#![allow(dead_code)] // each test binary uses its part

use sim_core::lane::memory::Cpu;
use sim_core::lane::record::{Recording, record};
use sim_core::lane::{Cx, Lane, MaskOf, Num, Table};
use sim_core::{break_if, each, push, when};

/// Numbers that a program reads.
pub const INPUTS: usize = 4;
/// Variables that a program has from its start.
pub const VARIABLES: usize = 4;
/// Rows that a list holds; programs push more.
pub const CAPACITY: usize = 3;
const LISTS: usize = 2;
const WORK: Table = Table {
    base: 0,
    stride: 2,
    rows: 5,
};
const ROWS: [Table; LISTS] = [
    Table {
        base: 10,
        stride: 3,
        rows: CAPACITY,
    },
    Table {
        base: 19,
        stride: 2,
        rows: CAPACITY,
    },
];
/// Scratch memory of a program, in numbers per world.
pub const SCRATCH: usize = 25;

/// SplitMix64 (Steele, Lea and Flood 2014): the same numbers from a seed on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// Uniform in [-1, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
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
        let kind = random.below(16);
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

    /// Kept within ±8, so that every number stays finite.
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
        x.max(C::F::c(-8.0)).min(C::F::c(8.0))
    }

    fn mask(&self, f: &Formula) -> MaskOf<C> {
        let [a, b, d] = f.of.map(|i| self.value(i));
        let first = a.lt(C::F::c(f.constant));
        match f.kind % 4 {
            0 => first,
            1 => C::F::and(C::F::not(first), d.lt(b)),
            2 => C::F::or(first, b.lt(d)),
            _ => b.lt(a),
        }
    }
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
        };
        reach.values.extend(made);
    }
    reach.values.truncate(outside);
}

/// Runs a program on a machine; the variables, the lengths of the lists and the rows come out.
pub fn run<C: Cx>(cx: &mut C, steps: &[Step], inputs: &[C::F]) -> Vec<C::F> {
    for row in 0..WORK.rows {
        for k in 0..WORK.stride {
            let at = cx.at(row);
            cx.fill(WORK, at, k, inputs[(row + k) % INPUTS]);
        }
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
        let mut sum = cx.var(C::F::c(0.0));
        each!(cx, row in *list, {
            for k in 0..table.stride {
                let x = cx.get(&sum).fma(C::F::c(0.5), cx.load(table, row, k));
                cx.set(&mut sum, x);
            }
        });
        results.push(cx.get(&sum));
    }
    results
}

/// Runs a program on the CPU, `F::WIDTH` worlds at a time; one row of numbers per world.
pub fn on_cpu<F: Lane>(steps: &[Step], worlds: &[[F::Real; INPUTS]]) -> Vec<Vec<F::Real>> {
    on_cpu_with(worlds, SCRATCH, |cx: &mut Cpu<'_, F>, inputs| {
        run(cx, steps, inputs)
    })
}

/// Runs any text on the CPU, `F::WIDTH` worlds at a time, with scratch memory full of zeros.
#[inline(always)]
pub fn on_cpu_with<F: Lane, const N: usize>(
    worlds: &[[F::Real; N]],
    scratch: usize,
    text: impl Fn(&mut Cpu<'_, F>, &[F]) -> Vec<F>,
) -> Vec<Vec<F::Real>> {
    let mut results = Vec::new();
    for block in worlds.chunks(F::WIDTH) {
        // a block that is not full repeats its first world
        let lane = |i: usize, k: usize| block.get(i).unwrap_or(&block[0])[k];
        let inputs: Vec<F> = (0..N)
            .map(|k| F::load(&(0..F::WIDTH).map(|i| lane(i, k)).collect::<Vec<_>>()))
            .collect();
        let mut memory = vec![F::c(0.0); scratch];
        let outputs = text(&mut Cpu::new(&mut memory), &inputs);
        let mut columns = vec![F::Real::default(); F::WIDTH];
        let first = results.len();
        results.resize(first + block.len(), Vec::new());
        for x in outputs {
            x.store(&mut columns);
            for (world, x) in results[first..].iter_mut().zip(&columns) {
                world.push(*x);
            }
        }
    }
    results
}

/// Records a program.
pub fn recorded(steps: &[Step]) -> Recording {
    record(INPUTS, |cx, inputs| run(cx, steps, inputs)).expect("a correct text is recorded")
}

/// Worlds with random numbers in [-2, 2), some exactly 0 or 1.
pub fn worlds<const N: usize>(random: &mut Random, n: usize) -> Vec<[f32; N]> {
    let mut number = || match random.below(8) {
        0 => 0.0,
        1 => 1.0,
        _ => random.unit() as f32 * 2.0,
    };
    (0..n).map(|_| std::array::from_fn(|_| number())).collect()
}

/// Bits of finite numbers, with one zero only: folding may turn -0 into 0.
pub fn bits(x: f32) -> u32 {
    assert!(x.is_finite());
    (x + 0.0).to_bits()
}

/// Parses and validates a shader with no optional capability; panics with the shader's text.
pub fn validated(wgsl: &str) -> naga::Module {
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    let module = naga::front::wgsl::parse_str(wgsl)
        .unwrap_or_else(|e| panic!("{}\n{wgsl}", e.emit_to_string(wgsl)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|e| panic!("{}\n{wgsl}", e.emit_to_string(wgsl)));
    module
}

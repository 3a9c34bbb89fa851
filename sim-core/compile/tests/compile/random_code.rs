//! Random code of blocks, loops and variables, made from a seed.

use sim_physics::lane::{Cx, MaskOf, Num};
use sim_physics::{break_if, when};

pub const INPUTS: usize = 6;
const VARIABLES: usize = 5;

/// Choices by SplitMix64 (Steele, Lea and Flood 2014), or by given bytes: one that is missing is the middle of its range.
pub struct Random<'a> {
    choices: Option<&'a [u8]>,
    state: u64,
}

impl Random<'_> {
    pub fn seeded(seed: u64) -> Random<'static> {
        let (choices, state) = (None, seed);
        Random { choices, state }
    }

    /// A byte makes a choice: what is changed in one place of the bytes changes one place of the code.
    #[allow(dead_code)] // a fuzz target calls it
    pub fn chosen(choices: &[u8]) -> Random<'_> {
        Random {
            choices: Some(choices),
            state: 1,
        }
    }

    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        match &mut self.choices {
            Some(choices) => choices
                .split_off_first()
                .map_or(n / 2, |&choice| usize::from(choice) % n),
            None => (self.bits() % n as u64) as usize,
        }
    }

    /// Numbers in [-2, 2), some 0 or 1.
    pub fn numbers(&mut self, n: usize) -> Vec<f32> {
        let mut number = || match self.below(8) {
            0 => 0.0,
            1 => 1.0,
            _ => (self.bits() >> 40) as f32 / (1 << 22) as f32 - 2.0,
        };
        (0..n).map(|_| number()).collect()
    }
}

/// An operation on three of the values made so far, counted from the latest.
pub struct Formula {
    kind: usize,
    values: [usize; 3],
    constant: f64,
}

pub enum Step {
    Compute(Formula),
    Get(usize),
    Set(usize, usize),
    When(Formula, Vec<Step>),
    /// Iterations, what comes before the stop, the stop, what comes after it.
    Times(usize, Vec<Step>, Option<Formula>, Vec<Step>),
}

fn formula(random: &mut Random<'_>) -> Formula {
    let constant = [0.0, 1.0, -1.0, 0.5, 2.0, 1.375][random.below(6)];
    Formula {
        kind: random.below(22),
        values: [0; 3].map(|_| random.below(24)),
        constant,
    }
}

/// Code with blocks inside each other; so many more loops and blocks may be opened.
pub fn code(random: &mut Random<'_>, loops: usize, blocks: usize, length: usize) -> Vec<Step> {
    let step = |random: &mut Random<'_>| match random.below(16) {
        0 | 1 if blocks > 0 => {
            let mask = formula(random);
            Step::When(mask, code(random, loops, blocks - 1, length * 2 / 3))
        }
        2 if loops > 0 => {
            let times = 1 + random.below(4);
            let before = code(random, loops - 1, blocks, length * 2 / 3);
            let stop = (random.below(3) > 0).then(|| formula(random));
            Step::Times(times, before, stop, code(random, loops - 1, blocks, 3))
        }
        3 => Step::Get(random.below(VARIABLES)),
        4 | 5 => Step::Set(random.below(VARIABLES), random.below(24)),
        _ => Step::Compute(formula(random)),
    };
    (0..length).map(|_| step(random)).collect()
}

/// What the code can reach.
struct Reach<C: Cx> {
    values: Vec<C::F>,
    variables: [C::V; VARIABLES],
}

impl<C: Cx> Reach<C> {
    fn value(&self, from_latest: usize) -> C::F {
        let n = self.values.len();
        self.values[n - 1 - from_latest % n]
    }

    fn compute(&self, f: &Formula) -> C::F {
        let [a, b, d] = f.values.map(|k| self.value(k));
        let k = C::F::c(f.constant);
        let x = match f.kind {
            0 => a + b,
            1 => a - b,
            2 => a * b,
            3 => k - a,
            4 => a.fma(b, d),
            5 => a.fnma(b, d),
            6 => a.fma(k, d),
            7 => a.fma(b, k),
            8 => (-a).fma(b, -d),
            9 => a.div(b.fma(b, C::F::c(1.0))),
            10 => k.div(a.fma(a, C::F::c(0.5))),
            11 => return -a,
            12 => a.min(b),
            13 => a.max(k),
            14 => (a.abs() + C::F::c(1.0)).sqrt(),
            15 => a.round(),
            16 => C::F::select(self.mask(f), a, b),
            17 => C::F::select(self.mask(f), a, C::F::c(0.0)),
            18 => C::F::select(self.mask(f), C::F::c(0.0), b),
            19 => C::F::select(self.mask(f), k, C::F::c(2.5)),
            20 => a.fma(a, a),
            _ => return a.sincos().0,
        };
        // every number stays finite
        x.max(C::F::c(-8.0)).min(C::F::c(8.0))
    }

    fn mask(&self, f: &Formula) -> MaskOf<C> {
        let [a, b, d] = f.values.map(|k| self.value(k));
        let (k, first) = (C::F::c(f.constant), a.lt(C::F::c(f.constant)));
        match f.kind % 6 {
            0 => first,
            1 => !first & d.lt(b),
            2 => first | b.lt(d),
            3 => !(first | d.lt(a)),
            4 => k.lt(b),
            _ => b.lt(a) & !d.lt(a),
        }
    }
}

fn body<C: Cx>(cx: &mut C, reach: &mut Reach<C>, steps: &[Step]) {
    let outside = reach.values.len();
    for step in steps {
        match step {
            Step::Compute(f) => {
                let value = reach.compute(f);
                reach.values.push(value);
            }
            Step::Get(v) => {
                let value = cx.get(&reach.variables[*v]);
                reach.values.push(value);
            }
            Step::Set(v, x) => {
                let x = reach.value(*x);
                cx.set(&mut reach.variables[*v], x);
            }
            Step::When(f, steps) => {
                let mask = reach.mask(f);
                when!(cx, mask, { body(cx, reach, steps) });
            }
            Step::Times(times, before, stop, after) => {
                let mut rounds = cx.times(*times);
                while cx.next(&mut rounds).is_some() {
                    body(cx, reach, before);
                    if let Some(stop) = stop {
                        let mask = reach.mask(stop);
                        break_if!(cx, mask);
                    }
                    body(cx, reach, after);
                }
            }
        }
    }
    reach.values.truncate(outside);
}

/// Runs the code; the variables come out, and the values made last.
pub fn run<C: Cx>(cx: &mut C, steps: &[Step], inputs: &[C::F]) -> Vec<C::F> {
    let variables = std::array::from_fn(|k| cx.var(inputs[k]));
    let mut reach: Reach<C> = Reach {
        values: inputs.to_vec(),
        variables,
    };
    body(cx, &mut reach, steps);
    let mut results: Vec<C::F> = reach.variables.iter().map(|v| cx.get(v)).collect();
    results.push(inputs[0] + inputs[1]);
    results
}

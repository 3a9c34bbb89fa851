//! What physics code is written in: scalars of many worlds ([`Num`]) and an execution context ([`Cx`]).
//!
//! Equations are plain functions over [`Num`], one value per world. Code with control flow or scratch memory takes a [`Cx`]
//! and the macros [`each!`], [`times!`], [`span!`], [`push!`], [`when!`] and [`break_if!`]. Three backends run it:
//!
//! - [`scalar`]: one world at a time, in `f64` (the reference) and `f32`,
//! - [`simd`]: registers with one world per lane,
//! - the recorder of crate `sim-record`, which writes WGSL.
//!
//! A run-time `if` on a world's value does not type-check: select with [`Num::select`], or open a block with [`when!`]. Loops
//! over the tree and branches on model constants are native Rust.

mod control;
pub mod memory;
pub mod scalar;
pub mod simd;
mod tables;

pub use tables::{Fixed, Table, Tables};

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// The precision in which constants of the model are kept: `f32` or `f64`.
pub trait Real: Copy + Default + PartialOrd + Send + Sync + std::fmt::Debug + 'static {
    /// Distance from 1 to the next larger value.
    const EPSILON: f64;
    /// True for `f64`.
    const DOUBLE: bool;
    /// Rounds a double to this precision.
    fn from_f64(x: f64) -> Self;
    /// Widens to a double.
    fn to_f64(self) -> f64;
    /// As an integer, rounded towards 0; 0 for negative values and NaN.
    #[inline(always)]
    fn to_usize(self) -> usize {
        self.to_f64() as usize
    }
}

impl Real for f32 {
    const EPSILON: f64 = f32::EPSILON as f64;
    const DOUBLE: bool = false;
    #[inline(always)]
    fn from_f64(x: f64) -> f32 {
        x as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    const EPSILON: f64 = f64::EPSILON;
    const DOUBLE: bool = true;
    #[inline(always)]
    fn from_f64(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

/// A scalar of every world of a block.
///
/// All operations are correctly rounded (IEEE 754) on the CPU, `fma` included: the result of a world does not depend on the
/// width of its block.
pub trait Num:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Precision of constants.
    type Real: Real;
    /// A boolean of every world; `&`, `|` and `!` combine masks.
    type Mask: Copy
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    /// The same constant in every world.
    fn k(x: Self::Real) -> Self;
    /// The same constant in every world, rounded from a double.
    #[inline(always)]
    fn c(x: f64) -> Self {
        Self::k(Self::Real::from_f64(x))
    }
    /// `self * b + c`, rounded once.
    fn fma(self, b: Self, c: Self) -> Self;
    /// `c - self * b`, rounded once.
    fn fnma(self, b: Self, c: Self) -> Self;
    /// `self / b`.
    fn div(self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The smaller; `b` where either is NaN.
    fn min(self, b: Self) -> Self;
    /// The larger; `b` where either is NaN.
    fn max(self, b: Self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Nearest integer, ties to even.
    fn round(self) -> Self;
    /// `self < b`, false where either is NaN.
    fn lt(self, b: Self) -> Self::Mask;
    /// `a` where the mask holds, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// The angle of the point (x, self) for self ≥ 0, x ≥ 0, not both 0: in [0, π/2].
    ///
    /// The Taylor series of atan(t), where t is the smaller over the larger. Past tan(π/8) the angle is reduced by π/4. The
    /// remainder is below an eighth of an ulp.
    #[inline(always)]
    fn atan2_positive(self, x: Self) -> Self {
        let (one, quarter) = (Self::c(1.0), Self::c(std::f64::consts::FRAC_PI_4));
        let steep = x.lt(self);
        let t = self.min(x).div(self.max(x));
        let far = Self::c(0.414_213_562_373_095_05).lt(t);
        let near = Self::select(far, (t - one).div(t + one), t);
        let square = near * near;
        let terms = if Self::Real::DOUBLE { 21 } else { 10 };
        let mut sum = Self::c(0.0);
        // `..`, not `..=`: a loop that ends with its bound is not unrolled
        for i in (1..terms + 1).rev() {
            sum = sum.fma(square, Self::c(sign(i) / (2 * i + 1) as f64));
        }
        let angle = (near * square).fma(sum, near);
        let angle = Self::select(far, angle + quarter, angle);
        Self::select(steep, Self::c(std::f64::consts::FRAC_PI_2) - angle, angle)
    }

    /// Sine and cosine by polynomials of our own: the same bits on every backend.
    ///
    /// Reduction to [-π/4, π/4] by three parts of π/2 (Cody and Waite 1980), then Taylor polynomials with a remainder below an
    /// eighth of an ulp. The error is about an ulp while |self| < 10⁴ in `f32`, 10⁸ in `f64`.
    #[inline(always)]
    fn sincos(self) -> (Self, Self) {
        let n = (self * Self::c(std::f64::consts::FRAC_2_PI)).round();
        let mut r = self;
        for part in half_pi_parts::<Self::Real>() {
            r = n.fnma(Self::c(part), r);
        }
        let r2 = r * r;
        let (mut s, mut c) = (Self::c(0.0), Self::c(0.0));
        let terms = if Self::Real::DOUBLE { 8 } else { 5 };
        for i in (1..terms + 1).rev() {
            s = s.fma(r2, Self::c(INVERSE_FACTORIAL[2 * i + 1] * sign(i)));
            c = c.fma(r2, Self::c(INVERSE_FACTORIAL[2 * i] * sign(i)));
        }
        let s = (r * r2).fma(s, r);
        let c = r2.fma(c, Self::c(1.0));
        // n mod 4 = swap + 2 half, by arithmetic that every backend has
        let quadrant = Self::c(4.0).fnma(n.fma(Self::c(0.25), Self::c(-0.375)).round(), n);
        let half = quadrant.fma(Self::c(0.5), Self::c(-0.25)).round();
        let swap = Self::c(2.0).fnma(half, quadrant);
        let swapped = Self::c(0.5).lt(swap);
        let sign_sin = Self::c(2.0).fnma(half, Self::c(1.0));
        let sign_cos = sign_sin * Self::c(2.0).fnma(swap, Self::c(1.0));
        (
            Self::select(swapped, c, s) * sign_sin,
            Self::select(swapped, s, c) * sign_cos,
        )
    }
}

#[inline(always)]
fn sign(i: usize) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// π/2 as a sum of three scalars of the given precision, largest first.
#[inline(always)]
fn half_pi_parts<R: Real>() -> [f64; 3] {
    if R::DOUBLE {
        [
            std::f64::consts::FRAC_PI_2,
            6.123_233_995_736_766e-17,
            -1.497_384_904_859_169_8e-33,
        ]
    } else {
        [
            1.570_796_370_506_286_6,
            -4.371_139_000_186_243e-8,
            -1.715_124_510_005_537_6e-15,
        ]
    }
}

/// 1/k! for k = 0..=17.
const INVERSE_FACTORIAL: [f64; 18] = {
    let mut t = [1.0; 18];
    let mut factorial = 1.0;
    let mut k = 1;
    while k < 18 {
        factorial *= k as f64;
        t[k] = 1.0 / factorial;
        k += 1;
    }
    t
};

/// A scalar of worlds in a register: the CPU can load and store it, and read single lanes.
pub trait Lane: Num + Default + Send + Sync + 'static {
    /// Worlds in a register.
    const WIDTH: usize;
    /// Reads `WIDTH` neighbouring values.
    fn load(from: &[Self::Real]) -> Self;
    /// Writes `WIDTH` neighbouring values.
    fn store(self, to: &mut [Self::Real]);
    /// Writes four scalars of every world next to each other: those of world w from `w * stride` on.
    fn store_rows(numbers: [Self; 4], to: &mut [Self::Real], stride: usize);
    /// The mask that holds in every world.
    fn all() -> Self::Mask;
    /// Does the mask hold in any world?
    fn any(mask: Self::Mask) -> bool;
    /// The mask as bits, lane 0 lowest.
    fn bits(mask: Self::Mask) -> u32;
    /// The scalar of one world.
    fn lane(self, lane: usize) -> Self::Real;
    /// Writes the scalar of each world of the mask to its lane of register `rows * stride` of `to`, where `rows` are whole. Other
    /// worlds keep theirs.
    fn scatter(self, mask: Self::Mask, to: &mut [Self], rows: Self, stride: usize);
    /// Reads one scalar for every world, at `places`: whole, and inside `from`.
    fn gather(from: &[Self::Real], places: Self) -> Self;
    /// In the lanes of `to`, lane k of each target becomes lane `from[k]` of its source; `from` is below `WIDTH`.
    fn take_lanes(targets: &mut [Self], sources: &[Self], from: &[u32], to: Self::Mask);
}

/// The execution context: variables, scratch rows, and control flow with a mask of active worlds.
///
/// A world that has left a loop stays out: it does not change while other worlds of its block iterate.
pub trait Cx: Sized {
    /// A scalar per world.
    type F: Num;
    /// A mutable cell, for values that change inside a block or between iterations of a loop.
    type V: Copy;
    /// A row or loop index, the same in all worlds.
    type I: Copy;
    /// A fresh row of a list, a different one in each world.
    type Row: Copy;
    /// An open loop.
    type Loop;
    /// An open block.
    type Block;
    /// A list of rows whose length is known at run time and differs per world.
    type List;

    /// A new variable.
    fn var(&mut self, x: Self::F) -> Self::V;
    /// Its present value.
    fn get(&self, v: &Self::V) -> Self::F;
    /// Assigns in the active worlds only.
    fn set(&mut self, v: &mut Self::V, x: Self::F);
    /// Assigns without a mask, where inactive worlds need no guard: `x` is the value they have already, or it is not read there.
    /// Cheaper than [`Cx::set`]; see [`Cx::only`].
    fn put(&mut self, v: &mut Self::V, x: Self::F);
    /// Adds 1 to a count of the active worlds and to one of the whole block, for a profile. Backends without one do nothing.
    #[inline(always)]
    fn tally(&mut self, _of_worlds: &mut Self::V, _of_block: &mut Self::V) {}
    /// `x` in the active worlds, 0 elsewhere.
    fn only(&mut self, x: Self::F) -> Self::F;
    /// `x` in the active worlds, -0 elsewhere: times a positive number or +0 it adds nothing to any sum, not even to the sign
    /// of a 0.
    #[inline(always)]
    fn or_nothing(&mut self, x: Self::F) -> Self::F {
        self.only(x)
    }

    /// Do all worlds of a block run each instruction, active or not? Then what some need is computed for all.
    const LOCKSTEP: bool = false;
    /// Does a backend wait long for what it loads, and is its code recorded? Then loads that do not depend on each other stand
    /// together.
    const GATHERS_LOADS: bool = false;
    /// May a class of contacts have several trees, and may the solver loop over a large system ([`crate::constants::rolled`])? Only
    /// recorded code has to be short for such models.
    const TAKES_HEAPS: bool = false;
    /// Values that loops change: the values themselves on a backend where those are cells, else the cells. Call
    /// [`Cx::put_values`] before, and [`Cx::get_values`] after.
    #[inline(always)]
    fn cells<'a>(
        &mut self,
        _values: &'a mut [Self::F],
        cells: &'a mut [Self::V],
    ) -> &'a mut [Self::V] {
        cells
    }
    /// Sets [`Cx::cells`] to the values.
    #[inline(always)]
    fn put_values(&mut self, values: &[Self::F], cells: &mut [Self::V]) {
        for (cell, value) in cells.iter_mut().zip(values) {
            self.put(cell, *value);
        }
    }
    /// Sets the values to [`Cx::cells`].
    #[inline(always)]
    fn get_values(&mut self, values: &mut [Self::F], cells: &[Self::V]) {
        for (value, cell) in values.iter_mut().zip(cells) {
            *value = self.get(cell);
        }
    }

    /// Does the solver add stiff contacts to a factor? Recorded code is longer with it, and has it where it is asked for.
    #[inline(always)]
    fn updates_factors(&self) -> bool {
        true
    }

    /// Threads that share the work of a world, a power of two: its *lanes*. They all run the same code, and a value is the same in
    /// all of them unless it comes from [`Cx::own`]. Where there is one, the methods for several but `load_at` are never called.
    #[inline(always)]
    fn lanes(&self) -> usize {
        1
    }
    /// Another value in each lane of a world; 0 where there is none.
    #[inline(always)]
    fn own(&mut self, _values: &[Self::F]) -> Self::F {
        unreachable!("a world has one lane")
    }
    /// The value that a lane of the world has.
    #[inline(always)]
    fn of_lane(&mut self, _x: Self::F, _lane: usize) -> Self::F {
        unreachable!("a world has one lane")
    }
    /// The sum over all lanes of the world, in a fixed order.
    #[inline(always)]
    fn sum_lanes(&mut self, _x: Self::F) -> Self::F {
        unreachable!("a world has one lane")
    }
    /// The largest of all lanes of the world.
    #[inline(always)]
    fn max_lanes(&mut self, _x: Self::F) -> Self::F {
        unreachable!("a world has one lane")
    }
    /// Reads scalar `k + column` of a row; `column` is whole, and may differ between the lanes of a world. Recorded code alone calls it.
    #[inline(always)]
    fn load_at(&mut self, _t: Table, _row: Self::I, _k: usize, _column: Self::F) -> Self::F {
        unreachable!("the code is not recorded")
    }

    /// A constant index.
    fn at(&self, i: usize) -> Self::I;
    /// An index as a scalar.
    fn number(&mut self, i: Self::I) -> Self::F;
    /// The number of the one world of a block. Only code that double precision alone runs may ask: lanes have several, and a
    /// recording has none.
    #[inline(always)]
    fn reference(&mut self, _x: Self::F) -> f64 {
        unreachable!("a block of double precision has one world")
    }
    /// Scalar `k` of a row of a table of the model.
    fn constant(&mut self, t: Fixed, row: Self::I, k: usize) -> Self::F;
    /// Neighbouring scalars of a row of a table of the model, from scalar `k` on.
    #[inline(always)]
    fn constants<const N: usize>(&mut self, t: Fixed, row: Self::I, k: usize) -> [Self::F; N] {
        let mut numbers = [Self::F::c(0.0); N];
        for (i, x) in numbers.iter_mut().enumerate() {
            *x = self.constant(t, row, k + i);
        }
        numbers
    }
    /// Scalar `k` of a row of a table of the model, another row in each world. `row` is whole, and clamped to the table. The
    /// result is undefined in inactive worlds.
    fn pick(&mut self, t: Fixed, row: Self::F, k: usize) -> Self::F;
    /// Index `k` of a row of an index table of the model, below `end`.
    fn index(&mut self, t: Fixed, row: Self::I, k: usize, end: usize) -> Self::I;
    /// Reads scalar `k` of a row.
    fn load(&mut self, t: Table, row: Self::I, k: usize) -> Self::F;
    /// Reads three neighbouring scalars of a row, from scalar `k` on.
    #[inline(always)]
    fn load3(&mut self, t: Table, row: Self::I, k: usize) -> [Self::F; 3] {
        [
            self.load(t, row, k),
            self.load(t, row, k + 1),
            self.load(t, row, k + 2),
        ]
    }
    /// Adds to cell c the dot product of `by` and the three scalars of a row from `k + 3 c` on. In inactive worlds `by` is
    /// [`Cx::only`] and the row was written with [`Cx::or_nothing`].
    #[inline(always)]
    fn add_triples(
        &mut self,
        t: Table,
        row: Self::I,
        k: usize,
        by: [Self::F; 3],
        cells: &mut [Self::V],
    ) {
        for (c, cell) in cells.iter_mut().enumerate() {
            let mut sum = self.get(cell);
            let triple = self.load3(t, row, k + 3 * c);
            for (x, by) in triple.into_iter().zip(by) {
                sum = x.fma(by, sum);
            }
            self.put(cell, sum);
        }
    }
    /// [`Cx::add_triples`] of three rows of a packed triangle, of `count`, `count` + 1 and `count` + 2 cells, that begin at rising
    /// places.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    fn add_triples_of_three(
        &mut self,
        t: Table,
        row: Self::I,
        k: usize,
        by: [[Self::F; 3]; 3],
        cells: &mut [Self::V],
        places: [usize; 3],
        count: usize,
    ) {
        for (i, (by, place)) in by.into_iter().zip(places).enumerate() {
            self.add_triples(t, row, k, by, &mut cells[place..place + count + i]);
        }
    }
    /// `sum` plus, for each x(c), the three scalars of a row from `k + 3 c` on times x(c). The result is undefined in inactive
    /// worlds.
    #[inline(always)]
    fn sum_triples(
        &mut self,
        t: Table,
        row: Self::I,
        k: usize,
        x: &[Self::F],
        sum: [Self::F; 3],
    ) -> [Self::F; 3] {
        let mut sum = sum;
        for (c, x) in x.iter().enumerate() {
            let triple = self.load3(t, row, k + 3 * c);
            for i in 0..3 {
                sum[i] = triple[i].fma(*x, sum[i]);
            }
        }
        sum
    }
    /// Writes scalar `k` of a row, in the active worlds only.
    fn store(&mut self, t: Table, row: Self::I, k: usize, x: Self::F);
    /// Writes scalar `k` of a row; it becomes undefined in inactive worlds.
    fn fill(&mut self, t: Table, row: Self::I, k: usize, x: Self::F);
    /// Writes neighbouring scalars of a row, from scalar `k` on, as [`Cx::fill`] does.
    #[inline(always)]
    fn fill_all<const N: usize>(
        &mut self,
        t: Table,
        row: Self::I,
        k: usize,
        numbers: [Self::F; N],
    ) {
        for (i, x) in numbers.into_iter().enumerate() {
            self.fill(t, row, k + i, x);
        }
    }
    /// First write to scalar `k` of a fresh row.
    fn init(&mut self, t: Table, row: Self::Row, k: usize, x: Self::F);
    /// First writes to the leading scalars of a fresh row.
    #[inline(always)]
    fn init_all(&mut self, t: Table, row: Self::Row, numbers: &[Self::F]) {
        for (k, x) in numbers.iter().enumerate() {
            self.init(t, row, k, *x);
        }
    }

    /// An empty list of at most `capacity` rows; rows that do not fit are counted, not stored.
    fn list(&mut self, capacity: usize) -> Self::List;
    /// A list that outlasts the stage: its rows are `first..first + capacity` of its tables, and its length is scalar 0 of row
    /// `at` of `counts`, read whenever the list is used. Where `first` and `capacity` are entries of a row of a fixed table, the
    /// rows of lists with later entries lie behind.
    fn kept(&mut self, counts: Table, at: Self::I, first: Self::I, capacity: Self::I)
    -> Self::List;
    /// Opens a block for the worlds in `mask`, with a fresh row; see [`push!`].
    fn push(
        &mut self,
        list: &mut Self::List,
        mask: MaskOf<Self>,
    ) -> (Self::Block, Option<Self::Row>);
    /// Rows that were pushed, those that did not fit included.
    fn pushed(&mut self, list: &Self::List) -> Self::F;
    /// Opens a block for the worlds in `mask`; false if there are none. See [`when!`].
    fn enter(&mut self, mask: MaskOf<Self>) -> (Self::Block, bool);
    /// False if the mask holds in no active world, so work for such worlds may be skipped. A backend that cannot know returns
    /// true, so results must be the same either way.
    #[inline(always)]
    fn anywhere(&mut self, _mask: MaskOf<Self>) -> bool {
        true
    }
    /// Are no more than `few` worlds active? False on a backend that cannot know; results are the same either way.
    #[inline(always)]
    fn are_few(&mut self, _few: usize) -> bool {
        false
    }
    /// Closes a block.
    fn leave(&mut self, block: Self::Block);

    /// Opens a loop over the rows of a list; see [`each!`].
    fn rows(&mut self, list: &Self::List) -> Self::Loop;
    /// Opens a loop of at most `n` iterations; see [`times!`].
    fn times(&mut self, n: usize) -> Self::Loop;
    /// Opens a loop over the indices `first..end`; see [`span!`].
    fn span(&mut self, first: Self::I, end: Self::I) -> Self::Loop;
    /// Enters the next iteration, or closes the loop.
    fn next(&mut self, l: &mut Self::Loop) -> Option<Self::I>;
    /// Ends the loop for the worlds in `mask`; true if none is left. See [`break_if!`].
    fn stop(&mut self, mask: MaskOf<Self>) -> bool;
}

/// Applies a function to each entry of an array.
///
/// `array::map`, `array::from_fn` and long closures may become functions of their own, which have none of the vector
/// instructions of their caller: then each operation of [`simd`] is a call. This never does; keep `f` short.
#[inline(always)]
pub fn map<A: Copy, const N: usize>(mut xs: [A; N], mut f: impl FnMut(A) -> A) -> [A; N] {
    for x in &mut xs {
        *x = f(*x);
    }
    xs
}

/// The mask of an execution context's scalars.
pub type MaskOf<C> = <<C as Cx>::F as Num>::Mask;

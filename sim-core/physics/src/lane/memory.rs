//! The execution context of the CPU: a mask of active worlds, and scratch rows of one block of worlds.

use super::{Cx, Fixed, Lane, Num, Real, Table, Tables};

/// Runs physics code natively: loops are Rust loops, blocks are masks.
pub struct Cpu<'a, F: Lane> {
    mask: F::Mask,
    memory: &'a mut [F],
    tables: &'a Tables<F::Real>,
}

impl<'a, F: Lane> Cpu<'a, F> {
    /// A context with every world active, over scratch memory and the tables of a model.
    #[inline(always)]
    pub fn new(memory: &'a mut [F], tables: &'a Tables<F::Real>) -> Self {
        Cpu {
            mask: F::all(),
            memory,
            tables,
        }
    }

    #[inline(always)]
    fn cell(&mut self, t: Table, row: usize, k: usize) -> &mut F {
        debug_assert!(
            row < t.rows && k < t.stride,
            "row {row}, number {k} of {t:?}"
        );
        &mut self.memory[t.base + row * t.stride + k]
    }

    /// Rows of a list per world. The count of a kept list is read whenever it is used, so that two handles of one list agree.
    #[inline(always)]
    fn count(&self, list: &Rows<F>) -> F {
        match list.home {
            Some(home) => self.memory[home],
            None => list.count,
        }
    }
}

/// `sum` plus the dot product of two triples.
#[inline(always)]
fn dot_add<F: Num>(a: &[F; 3], b: &[F; 3], sum: F) -> F {
    a[2].fma(b[2], a[1].fma(b[1], a[0].fma(b[0], sum)))
}

/// [`Cx::add_triples_of_three`] of rows of A, B = A + 1 and C = A + 2 cells: without a check of bounds inside.
#[inline(always)]
fn add_rows_of<F: Num, const A: usize, const B: usize, const C: usize>(
    triples: &[[F; 3]],
    by: &[[F; 3]; 3],
    rows: [&mut [F]; 3],
) {
    let [a, b, c] = rows;
    let (Some(triples), Some(a)) = (triples.first_chunk::<C>(), a.first_chunk_mut::<A>()) else {
        unreachable!("{A} cells");
    };
    let (Some(b), Some(c)) = (b.first_chunk_mut::<B>(), c.first_chunk_mut::<C>()) else {
        unreachable!("{B} and {C} cells");
    };
    for l in 0..A {
        // J is loaded once for all rows
        let j = triples[l];
        a[l] = dot_add(&j, &by[0], a[l]);
        b[l] = dot_add(&j, &by[1], b[l]);
        c[l] = dot_add(&j, &by[2], c[l]);
    }
    b[A] = dot_add(&triples[A], &by[1], b[A]);
    c[A] = dot_add(&triples[A], &by[2], c[A]);
    c[B] = dot_add(&triples[B], &by[2], c[B]);
}

/// Rows of every world, compacted: world w has rows first..first + count(w).
pub struct Rows<F> {
    first: usize,
    capacity: usize,
    /// Rows per world, those that did not fit included, where the list is not kept.
    count: F,
    /// Place of the count of a kept list.
    home: Option<usize>,
}

/// A fresh row of every world.
#[derive(Clone, Copy)]
pub struct Fresh<F> {
    row: F,
    /// The row, where it is the same in all worlds that have one.
    shared: Option<usize>,
}

/// An open loop: over the rows of a list, or over indices.
pub struct Loop<F: Lane> {
    /// Index of iteration 0.
    first: usize,
    round: usize,
    rounds: usize,
    outer: F::Mask,
    live: F::Mask,
    /// Rows per world where the loop runs over a list.
    count: Option<F>,
}

impl<F: Lane> Cx for Cpu<'_, F> {
    type F = F;
    type V = F;
    type I = usize;
    type Row = Fresh<F>;
    type Loop = Loop<F>;
    type Block = F::Mask;
    type List = Rows<F>;

    #[inline(always)]
    fn var(&mut self, x: F) -> F {
        x
    }
    #[inline(always)]
    fn get(&self, v: &F) -> F {
        *v
    }
    #[inline(always)]
    fn set(&mut self, v: &mut F, x: F) {
        *v = F::select(self.mask, x, *v);
    }
    #[inline(always)]
    fn put(&mut self, v: &mut F, x: F) {
        *v = x;
    }
    #[inline(always)]
    fn tally(&mut self, of_worlds: &mut F, of_block: &mut F) {
        *of_worlds = F::select(self.mask, *of_worlds + F::c(1.0), *of_worlds);
        *of_block = *of_block + F::c(1.0);
    }
    #[inline(always)]
    fn only(&mut self, x: F) -> F {
        F::select(self.mask, x, F::c(0.0))
    }

    #[inline(always)]
    fn or_nothing(&mut self, x: F) -> F {
        // -0 + x is x for every x, while 0 + -0 is 0
        F::select(self.mask, x, F::c(-0.0))
    }

    const LOCKSTEP: bool = true;
    #[inline(always)]
    fn cells<'a>(&mut self, values: &'a mut [F], _cells: &'a mut [F]) -> &'a mut [F] {
        values
    }
    #[inline(always)]
    fn put_values(&mut self, _values: &[F], _cells: &mut [F]) {}
    #[inline(always)]
    fn get_values(&mut self, _values: &mut [F], _cells: &[F]) {}

    #[inline(always)]
    fn at(&self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn number(&mut self, i: usize) -> F {
        F::c(i as f64)
    }
    #[inline(always)]
    fn reference(&mut self, x: F) -> f64 {
        x.lane(0).to_f64()
    }
    #[inline(always)]
    fn constant(&mut self, t: Fixed, row: usize, k: usize) -> F {
        debug_assert!(
            row < t.rows && k < t.stride,
            "row {row}, number {k} of {t:?}"
        );
        F::k(self.tables.numbers[t.base + row * t.stride + k])
    }
    #[inline(always)]
    fn constants<const N: usize>(&mut self, t: Fixed, row: usize, k: usize) -> [F; N] {
        debug_assert!(
            row < t.rows && k + N <= t.stride,
            "row {row}, numbers {k}.. of {t:?}"
        );
        let first = t.base + row * t.stride + k;
        // one check of the bounds instead of N
        let cells = &self.tables.numbers[first..first + N];
        let mut numbers = [F::c(0.0); N];
        for i in 0..N {
            numbers[i] = F::k(cells[i]);
        }
        numbers
    }
    #[inline(always)]
    fn pick(&mut self, t: Fixed, row: F, k: usize) -> F {
        debug_assert!(k < t.stride, "number {k} of {t:?}");
        // NaN becomes 0
        let row = row.max(F::c(0.0)).min(F::c(t.rows as f64 - 1.0));
        let numbers = &self.tables.numbers[t.base + k..t.base + t.rows * t.stride];
        F::gather(numbers, row * F::c(t.stride as f64))
    }
    #[inline(always)]
    fn index(&mut self, t: Fixed, row: usize, k: usize, end: usize) -> usize {
        debug_assert!(
            row < t.rows && k < t.stride,
            "row {row}, number {k} of {t:?}"
        );
        let index = self.tables.indices[t.base + row * t.stride + k] as usize;
        debug_assert!(index < end, "index {index} of {t:?} is not below {end}");
        index
    }
    #[inline(always)]
    fn load(&mut self, t: Table, row: usize, k: usize) -> F {
        *self.cell(t, row, k)
    }
    #[inline(always)]
    fn load3(&mut self, t: Table, row: usize, k: usize) -> [F; 3] {
        debug_assert!(
            row < t.rows && k + 2 < t.stride,
            "row {row}, numbers {k} to {} of {t:?}",
            k + 2
        );
        let first = t.base + row * t.stride + k;
        // one check of the bounds instead of three
        let &[x, y, z] = &self.memory[first..first + 3] else {
            unreachable!("three numbers")
        };
        [x, y, z]
    }
    #[inline(always)]
    fn add_triples(&mut self, t: Table, row: usize, k: usize, by: [F; 3], cells: &mut [F]) {
        let first = t.base + row * t.stride + k;
        // one check of the bounds instead of one per scalar
        let (triples, _) = self.memory[first..first + 3 * cells.len()].as_chunks::<3>();
        for (cell, j) in cells.iter_mut().zip(triples) {
            *cell = dot_add(j, &by, *cell);
        }
    }
    #[inline(always)]
    fn add_triples_of_three(
        &mut self,
        t: Table,
        row: usize,
        k: usize,
        by: [[F; 3]; 3],
        cells: &mut [F],
        places: [usize; 3],
        count: usize,
    ) {
        let first = t.base + row * t.stride + k;
        let (triples, _) = self.memory[first..first + 3 * (count + 2)].as_chunks::<3>();
        let (before, c) = cells.split_at_mut(places[2]);
        let (before, b) = before.split_at_mut(places[1]);
        let rows = [&mut before[places[0]..], b, c];
        match count {
            1 => add_rows_of::<F, 1, 2, 3>(triples, &by, rows),
            4 => add_rows_of::<F, 4, 5, 6>(triples, &by, rows),
            7 => add_rows_of::<F, 7, 8, 9>(triples, &by, rows),
            10 => add_rows_of::<F, 10, 11, 12>(triples, &by, rows),
            13 => add_rows_of::<F, 13, 14, 15>(triples, &by, rows),
            _ => {
                for (i, (by, row)) in by.iter().zip(rows).enumerate() {
                    for (cell, j) in row[..count + i].iter_mut().zip(triples) {
                        *cell = dot_add(j, by, *cell);
                    }
                }
            }
        }
    }
    #[inline(always)]
    fn sum_triples(&mut self, t: Table, row: usize, k: usize, x: &[F], sum: [F; 3]) -> [F; 3] {
        let first = t.base + row * t.stride + k;
        let (triples, _) = self.memory[first..first + 3 * x.len()].as_chunks::<3>();
        let mut sum = sum;
        for (x, triple) in x.iter().zip(triples) {
            for i in 0..3 {
                sum[i] = triple[i].fma(*x, sum[i]);
            }
        }
        sum
    }
    #[inline(always)]
    fn store(&mut self, t: Table, row: usize, k: usize, x: F) {
        let mask = self.mask;
        let cell = self.cell(t, row, k);
        *cell = F::select(mask, x, *cell);
    }
    #[inline(always)]
    fn fill(&mut self, t: Table, row: usize, k: usize, x: F) {
        *self.cell(t, row, k) = x;
    }
    #[inline(always)]
    fn fill_all<const N: usize>(&mut self, t: Table, row: usize, k: usize, numbers: [F; N]) {
        debug_assert!(
            row < t.rows && k + N <= t.stride,
            "row {row}, numbers {k}.. of {t:?}"
        );
        let first = t.base + row * t.stride + k;
        // one check of the bounds instead of N
        self.memory[first..first + N].copy_from_slice(&numbers);
    }
    #[inline(always)]
    fn init(&mut self, t: Table, row: Fresh<F>, k: usize, x: F) {
        if let Some(shared) = row.shared {
            return self.store(t, shared, k, x);
        }
        debug_assert!(k < t.stride, "number {k} of {t:?}");
        debug_assert!(
            !F::any(self.mask & F::c(t.rows as f64 - 0.5).lt(row.row)),
            "a row beyond {t:?}"
        );
        let rows = &mut self.memory[t.base + k..];
        x.scatter(self.mask, rows, row.row, t.stride);
    }

    #[inline(always)]
    fn list(&mut self, capacity: usize) -> Rows<F> {
        Rows {
            first: 0,
            capacity,
            count: F::c(0.0),
            home: None,
        }
    }
    #[inline(always)]
    fn kept(&mut self, counts: Table, at: usize, first: usize, capacity: usize) -> Rows<F> {
        debug_assert!(at < counts.rows, "row {at} of {counts:?}");
        Rows {
            first,
            capacity,
            count: F::c(0.0),
            home: Some(counts.base + at * counts.stride),
        }
    }
    #[inline(always)]
    fn push(&mut self, list: &mut Rows<F>, mask: F::Mask) -> (F::Mask, Option<Fresh<F>>) {
        let outer = self.mask;
        let pushing = outer & mask;
        if !F::any(pushing) {
            return (outer, None);
        }
        let count = self.count(list);
        let more = F::select(pushing, count + F::c(1.0), count);
        match list.home {
            Some(home) => self.memory[home] = more,
            None => list.count = more,
        }
        let fits = pushing & count.lt(F::c(list.capacity as f64 - 0.5));
        if !F::any(fits) {
            return (outer, None);
        }
        self.mask = fits;
        let lowest = count.lane(F::bits(fits).trailing_zeros() as usize);
        let same = F::k(lowest);
        let differs = count.lt(same) | same.lt(count);
        let shared = match F::any(fits & differs) {
            true => None,
            false => Some(list.first + lowest.to_usize()),
        };
        let row = count + F::c(list.first as f64);
        (outer, Some(Fresh { row, shared }))
    }
    #[inline(always)]
    fn pushed(&mut self, list: &Rows<F>) -> F {
        self.count(list)
    }
    #[inline(always)]
    fn enter(&mut self, mask: F::Mask) -> (F::Mask, bool) {
        let outer = self.mask;
        self.mask = outer & mask;
        (outer, F::any(self.mask))
    }
    #[inline(always)]
    fn anywhere(&mut self, mask: F::Mask) -> bool {
        F::any(self.mask & mask)
    }
    #[inline(always)]
    fn are_few(&mut self, few: usize) -> bool {
        F::bits(self.mask).count_ones() as usize <= few
    }
    #[inline(always)]
    fn leave(&mut self, block: F::Mask) {
        self.mask = block;
    }

    #[inline(always)]
    fn rows(&mut self, list: &Rows<F>) -> Loop<F> {
        Loop {
            first: list.first,
            round: 0,
            rounds: list.capacity,
            outer: self.mask,
            live: self.mask,
            count: Some(self.count(list)),
        }
    }
    #[inline(always)]
    fn times(&mut self, n: usize) -> Loop<F> {
        self.span(0, n)
    }
    #[inline(always)]
    fn span(&mut self, first: usize, end: usize) -> Loop<F> {
        Loop {
            first,
            round: 0,
            rounds: end.saturating_sub(first),
            outer: self.mask,
            live: self.mask,
            count: None,
        }
    }
    #[inline(always)]
    fn next(&mut self, l: &mut Loop<F>) -> Option<usize> {
        let round = l.round;
        if round > 0 {
            // a world that stopped, or whose rows ended, in the last iteration stays out
            l.live = self.mask;
        }
        if round < l.rounds {
            self.mask = match l.count {
                Some(count) => l.live & F::c(round as f64 + 0.5).lt(count),
                None => l.live,
            };
            if F::any(self.mask) {
                l.round = round + 1;
                return Some(l.first + round);
            }
        }
        self.mask = l.outer;
        None
    }
    #[inline(always)]
    fn stop(&mut self, mask: F::Mask) -> bool {
        self.mask = self.mask & !mask;
        !F::any(self.mask)
    }
}

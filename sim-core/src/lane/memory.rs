//! The CPU machine: a mask of active worlds, and scratch rows of one block of worlds.

use super::{Cx, Lane, Table};

/// Runs the text natively: loops are Rust loops, blocks are masks.
pub struct Cpu<'a, F: Lane> {
    mask: F::Mask,
    memory: &'a mut [F],
}

impl<'a, F: Lane> Cpu<'a, F> {
    /// A machine with every world active, over scratch memory for the tables of the text.
    #[inline(always)]
    pub fn new(memory: &'a mut [F]) -> Self {
        Cpu {
            mask: F::all(),
            memory,
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
}

/// Rows of every world, compacted: world w has rows 0..count(w).
pub struct Rows<F> {
    capacity: usize,
    /// Rows that any world has.
    used: usize,
    /// Rows per world, those that did not fit included.
    count: F,
}

/// An open loop: over the rows of a list, or a number of rounds.
pub struct Loop<F: Lane> {
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
    type Row = F;
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
    fn at(&self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn load(&mut self, t: Table, row: usize, k: usize) -> F {
        *self.cell(t, row, k)
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
    fn init(&mut self, t: Table, row: F, k: usize, x: F) {
        // the row number differs per world: write each row for the worlds that are at it
        let mut rest = self.mask;
        for r in 0..t.rows {
            if !F::any(rest) {
                break;
            }
            let here = F::and(rest, row.lt(F::c(r as f64 + 0.5)));
            rest = F::and(rest, F::not(here));
            let cell = self.cell(t, r, k);
            *cell = F::select(here, x, *cell);
        }
    }

    #[inline(always)]
    fn list(&mut self, capacity: usize) -> Rows<F> {
        Rows {
            capacity,
            used: 0,
            count: F::c(0.0),
        }
    }
    #[inline(always)]
    fn push(&mut self, list: &mut Rows<F>, mask: F::Mask) -> (F::Mask, Option<F>) {
        let outer = self.mask;
        let pushing = F::and(outer, mask);
        if !F::any(pushing) {
            return (outer, None);
        }
        let row = list.count;
        list.count = F::select(pushing, row + F::c(1.0), row);
        let fits = F::and(pushing, row.lt(F::c(list.capacity as f64 - 0.5)));
        if !F::any(fits) {
            return (outer, None);
        }
        // rows are filled in order, so at most one more row comes into use
        if list.used < list.capacity && F::any(F::and(fits, F::c(list.used as f64 - 0.5).lt(row))) {
            list.used += 1;
        }
        self.mask = fits;
        (outer, Some(row))
    }
    #[inline(always)]
    fn pushed(&mut self, list: &Rows<F>) -> F {
        list.count
    }
    #[inline(always)]
    fn enter(&mut self, mask: F::Mask) -> (F::Mask, bool) {
        let outer = self.mask;
        self.mask = F::and(outer, mask);
        (outer, F::any(self.mask))
    }
    #[inline(always)]
    fn leave(&mut self, block: F::Mask) {
        self.mask = block;
    }

    #[inline(always)]
    fn rows(&mut self, list: &Rows<F>) -> Loop<F> {
        Loop {
            round: 0,
            rounds: list.used,
            outer: self.mask,
            live: self.mask,
            count: Some(list.count),
        }
    }
    #[inline(always)]
    fn times(&mut self, n: usize) -> Loop<F> {
        Loop {
            round: 0,
            rounds: n,
            outer: self.mask,
            live: self.mask,
            count: None,
        }
    }
    #[inline(always)]
    fn next(&mut self, l: &mut Loop<F>) -> Option<usize> {
        let round = l.round;
        if round > 0 {
            // a world that stopped in the last round stays stopped; one whose rows ended stays so too
            l.live = self.mask;
        }
        if round < l.rounds {
            self.mask = match l.count {
                Some(count) => F::and(l.live, F::c(round as f64 + 0.5).lt(count)),
                None => l.live,
            };
            if F::any(self.mask) {
                l.round = round + 1;
                return Some(round);
            }
        }
        self.mask = l.outer;
        None
    }
    #[inline(always)]
    fn stop(&mut self, mask: F::Mask) -> bool {
        self.mask = F::and(self.mask, F::not(mask));
        !F::any(self.mask)
    }
}

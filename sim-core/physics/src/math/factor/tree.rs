//! Blocks that are a tree: every row couples to the rows on its path to the root, and to no others.
//!
//! A row keeps its path only, root first, so elimination subtracts a prefix of the row from the row of each ancestor. Rows
//! that follow each other on a path are taken up to [`SEGMENT`] at a time: an ancestor's scalar is then loaded and stored once
//! for all of them, with less than half of the instructions (a step of a quadruped is 15 % faster). The root's rows are a
//! full triangle, and run as [`super::dense`].
//!
//! The rows of a segment are subtracted from three ancestors at once, so that a row's scalar is loaded once for three products: one ancestor at a
//! time takes four loads and a store for three products.

use super::dense;
use super::pattern::{Block, Path, Pattern};
use crate::lane::Num;
use std::ops::Range;

/// Most rows of a segment that does not begin at the root: its own entries stay in registers.
pub(super) const SEGMENT: usize = 3;

/// `f::<F, S>(…)` for the S that is the segment's size.
macro_rules! of_size {
    ($size:expr, $f:ident($($arg:expr),*)) => {
        match $size {
            1 => $f::<F, 1>($($arg),*),
            2 => $f::<F, 2>($($arg),*),
            _ => $f::<F, SEGMENT>($($arg),*),
        }
    };
}

/// `f::<F, S, I>(…)` for every I that begins [`AT_ONCE`] ancestors below `n` and [`UNROLLED`], in descending order: a loop over
/// a short row costs more than its arithmetic.
macro_rules! ancestors {
    ($n:expr, $f:ident($($arg:expr),*)) => {
        ancestors!(@ $n, $f($($arg),*), 9 6 3 0)
    };
    (@ $n:expr, $f:ident $args:tt, $($i:literal)*) => {
        $(ancestors!(@one $n, $f $args, $i);)*
    };
    (@one $n:expr, $f:ident($($arg:expr),*), $i:literal) => {
        if $i + AT_ONCE <= $n {
            $f::<F, S, $i>($($arg),*);
        }
    };
}

/// Ancestors whose rows are unrolled.
const UNROLLED: usize = 12;
/// Ancestors from which rows are subtracted at once.
const AT_ONCE: usize = 3;

#[inline(always)]
pub(super) fn solve<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F], x: &mut [F]) {
    for segment in pattern.segments(block).iter().rev() {
        let (above, entries) = a[..segment.range().end].split_at_mut(segment.start);
        let (x_above, x) = x[..segment.rows().end].split_at_mut(segment.first);
        if segment.is_root() {
            dense::factor(segment.size, entries, x);
        } else {
            let path = pattern.path(block, segment.first);
            of_size!(segment.size, eliminate(above, entries, &path, x_above, x));
        }
    }
    for segment in pattern.segments(block) {
        let entries = &a[segment.range()];
        let (x_above, x) = x[..segment.rows().end].split_at_mut(segment.first);
        if segment.is_root() {
            dense::forward(segment.size, entries, x);
        } else {
            let path = pattern.path(block, segment.first).rows;
            of_size!(segment.size, forward(entries, path, x_above, x));
        }
    }
}

/// The rows of a segment with `path` ancestors.
#[inline(always)]
fn split<F, const S: usize>(mut entries: &mut [F], path: usize) -> [&mut [F]; S] {
    let mut rows = [(); S].map(|()| <&mut [F]>::default());
    for (k, row) in rows.iter_mut().enumerate() {
        let (head, rest) = entries.split_at_mut(path + k + 1);
        (*row, entries) = (head, rest);
    }
    rows
}

/// Removes S rows from the rows of their ancestors.
#[inline(always)]
fn eliminate<F: Num, const S: usize>(
    above: &mut [F],
    entries: &mut [F],
    path: &Path<'_>,
    x_above: &mut [F],
    x: &mut [F],
) {
    let length = path.rows.len();
    let mut segment = Removed::<F, S>::new(entries, length, x);
    // from the last ancestor on, so many that the others are a multiple
    let mut i = length;
    while !i.is_multiple_of(AT_ONCE) {
        i -= 1;
        let target = &mut above[path.starts[i]..path.starts[i] + i + 1];
        let columns = std::iter::once(0..i);
        segment.subtract_from(i, columns, [target], x_above, [path.rows[i]]);
    }
    while i > UNROLLED {
        i -= AT_ONCE;
        subtract_at::<F, S>(i, above, path, &mut segment, x_above);
    }
    ancestors!(length, subtract(above, path, &mut segment, x_above));
}

/// S rows eliminated among themselves, ready to be subtracted from the rows of their ancestors.
pub(super) struct Removed<'a, F, const S: usize> {
    /// Their entries with the ancestors.
    rows: [&'a mut [F]; S],
    /// Their 1/D.
    inverse: [F; S],
    /// Their part of the right-hand side.
    y: [F; S],
}

impl<'a, F: Num, const S: usize> Removed<'a, F, S> {
    /// From the rows' scalars and the count of their ancestors.
    #[inline(always)]
    pub fn new(entries: &'a mut [F], length: usize, x: &mut [F]) -> Self {
        let (mut removed, l) = Removed::of_corner(entries, length, x);
        removed.complete(&l, 0..length);
        removed
    }

    /// The rows eliminated among themselves, but for their entries with ancestors. [`Removed::complete`] does these by the L that
    /// is returned.
    #[inline(always)]
    pub fn of_corner(entries: &'a mut [F], length: usize, x: &mut [F]) -> (Self, [[F; S]; S]) {
        let mut rows = split::<F, S>(entries, length);
        // 1/D on the diagonal, L below it
        let mut l = [[F::c(0.0); S]; S];
        let mut y = [F::c(0.0); S];
        y.copy_from_slice(x);
        for k in 0..S {
            l[k][..k + 1].copy_from_slice(&rows[k][length..]);
        }
        for k in (0..S).rev() {
            let inverse = super::inverse(l[k][k]);
            l[k][k] = inverse;
            for i in (0..k).rev() {
                let share = l[k][i] * inverse;
                for j in 0..i + 1 {
                    l[i][j] = share.fnma(l[k][j], l[i][j]);
                }
                l[k][i] = share;
                y[i] = y[k].fnma(share, y[i]);
            }
        }
        let mut inverse = [F::c(0.0); S];
        for k in 0..S {
            inverse[k] = l[k][k];
            x[k] = y[k] * inverse[k];
            rows[k][length..].copy_from_slice(&l[k][..k + 1]);
            rows[k] = &mut std::mem::take(&mut rows[k])[..length];
        }
        (Removed { rows, inverse, y }, l)
    }

    /// Eliminates the rows among themselves in some columns of their ancestors.
    #[inline(always)]
    pub fn complete(&mut self, l: &[[F; S]; S], columns: Range<usize>) {
        for j in columns {
            let mut column = [F::c(0.0); S];
            for k in 0..S {
                column[k] = self.rows[k][j];
            }
            for k in (1..S).rev() {
                for i in 0..k {
                    column[i] = l[k][i].fnma(column[k], column[i]);
                }
            }
            for k in 0..S - 1 {
                self.rows[k][j] = column[k];
            }
        }
    }

    /// What of each row is subtracted from the T ancestors that follow `first`.
    #[inline(always)]
    fn shares<const T: usize>(&self, first: usize) -> [[F; S]; T] {
        let mut shares = [[F::c(0.0); S]; T];
        for t in 0..T {
            for k in 0..S {
                shares[t][k] = self.rows[k][first + t] * self.inverse[k];
            }
        }
        shares
    }

    /// Subtracts the rows from those of the T ancestors that follow `first`, which have the entries of `columns` and their own;
    /// and from their parts of the right-hand side, which are at `places` of `x`.
    #[inline(always)]
    pub fn subtract_from<const T: usize>(
        &mut self,
        first: usize,
        columns: impl Iterator<Item = Range<usize>>,
        mut targets: [&mut [F]; T],
        x: &mut [F],
        places: [usize; T],
    ) {
        let shares = self.shares::<T>(first);
        for columns in columns {
            self.subtract_columns(&shares, &mut targets, columns);
        }
        // columns that not all of the ancestors have
        for t in 0..T {
            for j in first..first + t + 1 {
                let mut entry = targets[t][j];
                for k in (0..S).rev() {
                    entry = shares[t][k].fnma(self.rows[k][j], entry);
                }
                targets[t][j] = entry;
            }
            let mut xi = x[places[t]];
            for k in (0..S).rev() {
                xi = self.y[k].fnma(shares[t][k], xi);
            }
            x[places[t]] = xi;
        }
        for t in 0..T {
            for k in 0..S {
                self.rows[k][first + t] = shares[t][k];
            }
        }
    }

    /// Subtracts in columns that all of the ancestors have: a scalar of them is loaded and stored once for S rows, one of the rows
    /// loaded once for T ancestors.
    #[inline(always)]
    fn subtract_columns<const T: usize>(
        &self,
        shares: &[[F; S]; T],
        targets: &mut [&mut [F]; T],
        columns: Range<usize>,
    ) {
        // of one length, so that the loop has no check
        let length = columns.len();
        let mut rows: [&[F]; S] = [&[]; S];
        for k in 0..S {
            rows[k] = &self.rows[k][columns.clone()][..length];
        }
        let mut cells = [(); T].map(|()| <&mut [F]>::default());
        for (cells, target) in cells.iter_mut().zip(targets) {
            *cells = &mut target[columns.clone()][..length];
        }
        for j in 0..length {
            let mut entries = [F::c(0.0); T];
            for t in 0..T {
                entries[t] = cells[t][j];
            }
            for k in (0..S).rev() {
                let x = rows[k][j];
                for t in 0..T {
                    entries[t] = shares[t][k].fnma(x, entries[t]);
                }
            }
            for t in 0..T {
                cells[t][j] = entries[t];
            }
        }
    }
}

/// The rows of the [`AT_ONCE`] ancestors from I on less their shares of S rows.
#[inline(always)]
fn subtract<F: Num, const S: usize, const I: usize>(
    above: &mut [F],
    path: &Path<'_>,
    segment: &mut Removed<'_, F, S>,
    x_above: &mut [F],
) {
    subtract_at::<F, S>(I, above, path, segment, x_above);
}

/// [`subtract`] of a place that is known at run time.
#[inline(always)]
fn subtract_at<F: Num, const S: usize>(
    i: usize,
    above: &mut [F],
    path: &Path<'_>,
    segment: &mut Removed<'_, F, S>,
    x_above: &mut [F],
) {
    // starts rise along a path, and its rows do not overlap
    let &[a, b, c] = &path.starts[i..i + AT_ONCE] else {
        unreachable!("{AT_ONCE} ancestors")
    };
    let (rest, third) = above.split_at_mut(c);
    let (rest, second) = rest.split_at_mut(b);
    let targets = [
        &mut rest[a..a + i + 1],
        &mut second[..i + 2],
        &mut third[..i + 3],
    ];
    let &[a, b, c] = &path.rows[i..i + AT_ONCE] else {
        unreachable!("{AT_ONCE} ancestors")
    };
    segment.subtract_from(i, std::iter::once(0..i), targets, x_above, [a, b, c]);
}

/// The rows of a segment of `path` ancestors, to read: their entries with the ancestors, all of one length, and those among
/// themselves.
#[inline(always)]
pub(super) fn split_ref<F: Num, const S: usize>(
    mut entries: &[F],
    path: usize,
) -> ([&[F]; S], [[F; S]; S]) {
    let mut rows = [&entries[..0]; S];
    let mut corner = [[F::c(0.0); S]; S];
    for k in 0..S {
        let (row, rest) = entries.split_at(path + k + 1);
        corner[k][..k + 1].copy_from_slice(&row[path..]);
        (rows[k], entries) = (&row[..path], rest);
    }
    (rows, corner)
}

#[inline(always)]
pub(super) fn forward<F: Num, const S: usize>(
    entries: &[F],
    path: &[usize],
    above: &[F],
    x: &mut [F],
) {
    let (rows, corner) = split_ref::<F, S>(entries, path.len());
    let mut y = [F::c(0.0); S];
    y.copy_from_slice(x);
    for (j, &i) in path.iter().enumerate() {
        let xi = above[i];
        for k in 0..S {
            y[k] = rows[k][j].fnma(xi, y[k]);
        }
    }
    for k in 0..S {
        for i in 0..k {
            y[k] = corner[k][i].fnma(y[i], y[k]);
        }
    }
    x.copy_from_slice(&y);
}

#[inline(always)]
pub(super) fn multiply<F: Num>(pattern: &Pattern, block: &Block, a: &[F], x: &[F], y: &mut [F]) {
    for segment in pattern.segments(block) {
        let entries = &a[segment.range()];
        if segment.is_root() {
            let rows = segment.rows();
            dense::multiply(segment.size, entries, &x[rows.clone()], &mut y[rows]);
        } else {
            let path = pattern.path(block, segment.first).rows;
            of_size!(segment.size, add_rows(entries, path, segment.first, x, y));
        }
    }
}

/// Adds the products of S rows that follow each other, the first of them row `first`, and of their columns. What is above is
/// loaded and stored once for all of them.
#[inline(always)]
pub(super) fn add_rows<F: Num, const S: usize>(
    entries: &[F],
    path: &[usize],
    first: usize,
    x: &[F],
    y: &mut [F],
) {
    let (rows, corner) = split_ref::<F, S>(entries, path.len());
    let mut x_own = [F::c(0.0); S];
    x_own.copy_from_slice(&x[first..first + S]);
    let mut y_own = [F::c(0.0); S];
    for k in 0..S {
        y_own[k] = corner[k][k] * x_own[k];
    }
    // one check of the bounds for both
    let x = &x[..y.len()];
    for (j, &i) in path.iter().enumerate() {
        let (xi, mut yi) = (x[i], y[i]);
        for k in 0..S {
            y_own[k] = rows[k][j].fma(xi, y_own[k]);
            yi = rows[k][j].fma(x_own[k], yi);
        }
        y[i] = yi;
    }
    // after the ancestors, in the order of a loop over single rows
    for k in 0..S {
        for i in 0..k {
            y_own[k] = corner[k][i].fma(x_own[i], y_own[k]);
            y_own[i] = corner[k][i].fma(x_own[k], y_own[i]);
        }
    }
    y[first..first + S].copy_from_slice(&y_own);
}

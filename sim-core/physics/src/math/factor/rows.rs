//! Kernels that work row by row. Their code is short, for matrices that few worlds factor. The order of operations is that of the
//! other kernels.

use super::pattern::{Block, Kind, Pattern};
use super::{inverse, tri};
use crate::lane::Num;
use std::ops::Range;

/// A row of a block.
struct Row<'a> {
    /// Its scalars, counted from the block's first; the diagonal is the last.
    scalars: Range<usize>,
    /// Its columns before the diagonal, counted from the block's first.
    columns: &'a [usize],
    /// Has it the scalars of its columns alone, or those of all before it?
    is_path: bool,
}

impl<'a> Row<'a> {
    fn new(pattern: &'a Pattern, block: &Block, k: usize) -> Row<'a> {
        let columns = pattern.path(block, k).rows;
        let scalars = pattern.row(block, k);
        let is_path = block.kind == Kind::Tree;
        Row {
            scalars,
            columns,
            is_path,
        }
    }

    /// Place of the n-th of its columns.
    #[inline(always)]
    fn at(&self, n: usize) -> usize {
        self.scalars.start + if self.is_path { n } else { self.columns[n] }
    }

    #[inline(always)]
    fn diagonal(&self) -> usize {
        self.scalars.end - 1
    }
}

/// A := its factor: L below the diagonal, 1/D on it.
#[inline(always)]
pub(super) fn decompose<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F]) {
    for k in (0..block.size).rev() {
        let row = Row::new(pattern, block, k);
        let pivot = inverse(a[row.diagonal()]);
        a[row.diagonal()] = pivot;
        for n in (0..row.columns.len()).rev() {
            let share = a[row.at(n)] * pivot;
            // the columns that the row has up to this one are among those of that row
            let target = Row::new(pattern, block, row.columns[n]);
            for j in 0..n + 1 {
                let place = match row.is_path {
                    true => target.scalars.start + j,
                    false => tri(row.columns[n], row.columns[j]),
                };
                a[place] = share.fnma(a[row.at(j)], a[place]);
            }
            a[row.at(n)] = share;
        }
    }
}

/// x := A⁻¹ x, for the factor of A.
#[inline(always)]
pub(super) fn substitute<F: Num>(pattern: &Pattern, block: &Block, factor: &[F], x: &mut [F]) {
    // x := D⁻¹ L⁻ᵀ x
    for k in (0..block.size).rev() {
        let row = Row::new(pattern, block, k);
        let xk = x[k];
        for (n, &i) in row.columns.iter().enumerate() {
            x[i] = factor[row.at(n)].fnma(xk, x[i]);
        }
        x[k] = factor[row.diagonal()] * xk;
    }
    // x := L⁻¹ x
    for k in 0..block.size {
        let row = Row::new(pattern, block, k);
        let mut xk = x[k];
        for (n, &i) in row.columns.iter().enumerate() {
            xk = factor[row.at(n)].fnma(x[i], xk);
        }
        x[k] = xk;
    }
}

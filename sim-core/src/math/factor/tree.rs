//! Blocks that are a tree: every row couples to the rows on its path to the root, and to no others.
//!
//! A row keeps its path only, root first, so that the row of an ancestor is as long as its place on the
//! path: what elimination subtracts is a prefix of the row. As in [`super::dense`], every length has its
//! own body; only where the ancestors' rows lie is looked up.

use super::pattern::{Block, Pattern};
use crate::lane::Num;

/// Length of the longest path that is unrolled.
const LONGEST: usize = 16;

/// `f::<F, K>(…)` for the K that is `n`, or `else_` past the longest.
macro_rules! of_length {
    ($n:expr, $f:ident($($arg:expr),*), $else_:expr) => {
        of_length!(@ $n, $f($($arg),*), $else_, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16)
    };
    (@ $n:expr, $f:ident $args:tt, $else_:expr, $($k:literal)*) => {
        match $n {
            $($k => of_length!(@one $f $args, $k),)*
            _ => $else_,
        }
    };
    (@one $f:ident($($arg:expr),*), $k:literal) => {
        $f::<F, $k>($($arg),*)
    };
}

#[inline(always)]
pub(super) fn factor<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F]) {
    for k in (0..block.size).rev() {
        let path = pattern.path(block, k);
        let (above, rest) = a.split_at_mut(path.start);
        let row = &mut rest[..path.rows.len() + 1];
        of_length!(
            path.rows.len(),
            eliminate(above, row, path.starts),
            eliminate_long(above, row, path.starts)
        );
    }
}

/// Removes a row of path length K from the rows of its ancestors.
#[inline(always)]
fn eliminate<F: Num, const K: usize>(above: &mut [F], row: &mut [F], starts: &[usize]) {
    debug_assert!(K <= LONGEST);
    let (row, starts) = (&mut row[..K + 1], &starts[..K]);
    let inverse = F::c(1.0).div(row[K]);
    row[K] = inverse;
    for i in (0..K).rev() {
        let target = &mut above[starts[i]..starts[i] + i + 1];
        let l = row[i] * inverse;
        for j in 0..i + 1 {
            target[j] = l.fnma(row[j], target[j]);
        }
        row[i] = l;
    }
}

#[inline(always)]
fn eliminate_long<F: Num>(above: &mut [F], row: &mut [F], starts: &[usize]) {
    let inverse = F::c(1.0).div(row[starts.len()]);
    row[starts.len()] = inverse;
    for (i, &start) in starts.iter().enumerate().rev() {
        let target = &mut above[start..start + i + 1];
        let l = row[i] * inverse;
        for (t, r) in target.iter_mut().zip(&row[..i + 1]) {
            *t = l.fnma(*r, *t);
        }
        row[i] = l;
    }
}

#[inline(always)]
pub(super) fn solve<F: Num>(pattern: &Pattern, block: &Block, factor: &[F], x: &mut [F]) {
    for k in (0..block.size).rev() {
        let path = pattern.path(block, k);
        let n = path.rows.len();
        let row = &factor[path.start..path.start + n + 1];
        let xk = x[k];
        of_length!(
            n,
            back(row, path.rows, xk, x),
            back_long(row, path.rows, xk, x)
        );
        x[k] = xk * row[n];
    }
    for k in 0..block.size {
        let path = pattern.path(block, k);
        let n = path.rows.len();
        let row = &factor[path.start..path.start + n + 1];
        let xk = x[k];
        x[k] = of_length!(
            n,
            forward(row, path.rows, xk, x),
            forward_long(row, path.rows, xk, x)
        );
    }
}

#[inline(always)]
fn back<F: Num, const K: usize>(row: &[F], path: &[usize], xk: F, x: &mut [F]) {
    let (row, path) = (&row[..K], &path[..K]);
    for i in 0..K {
        x[path[i]] = xk.fnma(row[i], x[path[i]]);
    }
}

#[inline(always)]
fn back_long<F: Num>(row: &[F], path: &[usize], xk: F, x: &mut [F]) {
    for (l, &i) in row.iter().zip(path) {
        x[i] = xk.fnma(*l, x[i]);
    }
}

#[inline(always)]
fn forward<F: Num, const K: usize>(row: &[F], path: &[usize], mut xk: F, x: &[F]) -> F {
    let (row, path) = (&row[..K], &path[..K]);
    for i in 0..K {
        xk = row[i].fnma(x[path[i]], xk);
    }
    xk
}

#[inline(always)]
fn forward_long<F: Num>(row: &[F], path: &[usize], mut xk: F, x: &[F]) -> F {
    for (l, &i) in row.iter().zip(path) {
        xk = l.fnma(x[i], xk);
    }
    xk
}

#[inline(always)]
pub(super) fn multiply<F: Num>(pattern: &Pattern, block: &Block, a: &[F], x: &[F], y: &mut [F]) {
    for k in 0..block.size {
        let path = pattern.path(block, k);
        let row = &a[path.start..path.start + path.rows.len() + 1];
        let xk = x[k];
        let mut yk = row[path.rows.len()] * xk;
        for (e, &i) in row.iter().zip(path.rows) {
            yk = e.fma(x[i], yk);
            y[i] = e.fma(xk, y[i]);
        }
        y[k] = yk;
    }
}

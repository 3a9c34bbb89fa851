//! Blocks with zeros: loops over runs of columns.
//!
//! Rows are eliminated [`TILE`] at a time, and subtracted from as many rows above them at once. A scalar of the matrix is then
//! loaded and stored once for three rows, and a row's scalar is loaded once for three others: one row by one takes two loads and
//! a store for each product, which limits it. The order of the products of an entry is that of single rows.

use super::pattern::{Block, Pattern, Run, Tile};
use super::tree::{self, Removed};
use super::tri;
use crate::lane::Num;
use std::ops::Range;

/// Rows that are eliminated together, and rows that they are subtracted from at once.
pub(super) const TILE: usize = 3;

/// `f::<F, S>(…)` for the S that is the tile's size.
macro_rules! of_size {
    ($size:expr, $f:ident($($arg:expr),*)) => {
        match $size {
            1 => $f::<F, 1>($($arg),*),
            2 => $f::<F, 2>($($arg),*),
            _ => $f::<F, TILE>($($arg),*),
        }
    };
}

#[inline(always)]
pub(super) fn solve<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F], x: &mut [F]) {
    // A := its factor, x := D⁻¹ L⁻ᵀ x
    for tile in pattern.tiles(block) {
        let runs = pattern.columns_above(tile);
        of_size!(tile.size, eliminate(tile, runs, a, x));
    }
    // x := L⁻¹ x
    for tile in pattern.tiles(block).iter().rev() {
        let runs = pattern.columns_above(tile);
        of_size!(tile.size, forward(tile, runs, a, x));
    }
}

/// Removes the S rows of a tile from the rows above.
#[inline(always)]
fn eliminate<F: Num, const S: usize>(tile: &Tile, runs: &[Run], a: &mut [F], x: &mut [F]) {
    let p = tile.first;
    let (above, entries) = a[..tri(p + S, 0)].split_at_mut(tri(p, 0));
    let (x_above, x) = x[..p + S].split_at_mut(p);
    let (mut removed, l) = Removed::<F, S>::of_corner(entries, p, x);
    for run in runs {
        removed.complete(&l, run.start..run.end);
    }
    for (n, run) in runs.iter().enumerate().rev() {
        let mut end = run.end;
        while end - run.start >= TILE {
            end -= TILE;
            subtract::<F, S, TILE>(&mut removed, &runs[..n], run.start..end, above, x_above);
        }
        while end > run.start {
            end -= 1;
            subtract::<F, S, 1>(&mut removed, &runs[..n], run.start..end, above, x_above);
        }
    }
}

/// Subtracts S rows from the T rows above that follow column `run.end`. They have the columns of `runs`, of `run`, and their own.
#[inline(always)]
fn subtract<F: Num, const S: usize, const T: usize>(
    removed: &mut Removed<'_, F, S>,
    runs: &[Run],
    run: Range<usize>,
    above: &mut [F],
    x: &mut [F],
) {
    let first = run.end;
    let mut rest = &mut above[tri(first, 0)..tri(first + T, 0)];
    let mut targets = [(); T].map(|()| <&mut [F]>::default());
    let mut places = [first; T];
    for (t, target) in targets.iter_mut().enumerate() {
        (*target, rest) = rest.split_at_mut(first + t + 1);
        places[t] = first + t;
    }
    let columns = runs.iter().map(|run| run.start..run.end);
    removed.subtract_from(first, columns.chain([run]), targets, x, places);
}

/// x := L⁻¹ x in the S rows of a tile, whose sums do not wait for each other.
#[inline(always)]
fn forward<F: Num, const S: usize>(tile: &Tile, runs: &[Run], factor: &[F], x: &mut [F]) {
    let p = tile.first;
    let entries = &factor[tri(p, 0)..tri(p + S, 0)];
    let (above, x) = x[..p + S].split_at_mut(p);
    let (rows, corner) = tree::split_ref::<F, S>(entries, p);
    let mut y = [F::c(0.0); S];
    y.copy_from_slice(x);
    for run in runs {
        let above = &above[run.start..run.end];
        let mut columns: [&[F]; S] = [&[]; S];
        for k in 0..S {
            columns[k] = &rows[k][run.start..run.end][..above.len()];
        }
        for (j, &xi) in above.iter().enumerate() {
            for k in 0..S {
                y[k] = columns[k][j].fnma(xi, y[k]);
            }
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
    for k in 0..block.size {
        let row = &a[tri(k, 0)..tri(k, 0) + k + 1];
        let (before, rest) = y.split_at_mut(k);
        let xk = x[k];
        let mut yk = row[k] * xk;
        for run in pattern.runs(block, k) {
            for i in run.start..run.end {
                yk = row[i].fma(x[i], yk);
                before[i] = row[i].fma(xk, before[i]);
            }
        }
        rest[0] = yk;
    }
}

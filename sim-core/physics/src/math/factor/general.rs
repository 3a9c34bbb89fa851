//! Blocks with zeros, or too large to be unrolled: loops over the runs of each row. The reference of the other kernels.

use super::pattern::{Block, Pattern};
use super::tri;
use crate::lane::Num;

/// y -= s x
#[inline(always)]
fn subtract<F: Num>(y: &mut [F], s: F, x: &[F]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = s.fnma(*x, *y);
    }
}

#[inline(always)]
fn factor<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F]) {
    for k in (0..block.size).rev() {
        let (above, rest) = a.split_at_mut(tri(k, 0));
        let row = &mut rest[..k + 1];
        let inverse = super::inverse(row[k]);
        row[k] = inverse;
        let runs = pattern.runs(block, k);
        for (n, run) in runs.iter().enumerate().rev() {
            for i in (run.start..run.end).rev() {
                let l = row[i] * inverse;
                let target = &mut above[tri(i, 0)..tri(i, 0) + i + 1];
                for run in &runs[..n] {
                    subtract(&mut target[run.start..run.end], l, &row[run.start..run.end]);
                }
                subtract(&mut target[run.start..], l, &row[run.start..i + 1]);
                row[i] = l;
            }
        }
    }
}

#[inline(always)]
pub(super) fn solve<F: Num>(pattern: &Pattern, block: &Block, a: &mut [F], x: &mut [F]) {
    factor(pattern, block, a);
    let factor = &*a;
    for k in (0..block.size).rev() {
        let row = &factor[tri(k, 0)..tri(k, 0) + k + 1];
        let (before, rest) = x.split_at_mut(k);
        for run in pattern.runs(block, k) {
            let columns = run.start..run.end;
            subtract(&mut before[columns.clone()], rest[0], &row[columns]);
        }
        rest[0] = rest[0] * row[k];
    }
    for k in 0..block.size {
        let row = &factor[tri(k, 0)..tri(k, 0) + k + 1];
        let (before, rest) = x.split_at_mut(k);
        let mut xk = rest[0];
        for run in pattern.runs(block, k) {
            let columns = run.start..run.end;
            for (l, x) in row[columns.clone()].iter().zip(&before[columns]) {
                xk = l.fnma(*x, xk);
            }
        }
        rest[0] = xk;
    }
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

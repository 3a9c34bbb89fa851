//! Small full blocks, unrolled.
//!
//! A loop over a short row costs more than its numbers, so every row number has its own body: rows
//! and columns are constants of the functions, and only the first of them is chosen at run time.

use super::tri;
use crate::lane::Num;

/// Rows of the largest block that is unrolled.
pub(super) const LARGEST: usize = 12;

/// `f::<F, K>(…)` for every K below `n`, rising or falling; `n` may be known at run time.
macro_rules! rows {
    (rising, $n:expr, $f:ident($($arg:expr),*)) => {
        rows!(@ $n, $f($($arg),*), 0 1 2 3 4 5 6 7 8 9 10 11)
    };
    (falling, $n:expr, $f:ident($($arg:expr),*)) => {
        rows!(@ $n, $f($($arg),*), 11 10 9 8 7 6 5 4 3 2 1 0)
    };
    (@ $n:expr, $f:ident $args:tt, $($k:literal)*) => {
        $(rows!(@one $n, $f $args, $k);)*
    };
    (@one $n:expr, $f:ident($($arg:expr),*), $k:literal) => {
        if $k < $n {
            $f::<F, $k>($($arg),*);
        }
    };
}

#[inline(always)]
pub(super) fn factor<F: Num>(size: usize, a: &mut [F]) {
    rows!(falling, size, eliminate(a));
}

/// Removes row K from all rows above it.
#[inline(always)]
fn eliminate<F: Num, const K: usize>(a: &mut [F]) {
    let (above, rest) = a.split_at_mut(tri(K, 0));
    let row = &mut rest[..K + 1];
    let inverse = F::c(1.0).div(row[K]);
    row[K] = inverse;
    rows!(falling, K, subtract(above, row, inverse));
}

/// Row I less its share of `row`.
#[inline(always)]
fn subtract<F: Num, const I: usize>(above: &mut [F], row: &mut [F], inverse: F) {
    let target = &mut above[tri(I, 0)..tri(I, 0) + I + 1];
    let l = row[I] * inverse;
    for j in 0..I + 1 {
        target[j] = l.fnma(row[j], target[j]);
    }
    row[I] = l;
}

#[inline(always)]
pub(super) fn solve<F: Num>(size: usize, factor: &[F], x: &mut [F]) {
    rows!(falling, size, back(factor, x));
    rows!(rising, size, forward(factor, x));
}

#[inline(always)]
fn back<F: Num, const K: usize>(factor: &[F], x: &mut [F]) {
    let row = &factor[tri(K, 0)..tri(K, 0) + K + 1];
    let x = &mut x[..K + 1];
    let xk = x[K];
    for i in 0..K {
        x[i] = xk.fnma(row[i], x[i]);
    }
    x[K] = xk * row[K];
}

#[inline(always)]
fn forward<F: Num, const K: usize>(factor: &[F], x: &mut [F]) {
    let row = &factor[tri(K, 0)..tri(K, 0) + K + 1];
    let x = &mut x[..K + 1];
    let mut xk = x[K];
    for i in 0..K {
        xk = row[i].fnma(x[i], xk);
    }
    x[K] = xk;
}

#[inline(always)]
pub(super) fn multiply<F: Num>(size: usize, a: &[F], x: &[F], y: &mut [F]) {
    rows!(rising, size, add_row(a, x, y));
}

#[inline(always)]
fn add_row<F: Num, const K: usize>(a: &[F], x: &[F], y: &mut [F]) {
    let row = &a[tri(K, 0)..tri(K, 0) + K + 1];
    let (x, y) = (&x[..K + 1], &mut y[..K + 1]);
    let xk = x[K];
    let mut yk = row[K] * xk;
    for i in 0..K {
        yk = row[i].fma(x[i], yk);
        y[i] = row[i].fma(xk, y[i]);
    }
    y[K] = yk;
}

//! Small full blocks, unrolled.
//!
//! A full block is a single path ([`super::tree`]) whose rows are at known places. They are taken [`TILE`] at a time, so
//! rows and columns are constants of the functions, and only their count is known at run time.

use super::tree::{self, Removed};
use super::tri;
use crate::lane::Num;

/// Rows of the largest block that is unrolled.
pub(super) const LARGEST: usize = 12;
/// Rows that are eliminated together.
const TILE: usize = 3;

/// Places of the rows of a full block.
const ROWS: [usize; LARGEST] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

/// `f::<F, S>(P, …)` for the tile of S rows that begins at P.
macro_rules! tile {
    ($n:expr, $p:literal, $f:ident($($arg:expr),*)) => {
        match usize::saturating_sub($n, $p) {
            0 => {}
            1 => $f::<F, 1>($p, $($arg),*),
            2 => $f::<F, 2>($p, $($arg),*),
            _ => $f::<F, TILE>($p, $($arg),*),
        }
    };
}

/// A := its factor, x := D⁻¹ L⁻ᵀ x
#[inline(always)]
pub(super) fn factor<F: Num>(size: usize, a: &mut [F], x: &mut [F]) {
    tile!(size, 9, eliminate_9(a, x));
    tile!(size, 6, eliminate_6(a, x));
    tile!(size, 3, eliminate_3(a, x));
    tile!(size, 0, eliminate_0(a, x));
}

/// Functions that remove the S rows from P on from those above, a tile at a time.
macro_rules! eliminate {
    ($($name:ident $($i:literal)*;)*) => {
        $(
            #[inline(always)]
            fn $name<F: Num, const S: usize>(p: usize, a: &mut [F], x: &mut [F]) {
                let (above, entries) = a[..tri(p + S, 0)].split_at_mut(tri(p, 0));
                let (x_above, x) = x[..p + S].split_at_mut(p);
                let mut tile = Removed::<F, S>::new(entries, p, x);
                $(subtract_from_tile::<F, S>($i, above, &mut tile, x_above);)*
            }
        )*
    };
}

eliminate!(
    eliminate_9 6 3 0;
    eliminate_6 3 0;
    eliminate_3 0;
);

/// Subtracts S rows from those of the tile that begins at row `i`.
#[inline(always)]
fn subtract_from_tile<F: Num, const S: usize>(
    i: usize,
    above: &mut [F],
    removed: &mut Removed<'_, F, S>,
    x: &mut [F],
) {
    let rows = &mut above[tri(i, 0)..tri(i + TILE, 0)];
    let (first, rest) = rows.split_at_mut(i + 1);
    let (second, third) = rest.split_at_mut(i + 2);
    let places = [i, i + 1, i + 2];
    removed.subtract_from(i, std::iter::once(0..i), [first, second, third], x, places);
}

/// The S rows of the first tile, which has none above it.
#[inline(always)]
fn eliminate_0<F: Num, const S: usize>(p: usize, a: &mut [F], x: &mut [F]) {
    Removed::<F, S>::new(&mut a[..tri(S, 0)], p, &mut x[..S]);
}

/// x := L⁻¹ x
#[inline(always)]
pub(super) fn forward<F: Num>(size: usize, factor: &[F], x: &mut [F]) {
    tile!(size, 0, forward_tile(factor, x));
    tile!(size, 3, forward_tile(factor, x));
    tile!(size, 6, forward_tile(factor, x));
    tile!(size, 9, forward_tile(factor, x));
}

#[inline(always)]
fn forward_tile<F: Num, const S: usize>(p: usize, factor: &[F], x: &mut [F]) {
    let entries = &factor[tri(p, 0)..tri(p + S, 0)];
    let (x_above, x) = x[..p + S].split_at_mut(p);
    tree::forward::<F, S>(entries, &ROWS[..p], x_above, x);
}

#[inline(always)]
pub(super) fn multiply<F: Num>(size: usize, a: &[F], x: &[F], y: &mut [F]) {
    tile!(size, 0, multiply_tile(a, x, y));
    tile!(size, 3, multiply_tile(a, x, y));
    tile!(size, 6, multiply_tile(a, x, y));
    tile!(size, 9, multiply_tile(a, x, y));
}

#[inline(always)]
fn multiply_tile<F: Num, const S: usize>(p: usize, a: &[F], x: &[F], y: &mut [F]) {
    tree::add_rows::<F, S>(&a[tri(p, 0)..tri(p + S, 0)], &ROWS[..p], p, x, y);
}

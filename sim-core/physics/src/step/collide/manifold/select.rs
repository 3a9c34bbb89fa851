//! Branch-free choices among components and columns, by an index that differs per world.

use crate::lane::Num;
use crate::math::vec3::{Mat3, Vec3, select};

/// Smaller divisors count as this one, so that a reciprocal stays finite.
const TINY: f64 = 1e-30;

/// The point of a box with these half extents that is nearest to `x` (Ericson 2005, section 5.1.3).
#[inline(always)]
pub fn clamp_to_box<F: Num>(x: Vec3<F>, half: Vec3<F>) -> Vec3<F> {
    Vec3([
        x[0].min(half[0]).max(-half[0]),
        x[1].min(half[1]).max(-half[1]),
        x[2].min(half[2]).max(-half[2]),
    ])
}

/// mᵀ
#[inline(always)]
pub fn transpose<F: Num>(m: &Mat3<F>) -> Mat3<F> {
    Mat3([
        Vec3([m[0][0], m[1][0], m[2][0]]),
        Vec3([m[0][1], m[1][1], m[2][1]]),
        Vec3([m[0][2], m[1][2], m[2][2]]),
    ])
}

/// -1 where x < 0, else 1.
#[inline(always)]
pub fn sign<F: Num>(x: F) -> F {
    F::select(x.lt(F::c(0.0)), F::c(-1.0), F::c(1.0))
}

/// `size` with the sign of `x`.
#[inline(always)]
pub fn with_sign<F: Num>(size: F, x: F) -> F {
    F::select(x.lt(F::c(0.0)), -size, size)
}

/// A unit vector perpendicular to the unit vector `a`.
#[inline(always)]
pub fn perpendicular<F: Num>(a: Vec3<F>) -> Vec3<F> {
    // without its largest or middle component at least a third of its square is left
    let flat = F::c(0.6).lt(a[0].abs());
    let zero = F::c(0.0);
    let b = select(flat, Vec3([-a[1], a[0], zero]), Vec3([zero, -a[2], a[1]]));
    // unit length: a square of at least 0.36 is left, so the division needs no guard
    b * F::c(1.0).div(b.dot(b).sqrt())
}

/// Index of the component of largest size.
#[inline(always)]
pub fn largest_axis<F: Num>(x: Vec3<F>) -> F {
    let (x, y, z) = (x[0].abs(), x[1].abs(), x[2].abs());
    // of equal sizes the lower index stays
    let second = x.lt(y);
    let third = x.max(y).lt(z);
    F::select(third, F::c(2.0), F::select(second, F::c(1.0), F::c(0.0)))
}

/// Index and value of the smallest component.
#[inline(always)]
pub fn min_component<F: Num>(x: Vec3<F>) -> (F, F) {
    // of equal components the first stays
    let second = x[1].lt(x[0]);
    let least = F::select(second, x[1], x[0]);
    let third = x[2].lt(least);
    let which = F::select(second, F::c(1.0), F::c(0.0));
    (
        F::select(third, F::c(2.0), which),
        F::select(third, x[2], least),
    )
}

/// The column with this index.
#[inline(always)]
pub fn column_at<F: Num>(index: F, columns: Mat3<F>) -> Vec3<F> {
    // the index is whole: thresholds half-way between need no comparison for equality
    let (first, second) = (index.lt(F::c(0.5)), index.lt(F::c(1.5)));
    select(first, columns[0], select(second, columns[1], columns[2]))
}

/// The component with this index.
#[inline(always)]
pub fn component_at<F: Num>(index: F, components: Vec3<F>) -> F {
    // thresholds half-way between whole indices
    let (first, second) = (index.lt(F::c(0.5)), index.lt(F::c(1.5)));
    F::select(
        first,
        components[0],
        F::select(second, components[1], components[2]),
    )
}

/// `x`, or 0 where `k` is the index.
#[inline(always)]
pub fn zero_at<F: Num>(index: F, k: usize, x: F) -> F {
    // whole scalars are equal where they differ by less than a half
    let is = (index - F::c(k as f64)).abs().lt(F::c(0.5));
    F::select(is, F::c(0.0), x)
}

/// `x` where `k` is the index, else 0.
#[inline(always)]
pub fn only_at<F: Num>(index: F, k: usize, x: F) -> F {
    x - zero_at(index, k, x)
}

/// Columns in cyclic order, that of the index first.
#[inline(always)]
pub fn cycle_columns<F: Num>(index: F, columns: Mat3<F>) -> Mat3<F> {
    // column k of the result is column (index + k) mod 3
    Mat3([
        column_at(index, columns),
        column_at(index, Mat3([columns[1], columns[2], columns[0]])),
        column_at(index, Mat3([columns[2], columns[0], columns[1]])),
    ])
}

/// Components in cyclic order, that of the index first.
#[inline(always)]
pub fn cycle_components<F: Num>(index: F, components: Vec3<F>) -> Vec3<F> {
    // component k of the result is component (index + k) mod 3
    column_at(
        index,
        Mat3([
            components,
            Vec3([components[1], components[2], components[0]]),
            Vec3([components[2], components[0], components[1]]),
        ]),
    )
}

/// 1/x, finite.
#[inline(always)]
pub fn reciprocal<F: Num>(x: F) -> F {
    // a divisor near 0 is replaced, whatever its sign
    let tiny = x.abs().lt(F::c(TINY));
    F::c(1.0).div(F::select(tiny, F::c(TINY), x))
}

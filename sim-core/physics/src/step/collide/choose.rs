//! Choices among components and vectors by a number of each world.

use crate::lane::Num;
use crate::math::vec3::{Mat3, Vec3};

/// What is less counts as zero: small enough for rounding noise to keep its size.
const TINY: f64 = 1e-30;

/// The nearest point of a box with those half extents.
#[inline(always)]
pub fn clamped<F: Num>(x: Vec3<F>, half: Vec3<F>) -> Vec3<F> {
    Vec3([
        x[0].min(half[0]).max(-half[0]),
        x[1].min(half[1]).max(-half[1]),
        x[2].min(half[2]).max(-half[2]),
    ])
}

/// mᵀ
#[inline(always)]
pub fn transposed<F: Num>(m: &Mat3<F>) -> Mat3<F> {
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

/// `a` where the mask holds, else `b`.
#[inline(always)]
pub fn select<F: Num>(mask: F::Mask, a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    Vec3([
        F::select(mask, a[0], b[0]),
        F::select(mask, a[1], b[1]),
        F::select(mask, a[2], b[2]),
    ])
}

/// The axis along which a vector is longest, as a number.
#[inline(always)]
pub fn steepest<F: Num>(x: Vec3<F>) -> F {
    let (x, y, z) = (x[0].abs(), x[1].abs(), x[2].abs());
    let second = x.lt(y);
    let third = x.max(y).lt(z);
    F::select(third, F::c(2.0), F::select(second, F::c(1.0), F::c(0.0)))
}

/// The vector of that number.
#[inline(always)]
pub fn one_of<F: Num>(number: F, of: Mat3<F>) -> Vec3<F> {
    let (first, second) = (number.lt(F::c(0.5)), number.lt(F::c(1.5)));
    select(first, of[0], select(second, of[1], of[2]))
}

/// The number of that number.
#[inline(always)]
pub fn one_of_numbers<F: Num>(number: F, of: Vec3<F>) -> F {
    let (first, second) = (number.lt(F::c(0.5)), number.lt(F::c(1.5)));
    F::select(first, of[0], F::select(second, of[1], of[2]))
}

/// `x`, or 0 if `k` is that number.
#[inline(always)]
pub fn unless<F: Num>(number: F, k: usize, x: F) -> F {
    let is = (number - F::c(k as f64)).abs().lt(F::c(0.5));
    F::select(is, F::c(0.0), x)
}

/// Three vectors turned round until that of a number is first.
#[inline(always)]
pub fn turned<F: Num>(number: F, of: Mat3<F>) -> Mat3<F> {
    Mat3([
        one_of(number, of),
        one_of(number, Mat3([of[1], of[2], of[0]])),
        one_of(number, Mat3([of[2], of[0], of[1]])),
    ])
}

/// Three numbers turned round until that of a number is first.
#[inline(always)]
pub fn turned_numbers<F: Num>(number: F, of: Vec3<F>) -> Vec3<F> {
    one_of(
        number,
        Mat3([of, Vec3([of[1], of[2], of[0]]), Vec3([of[2], of[0], of[1]])]),
    )
}

/// The least of three numbers, and which it is.
#[inline(always)]
pub fn lowest_of<F: Num>(x: Vec3<F>) -> (F, F) {
    let second = x[1].lt(x[0]);
    let least = F::select(second, x[1], x[0]);
    let third = x[2].lt(least);
    let which = F::select(second, F::c(1.0), F::c(0.0));
    (
        F::select(third, F::c(2.0), which),
        F::select(third, x[2], least),
    )
}

/// 1/x, finite.
#[inline(always)]
pub fn reciprocal<F: Num>(x: F) -> F {
    let tiny = x.abs().lt(F::c(TINY));
    F::c(1.0).div(F::select(tiny, F::c(TINY), x))
}

//! Vectors and rotation matrices. A matrix is its three columns.

use crate::lane::Num;

/// Three numbers.
pub type Vec3<F> = [F; 3];
/// Three columns.
pub type Mat3<F> = [Vec3<F>; 3];

/// A constant vector.
#[inline(always)]
pub fn constant<F: Num>(a: Vec3<F::Real>) -> Vec3<F> {
    [F::k(a[0]), F::k(a[1]), F::k(a[2])]
}

/// (0, 0, 0)
#[inline(always)]
pub fn zero<F: Num>() -> Vec3<F> {
    [F::c(0.0); 3]
}

/// a + b
#[inline(always)]
pub fn add<F: Num>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b
#[inline(always)]
pub fn sub<F: Num>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a s
#[inline(always)]
pub fn scale<F: Num>(a: Vec3<F>, s: F) -> Vec3<F> {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a s + b
#[inline(always)]
pub fn scale_add<F: Num>(a: Vec3<F>, s: F, b: Vec3<F>) -> Vec3<F> {
    [a[0].fma(s, b[0]), a[1].fma(s, b[1]), a[2].fma(s, b[2])]
}

/// a · b
#[inline(always)]
pub fn dot<F: Num>(a: Vec3<F>, b: Vec3<F>) -> F {
    a[0].fma(b[0], a[1].fma(b[1], a[2] * b[2]))
}

/// a × b
#[inline(always)]
pub fn cross<F: Num>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    [
        a[2].fnma(b[1], a[1] * b[2]),
        a[0].fnma(b[2], a[2] * b[0]),
        a[1].fnma(b[0], a[0] * b[1]),
    ]
}

/// a × b + c
#[inline(always)]
pub fn cross_add<F: Num>(a: Vec3<F>, b: Vec3<F>, c: Vec3<F>) -> Vec3<F> {
    [
        a[1].fma(b[2], a[2].fnma(b[1], c[0])),
        a[2].fma(b[0], a[0].fnma(b[2], c[1])),
        a[0].fma(b[1], a[1].fnma(b[0], c[2])),
    ]
}

/// m a
#[inline(always)]
pub fn transform<F: Num>(m: &Mat3<F>, a: Vec3<F>) -> Vec3<F> {
    scale_add(m[0], a[0], scale_add(m[1], a[1], scale(m[2], a[2])))
}

/// mᵀ a
#[inline(always)]
pub fn transform_back<F: Num>(m: &Mat3<F>, a: Vec3<F>) -> Vec3<F> {
    [dot(m[0], a), dot(m[1], a), dot(m[2], a)]
}

/// m a + b
#[inline(always)]
pub fn transform_add<F: Num>(m: &Mat3<F>, a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    scale_add(m[0], a[0], scale_add(m[1], a[1], scale_add(m[2], a[2], b)))
}

//! Vectors and rotation matrices. A matrix is its three columns.
//!
//! Operators round once per operation. Named methods fuse a product into the sum that follows it. Equations choose between
//! the two, so the order of operations is the same on every backend.

use crate::lane::{Cx, Num, Table};
use bytemuck::TransparentWrapper;
use std::ops::{Add, Deref, DerefMut, Mul, Neg, Sub};

/// Three scalars: a point, a direction, a force.
#[derive(Clone, Copy, Debug, PartialEq, TransparentWrapper)]
#[repr(transparent)]
pub struct Vec3<F>(pub [F; 3]);

/// Three columns.
#[derive(Clone, Copy, Debug, PartialEq, TransparentWrapper)]
#[repr(transparent)]
pub struct Mat3<F>(pub [Vec3<F>; 3]);

impl<F: Num> Vec3<F> {
    /// (0, 0, 0)
    #[inline(always)]
    pub fn zero() -> Self {
        Vec3([F::c(0.0); 3])
    }

    /// A constant of the model.
    #[inline(always)]
    pub fn constant(a: [F::Real; 3]) -> Self {
        Vec3([F::k(a[0]), F::k(a[1]), F::k(a[2])])
    }

    /// a s + b
    #[inline(always)]
    pub fn scale_add(self, s: F, b: Self) -> Self {
        Vec3([
            self[0].fma(s, b[0]),
            self[1].fma(s, b[1]),
            self[2].fma(s, b[2]),
        ])
    }

    /// a · b
    #[inline(always)]
    pub fn dot(self, b: Self) -> F {
        self[0].fma(b[0], self[1].fma(b[1], self[2] * b[2]))
    }

    /// a × b
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        let a = self;
        Vec3([
            a[2].fnma(b[1], a[1] * b[2]),
            a[0].fnma(b[2], a[2] * b[0]),
            a[1].fnma(b[0], a[0] * b[1]),
        ])
    }

    /// a × b + c
    #[inline(always)]
    pub fn cross_add(self, b: Self, c: Self) -> Self {
        let a = self;
        Vec3([
            a[1].fma(b[2], a[2].fnma(b[1], c[0])),
            a[2].fma(b[0], a[0].fnma(b[2], c[1])),
            a[0].fma(b[1], a[1].fnma(b[0], c[2])),
        ])
    }
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

/// Three neighbouring scalars of a row, from scalar `k` on; see [`Cx::load3`].
#[inline(always)]
pub fn load_vec3<C: Cx>(cx: &mut C, t: Table, row: C::I, k: usize) -> Vec3<C::F> {
    Vec3(cx.load3(t, row, k))
}

impl<F: Num> Mat3<F> {
    /// All scalars 0.
    #[inline(always)]
    pub fn zero() -> Self {
        Mat3([Vec3::zero(); 3])
    }

    /// A constant of the model, by columns.
    #[inline(always)]
    pub fn constant([x, y, z]: [[F::Real; 3]; 3]) -> Self {
        Mat3([Vec3::constant(x), Vec3::constant(y), Vec3::constant(z)])
    }

    /// mᵀ a
    #[inline(always)]
    pub fn transpose_mul(&self, a: Vec3<F>) -> Vec3<F> {
        Vec3([self[0].dot(a), self[1].dot(a), self[2].dot(a)])
    }

    /// m a + b
    #[inline(always)]
    pub fn mul_add(&self, a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
        self[0].scale_add(a[0], self[1].scale_add(a[1], self[2].scale_add(a[2], b)))
    }
}

impl<F> Deref for Vec3<F> {
    type Target = [F; 3];
    #[inline(always)]
    fn deref(&self) -> &[F; 3] {
        &self.0
    }
}

impl<F> DerefMut for Vec3<F> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [F; 3] {
        &mut self.0
    }
}

impl<F> Deref for Mat3<F> {
    type Target = [Vec3<F>; 3];
    #[inline(always)]
    fn deref(&self) -> &[Vec3<F>; 3] {
        &self.0
    }
}

impl<F> DerefMut for Mat3<F> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [Vec3<F>; 3] {
        &mut self.0
    }
}

impl<F: Num> Add for Vec3<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Vec3([self[0] + b[0], self[1] + b[1], self[2] + b[2]])
    }
}

impl<F: Num> Sub for Vec3<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Vec3([self[0] - b[0], self[1] - b[1], self[2] - b[2]])
    }
}

impl<F: Num> Neg for Vec3<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vec3([-self[0], -self[1], -self[2]])
    }
}

/// a s
impl<F: Num> Mul<F> for Vec3<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: F) -> Self {
        Vec3([self[0] * s, self[1] * s, self[2] * s])
    }
}

/// m a
impl<F: Num> Mul<Vec3<F>> for &Mat3<F> {
    type Output = Vec3<F>;
    #[inline(always)]
    fn mul(self, a: Vec3<F>) -> Vec3<F> {
        self[0].scale_add(a[0], self[1].scale_add(a[1], self[2] * a[2]))
    }
}

/// m a
impl<F: Num> Mul<Vec3<F>> for Mat3<F> {
    type Output = Vec3<F>;
    #[inline(always)]
    fn mul(self, a: Vec3<F>) -> Vec3<F> {
        &self * a
    }
}

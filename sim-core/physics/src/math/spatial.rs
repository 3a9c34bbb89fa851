//! Spatial vectors and inertias about a fixed reference point, in world axes (Featherstone 2008, chapter 2).

use super::vec3::{Mat3, Vec3};
use crate::lane::Num;
use bytemuck::TransparentWrapper;
use std::ops::{Add, Deref, DerefMut, Mul};

/// A motion or force: linear part, then angular part.
#[derive(Clone, Copy, Debug, PartialEq, TransparentWrapper)]
#[repr(transparent)]
pub struct Spatial<F>(pub [Vec3<F>; 2]);

/// Index of the linear part.
pub const LINEAR: usize = 0;
/// Index of the angular part.
pub const ANGULAR: usize = 1;

/// Inertia about the reference point: mass, first moment m c, then xx yy zz xy xz yz of the second moment.
#[derive(Clone, Copy, Debug, PartialEq, TransparentWrapper)]
#[repr(transparent)]
pub struct Inertia<F>(pub [F; 10]);

impl<F: Num> Spatial<F> {
    /// No motion, no force.
    #[inline(always)]
    pub fn zero() -> Self {
        Spatial([Vec3::zero(); 2])
    }

    /// Its six scalars, linear then angular.
    #[inline(always)]
    pub fn scalars(self) -> [F; 6] {
        let Spatial([Vec3([x, y, z]), Vec3([u, v, w])]) = self;
        [x, y, z, u, v, w]
    }

    /// a s + b
    #[inline(always)]
    pub fn scale_add(self, s: F, b: Self) -> Self {
        Spatial([
            self[LINEAR].scale_add(s, b[LINEAR]),
            self[ANGULAR].scale_add(s, b[ANGULAR]),
        ])
    }

    /// Power of a force on a motion.
    #[inline(always)]
    pub fn dot(&self, force: Self) -> F {
        self[LINEAR].dot(force[LINEAR]) + self[ANGULAR].dot(force[ANGULAR])
    }

    /// Rate of change of a motion vector that moves along with this velocity: v × m.
    #[inline(always)]
    pub fn cross_motion(&self, m: Self) -> Self {
        let v = self;
        let linear = v[LINEAR].cross(m[ANGULAR]);
        Spatial([
            v[ANGULAR].cross_add(m[LINEAR], linear),
            v[ANGULAR].cross(m[ANGULAR]),
        ])
    }

    /// v ×* f + g: the rate of change of a force vector that moves along with this velocity, plus another.
    #[inline(always)]
    pub fn cross_force_add(&self, f: Self, g: Self) -> Self {
        let v = self;
        let linear = v[ANGULAR].cross_add(f[LINEAR], g[LINEAR]);
        let angular = v[LINEAR].cross_add(f[LINEAR], g[ANGULAR]);
        Spatial([linear, v[ANGULAR].cross_add(f[ANGULAR], angular)])
    }
}

impl<F: Num> Inertia<F> {
    /// No mass.
    #[inline(always)]
    pub fn zero() -> Self {
        Inertia([F::c(0.0); 10])
    }

    /// Inertia about the reference point of a body whose frame has this rotation and origin.
    ///
    /// `inertia` is xx yy zz xy xz yz about the centre of mass, in the body's axes [kg·m²];
    /// `center` the centre of mass in the body's frame [m].
    #[inline(always)]
    pub fn placed(
        m: F,
        center: [F::Real; 3],
        inertia: [F; 6],
        rotation: &Mat3<F>,
        origin: Vec3<F>,
    ) -> Self {
        let c = rotation.mul_add(Vec3::constant(center), origin);
        let h = c * m;
        let [xx, yy, zz, xy, xz, yz] = inertia;
        // columns of R I
        let turned = Mat3([
            rotation * Vec3([xx, xy, xz]),
            rotation * Vec3([xy, yy, yz]),
            rotation * Vec3([xz, yz, zz]),
        ]);
        let (hc, zero) = (h.dot(c), F::c(0.0));
        Inertia([
            m,
            h[0],
            h[1],
            h[2],
            second_moment(&turned, rotation, h, c, 0, 0, hc),
            second_moment(&turned, rotation, h, c, 1, 1, hc),
            second_moment(&turned, rotation, h, c, 2, 2, hc),
            second_moment(&turned, rotation, h, c, 0, 1, zero),
            second_moment(&turned, rotation, h, c, 0, 2, zero),
            second_moment(&turned, rotation, h, c, 1, 2, zero),
        ])
    }
}

/// `(R I Rᵀ + m (c·c 1 - c cᵀ))(a, b)` from the columns of R I; `start` is m c·c on the diagonal, else 0.
// a function, not a closure: closures do not inherit the target features of the lane
#[inline(always)]
fn second_moment<F: Num>(
    turned: &Mat3<F>,
    rotation: &Mat3<F>,
    h: Vec3<F>,
    c: Vec3<F>,
    a: usize,
    b: usize,
    start: F,
) -> F {
    let moved = h[a].fnma(c[b], start);
    turned[0][a].fma(
        rotation[0][b],
        turned[1][a].fma(rotation[1][b], turned[2][a].fma(rotation[2][b], moved)),
    )
}

/// A symmetric constant, xx yy zz xy xz yz, times a vector.
#[inline(always)]
pub fn symmetric<F: Num>([xx, yy, zz, xy, xz, yz]: [F; 6], a: Vec3<F>) -> Vec3<F> {
    Mat3([Vec3([xx, xy, xz]), Vec3([xy, yy, yz]), Vec3([xz, yz, zz])]) * a
}

impl<F> Deref for Spatial<F> {
    type Target = [Vec3<F>; 2];
    #[inline(always)]
    fn deref(&self) -> &[Vec3<F>; 2] {
        &self.0
    }
}

impl<F> DerefMut for Spatial<F> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [Vec3<F>; 2] {
        &mut self.0
    }
}

impl<F> Deref for Inertia<F> {
    type Target = [F; 10];
    #[inline(always)]
    fn deref(&self) -> &[F; 10] {
        &self.0
    }
}

impl<F> DerefMut for Inertia<F> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [F; 10] {
        &mut self.0
    }
}

impl<F: Num> Add for Spatial<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Spatial([self[LINEAR] + b[LINEAR], self[ANGULAR] + b[ANGULAR]])
    }
}

/// a s
impl<F: Num> Mul<F> for Spatial<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: F) -> Self {
        Spatial([self[LINEAR] * s, self[ANGULAR] * s])
    }
}

impl<F: Num> Add for Inertia<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        let mut sum = self;
        for e in 0..10 {
            sum[e] = sum[e] + b[e];
        }
        sum
    }
}

/// Momentum of an inertia that moves with velocity `v`: I v.
impl<F: Num> Mul<Spatial<F>> for Inertia<F> {
    type Output = Spatial<F>;
    #[inline(always)]
    fn mul(self, v: Spatial<F>) -> Spatial<F> {
        let i = self;
        let h = Vec3([i[1], i[2], i[3]]);
        let w = v[ANGULAR];
        let second = Vec3([
            i[4].fma(w[0], i[7].fma(w[1], i[8] * w[2])),
            i[7].fma(w[0], i[5].fma(w[1], i[9] * w[2])),
            i[8].fma(w[0], i[9].fma(w[1], i[6] * w[2])),
        ]);
        Spatial([
            w.cross_add(h, v[LINEAR] * i[0]),
            h.cross_add(v[LINEAR], second),
        ])
    }
}

//! Spatial vectors and inertias about a point, in world axes (Featherstone 2008, chapter 2).

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

/// Inertia about a point: mass, first moment m c, then xx yy zz xy xz yz of the second moment.
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

    /// Rate of a motion that is fixed to a body which has this velocity: `(ω × u + v × e, ω × e)`.
    #[inline(always)]
    pub fn carry(self, motion: Self) -> Self {
        let (v, w) = (self[LINEAR], self[ANGULAR]);
        let turned = w.cross(motion[LINEAR]);
        Spatial([
            v.cross_add(motion[ANGULAR], turned),
            w.cross(motion[ANGULAR]),
        ])
    }

    /// Power of a force on a motion.
    #[inline(always)]
    pub fn dot(&self, force: Self) -> F {
        self[LINEAR].dot(force[LINEAR]) + self[ANGULAR].dot(force[ANGULAR])
    }

    /// The same force about another point, from which this one's is at `arm`.
    #[inline(always)]
    pub fn moved(self, arm: Vec3<F>) -> Self {
        let [force, torque] = self.0;
        Spatial([force, arm.cross_add(force, torque)])
    }
}

impl<F: Num> Inertia<F> {
    /// No mass.
    #[inline(always)]
    pub fn zero() -> Self {
        Inertia([F::c(0.0); 10])
    }

    /// Inertia of a body about a point, from which its frame has this rotation and origin.
    ///
    /// `inertia` is xx yy zz xy xz yz about the centre of mass, in the body's axes [kg·m²];
    /// `center` the centre of mass in the body's frame [m].
    #[inline(always)]
    pub fn placed(
        m: F,
        center: Vec3<F>,
        inertia: [F; 6],
        rotation: &Mat3<F>,
        origin: Vec3<F>,
    ) -> Self {
        let c = rotation.mul_add(center, origin);
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

    /// First moment.
    #[inline(always)]
    pub fn first_moment(&self) -> Vec3<F> {
        Vec3([self[1], self[2], self[3]])
    }

    /// The second moment times a vector.
    #[inline(always)]
    pub fn second_moment(&self, v: Vec3<F>) -> Vec3<F> {
        let [_, _, _, _, xx, yy, zz, xy, xz, yz] = **self;
        Vec3([
            xx.fma(v[0], xy.fma(v[1], xz * v[2])),
            xy.fma(v[0], yy.fma(v[1], yz * v[2])),
            xz.fma(v[0], yz.fma(v[1], zz * v[2])),
        ])
    }

    /// The same inertia about another point, from which this one's is at `arm`:
    /// `h' = h + m r`, `I' = I + tr(h rᵀ + r h'ᵀ) 1 - (h rᵀ + r h'ᵀ)`.
    #[inline(always)]
    pub fn moved(&self, arm: Vec3<F>) -> Self {
        let [m, _, _, _, xx, yy, zz, xy, xz, yz] = **self;
        let (r, h) = (arm, self.first_moment());
        let moved = r.scale_add(m, h);
        let twice = h + moved;
        let [x, y, z] = [twice[0] * r[0], twice[1] * r[1], twice[2] * r[2]];
        Inertia([
            m,
            moved[0],
            moved[1],
            moved[2],
            xx + (y + z),
            yy + (x + z),
            zz + (x + y),
            h[0].fnma(r[1], r[0].fnma(moved[1], xy)),
            h[0].fnma(r[2], r[0].fnma(moved[2], xz)),
            h[1].fnma(r[2], r[1].fnma(moved[2], yz)),
        ])
    }

    /// Force that an acceleration of the point and an angular one need at an angular velocity (Newton and Euler).
    #[inline(always)]
    pub fn force(&self, omega: Vec3<F>, acceleration: Spatial<F>) -> Spatial<F> {
        let Spatial([linear, angular]) = acceleration;
        let h = self.first_moment();
        let carried = angular.cross_add(h, linear * self[0]);
        let turned = h.cross_add(linear, self.second_moment(angular));
        Spatial([
            omega.cross_add(omega.cross(h), carried),
            omega.cross_add(self.second_moment(omega), turned),
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
        let (h, w) = (self.first_moment(), v[ANGULAR]);
        Spatial([
            w.cross_add(h, v[LINEAR] * self[0]),
            h.cross_add(v[LINEAR], self.second_moment(w)),
        ])
    }
}

//! Support functions of convex shapes: the farthest point along a direction, which is all that GJK asks of a shape.

use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::manifold::select::with_sign;

/// Rounding error of a few operations, relative to the largest scalar in them.
#[inline(always)]
pub(in crate::step::collide) fn rounding_error<F: Num>() -> F {
    F::c(16.0 * F::Real::EPSILON)
}

/// A convex shape, by its support function.
pub(in crate::step::collide) trait Support<C: Cx> {
    /// The point of the shape that is farthest along `d`, a vector of any length but 0.
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F>;
}

/// A point, the core of a sphere.
pub(in crate::step::collide) struct PointCore<F>(pub Vec3<F>);

/// A segment from `center - half` to `center + half`, the core of a capsule.
pub(in crate::step::collide) struct SegmentCore<F> {
    pub center: Vec3<F>,
    pub half: Vec3<F>,
}

/// A box.
pub(in crate::step::collide) struct BoxCore<F> {
    pub center: Vec3<F>,
    /// From the centre to the middle of three faces.
    pub half: Mat3<F>,
}

/// A cylinder along the z axis of its frame.
pub(in crate::step::collide) struct CylinderCore<F> {
    pub axes: Mat3<F>,
    pub center: Vec3<F>,
    pub radius: F,
    pub half_height: F,
}

/// A cylinder at the origin along z.
pub(in crate::step::collide) struct LocalCylinder<F> {
    pub radius: F,
    pub half_height: F,
}

impl<C: Cx> Support<C> for PointCore<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, _: Vec3<C::F>) -> Vec3<C::F> {
        self.0
    }
}

impl<C: Cx> Support<C> for SegmentCore<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // the end on the side of d
        let side = with_sign(C::F::c(1.0), self.half.dot(d));
        self.half.scale_add(side, self.center)
    }
}

impl<C: Cx> Support<C> for BoxCore<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // d in the box's axes: its signs name the corner
        let (one, x) = (C::F::c(1.0), self.half.transpose_mul(d));
        let side = [
            with_sign(one, x[0]),
            with_sign(one, x[1]),
            with_sign(one, x[2]),
        ];
        self.half.mul_add(Vec3(side), self.center)
    }
}

impl<C: Cx> Support<C> for LocalCylinder<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // along the axis any point of the cap is farthest
        // length of d across z
        let width = d[0].fma(d[0], d[1] * d[1]).sqrt().max(C::F::c(1e-18));
        // on the rim along d's part across z, at the cap on d's side
        let rim = self.radius.div(width);
        Vec3([d[0] * rim, d[1] * rim, with_sign(self.half_height, d[2])])
    }
}

impl<C: Cx> Support<C> for CylinderCore<C::F> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // as a cylinder along z, in its own axes
        let local = LocalCylinder {
            radius: self.radius,
            half_height: self.half_height,
        };
        let point = local.farthest(cx, self.axes.transpose_mul(d));
        self.axes.mul_add(point, self.center)
    }
}

/// The point of A that is farthest along `d`, and the point of the Minkowski difference B - A that is least along it.
#[inline(always)]
pub(in crate::step::collide) fn minkowski_support<C: Cx>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    d: Vec3<C::F>,
) -> (Vec3<C::F>, Vec3<C::F>) {
    // min d · (B - A) = min d · B - max d · A
    let on_a = a.farthest(cx, d);
    let on_b = b.farthest(cx, -d);
    (on_a, on_b - on_a)
}

//! An ellipsoid about the origin along the axes of its frame: how far it reaches, its farthest point, and its nearest.

use super::hull_axes::{Reach, SeparatingAxis};
use super::posed::PosedShape;
use super::support::Support;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::clipped::Separation;
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::narrow::{ShapePair, ShapePose};

/// Bisections of [`nearest_point`], each of which takes the root of the ratio of both bounds, and Newton iterations after
/// them. Plates of ratio 100 then have their nearest points to 1e-12 and 1e-4 of their thickness.
const fn iterations<R: Real>() -> [usize; 2] {
    if R::DOUBLE { [6, 6] } else { [5, 4] }
}

/// Coordinates of a point, relative to the radii, count as at least this [–]: a point in a plane of symmetry then has one
/// nearest point of two.
const fn least_coordinate<R: Real>() -> f64 {
    if R::DOUBLE { 1e-14 } else { 1e-6 }
}

/// Square of the largest difference between an axis that GJK began with and one that it found by rounding alone [–].
const fn turned_at_most<R: Real>() -> f64 {
    if R::DOUBLE { 1e-14 } else { 1e-6 }
}

/// Component by component.
#[inline(always)]
fn times<F: Num>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    Vec3([a[0] * b[0], a[1] * b[1], a[2] * b[2]])
}

/// The smallest of the radii [m].
#[inline(always)]
pub(in crate::step::collide) fn smallest<F: Num>(radii: Vec3<F>) -> F {
    radii[0].min(radii[1]).min(radii[2])
}

/// The largest of the radii [m].
#[inline(always)]
pub(in crate::step::collide) fn largest<F: Num>(radii: Vec3<F>) -> F {
    radii[0].max(radii[1]).max(radii[2])
}

/// Radii along the axes [m].
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct EllipsoidReach<F>(pub Vec3<F>);

impl<F: Num> Reach<F> for EllipsoidReach<F> {
    const FACES: &'static [usize] = &[];
    const EDGES: &'static [usize] = &[];
    #[inline(always)]
    fn reach(&self, d: Vec3<F>) -> F {
        // max d · x over |x / a| = 1
        let scaled = times(self.0, d);
        scaled.dot(scaled).sqrt()
    }
}

/// Its support function in its own frame.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct LocalEllipsoid<F>(pub Vec3<F>);

impl<F: Num> LocalEllipsoid<F> {
    /// The point that is farthest along `d`, a vector of any length but 0.
    #[inline(always)]
    pub fn farthest_along(&self, d: Vec3<F>) -> Vec3<F> {
        // x = a² d / |a d|
        // a d, whose length is the reach
        let scaled = times(self.0, d);
        let length = scaled.dot(scaled).sqrt().max(F::c(1e-18));
        times(self.0, scaled) * F::c(1.0).div(length)
    }
}

impl<C: Cx> Support<C> for LocalEllipsoid<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        self.farthest_along(d)
    }
}

/// An ellipsoid in the frame of another shape.
pub(in crate::step::collide) struct PosedEllipsoid<F> {
    pub pose: ShapePose<F>,
    /// Radii along its axes [m].
    pub radii: Vec3<F>,
}

/// Its support function in the frame of another shape.
pub(in crate::step::collide) struct EllipsoidCore<F> {
    axes: Mat3<F>,
    center: Vec3<F>,
    local: LocalEllipsoid<F>,
}

impl<C: Cx> Support<C> for EllipsoidCore<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // in its own axes, and back
        let point = self.local.farthest_along(self.axes.transpose_mul(d));
        self.axes.mul_add(point, self.center)
    }
}

impl<F: Num> EllipsoidCore<F> {
    /// A separation from another shape, of which the ellipsoid is the first; see [`on_axis`].
    #[inline(always)]
    pub fn on_axis(&self, closest: Separation<F>, start: SeparatingAxis<F>) -> Separation<F> {
        let n = closest.normal;
        // the ellipsoid is the first shape: it faces along the normal
        let farthest = self.local.farthest_along(self.axes.transpose_mul(n));
        let surface = self.axes.mul_add(farthest, self.center);
        on_axis(
            closest,
            start,
            n.scale_add(closest.distance * F::c(0.5), surface),
        )
    }
}

/// The point between an ellipsoid and a shape, where their normal is the axis that GJK began with, such as that of a face.
///
/// GJK then found no better axis, and its own points are some of those that are as near. `point` is the one on the surface of
/// the ellipsoid, moved by half of the distance: for a given normal there is only one.
#[inline(always)]
pub(in crate::step::collide) fn on_axis<F: Num>(
    closest: Separation<F>,
    start: SeparatingAxis<F>,
    point: Vec3<F>,
) -> Separation<F> {
    let turn = closest.normal - start.normal;
    let is_start = turn.dot(turn).lt(F::c(turned_at_most::<F::Real>()));
    Separation {
        point: select(is_start, point, closest.point),
        ..closest
    }
}

impl<F: Num> PosedEllipsoid<F> {
    /// The first shape of a pair.
    #[inline(always)]
    pub fn from_pair<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> Self {
        PosedEllipsoid {
            pose: pair.pose_a_in_b(),
            radii: pair.a.half_extents(),
        }
    }
}

impl<C: Cx> PosedShape<C> for PosedEllipsoid<C::F> {
    type Reach = EllipsoidReach<C::F>;
    type Core = EllipsoidCore<C::F>;

    #[inline(always)]
    fn pose(&self) -> &ShapePose<C::F> {
        &self.pose
    }
    #[inline(always)]
    fn reach(&self) -> EllipsoidReach<C::F> {
        EllipsoidReach(self.radii)
    }
    #[inline(always)]
    fn core(&self) -> EllipsoidCore<C::F> {
        EllipsoidCore {
            axes: self.pose.axes,
            center: self.pose.center,
            local: LocalEllipsoid(self.radii),
        }
    }
    #[inline(always)]
    fn radius(&self) -> Option<C::F> {
        None
    }
    #[inline(always)]
    fn size(&self) -> C::F {
        largest(self.radii)
    }
}

/// The point of an ellipsoid's surface that is nearest to `y`, and the outward unit normal there.
///
/// The nearest point is x = a² y / (a² + t), for the one t above -min a² with |x / a| = 1 (Eberly 2013, "Distance from a
/// point to an ellipse, an ellipsoid, or a hyperellipsoid"). Near the centre of a rim's curvature Newton's iteration alone
/// is slow. Bounds of the root come first, then Newton's iteration on 1 / |x / a|, which from the lower bound never passes
/// the root (Moré and Sorensen 1983).
#[inline(always)]
pub(in crate::step::collide) fn nearest_point<F: Num>(
    radii: Vec3<F>,
    y: Vec3<F>,
) -> (Vec3<F>, Vec3<F>) {
    let (one, zero) = (F::c(1.0), F::c(0.0));
    let least = smallest(radii);
    let inverse = one.div(least * least);
    // with b = min a: z = |y| a / b², r = (a² - b²) / b², and u = (t + b²) / b²: x / a = z / (r + u)
    let (mut z, mut r) = (Vec3::zero(), Vec3::zero());
    // left of the root each part alone is at least 1, and right of it r counts for nothing
    let mut low = zero;
    for k in 0..3 {
        // symmetric: one octant is enough
        let ratio = radii[k] * inverse;
        z[k] = y[k]
            .abs()
            .max(radii[k] * F::c(least_coordinate::<F::Real>()))
            * ratio;
        r[k] = (radii[k] - least) * (radii[k] + least) * inverse;
        low = low.max(z[k] - r[k]);
    }
    let mut high = z.dot(z).sqrt();
    // the geometric mean: bounds may be orders apart
    let [bisections, iterations] = iterations::<F::Real>();
    for _ in 0..bisections {
        let middle = (low * high).sqrt();
        let [square, _] = scaled(z, r, middle);
        let is_left = one.lt(square);
        low = F::select(is_left, middle, low);
        high = F::select(is_left, high, middle);
    }
    let mut u = low;
    // u += s² (s - 1) / (-s'), never to the left
    for _ in 0..iterations {
        let [square, slope] = scaled(z, r, u);
        u = u + (square * (square.sqrt() - one)).div(slope).max(zero);
    }
    let mut point = Vec3::zero();
    let mut normal = Vec3::zero();
    for k in 0..3 {
        // on the unit ball, then on the ellipsoid; normals are x / a²
        let on_ball = with_sign(z[k].div(r[k] + u), y[k]);
        point[k] = radii[k] * on_ball;
        normal[k] = on_ball.div(radii[k]);
    }
    // to unit length
    (point, normal * one.div(normal.dot(normal).sqrt()))
}

/// |x / a|² at u, and half of its slope against u, downwards.
#[inline(always)]
fn scaled<F: Num>(z: Vec3<F>, r: Vec3<F>, u: F) -> [F; 2] {
    let (mut square, mut slope) = (F::c(0.0), F::c(0.0));
    for k in 0..3 {
        let below = F::c(1.0).div(r[k] + u);
        // x / a of this axis
        let part = z[k] * below;
        square = part.fma(part, square);
        slope = (part * part).fma(below, slope);
    }
    [square, slope]
}

//! Zones of touch and contact sensors: the solids of sites (MuJoCo: `mju_rayGeom`, `mju_insideGeom`).
//!
//! A ray p + t d, t ≥ 0, meets a solid where the intervals of t in its parts have a common point.

use crate::constants::sensors::{Zone, ZoneKind};
use crate::lane::Num;
use crate::math::vec3::Vec3;

/// Larger than any parameter of a ray that matters [–].
const FAR: f64 = 1e15;
/// Part of a direction below which a ray is parallel [–].
const PARALLEL: f64 = 1e-15;

/// An interval of t; it is empty where it ends before it begins.
#[derive(Clone, Copy)]
struct Span<F> {
    first: F,
    last: F,
}

impl<F: Num> Span<F> {
    /// The part that two intervals share.
    #[inline(always)]
    fn and(self, other: Span<F>) -> Span<F> {
        Span {
            first: self.first.max(other.first),
            last: self.last.min(other.last),
        }
    }

    /// Has it a point at t ≥ 0?
    #[inline(always)]
    fn is_ahead(self) -> F::Mask {
        !self.last.lt(self.first.max(F::c(0.0)))
    }
}

/// Does a ray meet the zone? Both in its axes, the direction of length 1.
#[inline(always)]
pub(super) fn meets<F: Num>(zone: &Zone<F::Real>, point: Vec3<F>, along: Vec3<F>) -> F::Mask {
    let [a, b, c] = zone.size.map(F::k);
    match zone.kind {
        ZoneKind::Sphere => ball(point, along, a).is_ahead(),
        ZoneKind::Ellipsoid => {
            let scale = |v: Vec3<F>| Vec3([v[0].div(a), v[1].div(b), v[2].div(c)]);
            ball(scale(point), scale(along), F::c(1.0)).is_ahead()
        }
        ZoneKind::Box => {
            let [x, y, z] = [(0, a), (1, b), (2, c)].map(|(i, h)| slab(point[i], along[i], h));
            x.and(y).and(z).is_ahead()
        }
        ZoneKind::Cylinder => tube(point, along, a, b).is_ahead(),
        ZoneKind::Capsule => {
            let end = |sign: f64| Vec3([point[0], point[1], point[2] - b * F::c(sign)]);
            tube(point, along, a, b).is_ahead()
                | ball(end(1.0), along, a).is_ahead()
                | ball(end(-1.0), along, a).is_ahead()
        }
    }
}

/// Is a point, in the axes of the zone, in it?
#[inline(always)]
pub(super) fn holds<F: Num>(zone: &Zone<F::Real>, point: Vec3<F>) -> F::Mask {
    let [a, b, c] = zone.size.map(F::k);
    let Vec3([x, y, z]) = point;
    let across = x.fma(x, y * y);
    match zone.kind {
        ZoneKind::Sphere => point.dot(point).lt(a * a),
        ZoneKind::Ellipsoid => {
            let scaled = Vec3([x.div(a), y.div(b), z.div(c)]);
            scaled.dot(scaled).lt(F::c(1.0))
        }
        ZoneKind::Box => x.abs().lt(a) & y.abs().lt(b) & z.abs().lt(c),
        ZoneKind::Cylinder => across.lt(a * a) & z.abs().lt(b),
        ZoneKind::Capsule => {
            let beyond = (z.abs() - b).max(F::c(0.0));
            beyond.fma(beyond, across).lt(a * a)
        }
    }
}

/// |x + t d| ≤ half
#[inline(always)]
fn slab<F: Num>(x: F, d: F, half: F) -> Span<F> {
    let parallel = d.abs().lt(F::c(PARALLEL));
    let inverse = F::c(1.0).div(F::select(parallel, F::c(1.0), d));
    let (s, t) = ((half - x) * inverse, (-half - x) * inverse);
    let inside = x.abs().lt(half);
    let (far, none) = (F::c(FAR), F::c(-FAR));
    Span {
        first: F::select(parallel, F::select(inside, none, far), s.min(t)),
        last: F::select(parallel, F::select(inside, far, none), s.max(t)),
    }
}

/// |p + t d| ≤ radius
#[inline(always)]
fn ball<F: Num>(p: Vec3<F>, d: Vec3<F>, radius: F) -> Span<F> {
    quadratic(d.dot(d), p.dot(d), radius.fnma(radius, p.dot(p)))
}

/// A cylinder along z.
#[inline(always)]
fn tube<F: Num>(p: Vec3<F>, d: Vec3<F>, radius: F, half: F) -> Span<F> {
    let flat = |u: Vec3<F>, v: Vec3<F>| u[0].fma(v[0], u[1] * v[1]);
    let side = quadratic(flat(d, d), flat(p, d), radius.fnma(radius, flat(p, p)));
    side.and(slab(p[2], d[2], half))
}

/// a t² + 2 b t + c ≤ 0
#[inline(always)]
fn quadratic<F: Num>(a: F, b: F, c: F) -> Span<F> {
    let zero = F::c(0.0);
    let constant = a.lt(F::c(PARALLEL * PARALLEL));
    let square = b.fma(b, -(a * c));
    let root = square.max(zero).sqrt();
    let inverse = F::c(1.0).div(F::select(constant, F::c(1.0), a));
    let (far, none) = (F::c(FAR), F::c(-FAR));
    let inside = c.lt(zero);
    let misses = square.lt(zero);
    let first = F::select(misses, far, (-b - root) * inverse);
    let last = F::select(misses, none, (root - b) * inverse);
    Span {
        first: F::select(constant, F::select(inside, none, far), first),
        last: F::select(constant, F::select(inside, far, none), last),
    }
}

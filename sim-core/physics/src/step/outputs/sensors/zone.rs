//! Rays and solids: zones of sensors at sites, and geoms that rangefinders see (MuJoCo: `mju_rayGeom`, `mju_insideGeom`).
//!
//! A ray p + t d, t ≥ 0, is in a solid for an interval of t: the part that those of its slabs and quadrics share.

use crate::constants::sensors::{Zone, ZoneKind};
use crate::lane::{Num, map};
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

    /// The least interval that has both, one of which may be empty.
    #[inline(always)]
    fn or(self, other: Span<F>) -> Span<F> {
        // an empty interval becomes [FAR, -FAR], which does not widen the other
        let (far, none) = (F::c(FAR), F::c(-FAR));
        let [one, two] = map([self, other], |span| {
            let is_empty = span.last.lt(span.first);
            Span {
                first: F::select(is_empty, far, span.first),
                last: F::select(is_empty, none, span.last),
            }
        });
        Span {
            first: one.first.min(two.first),
            last: one.last.max(two.last),
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
pub(in crate::step::outputs::sensors) fn meets<F: Num>(
    zone: &Zone<F::Real>,
    point: Vec3<F>,
    along: Vec3<F>,
) -> F::Mask {
    inside(zone.kind, zone.size, point, along).is_ahead()
}

/// Distance along a ray to a solid, both in its axes, the direction of length 1: to where the ray enters it or, from inside,
/// leaves it; -1 where it does not meet it.
#[inline(always)]
pub(in crate::step::outputs::sensors) fn distance<F: Num>(
    kind: ZoneKind,
    size: [F::Real; 3],
    point: Vec3<F>,
    along: Vec3<F>,
) -> F {
    // a ray that begins inside has first < 0 and meets the surface where it leaves
    let Span { first, last } = inside(kind, size, point, along);
    let ahead = Span { first, last }.is_ahead();
    let nearest = F::select(first.lt(F::c(0.0)), last, first);
    F::select(ahead, nearest, F::c(-1.0))
}

/// The normal of length 1 of a solid, outwards, at a point on its surface.
#[inline(always)]
pub(in crate::step::outputs::sensors) fn normal<F: Num>(
    kind: ZoneKind,
    size: [F::Real; 3],
    point: Vec3<F>,
) -> Vec3<F> {
    let [a, b, c] = size.map(F::k);
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let Vec3([x, y, z]) = point;
    let sign = |x: F| F::select(x.lt(zero), -one, one);
    let outwards = match kind {
        ZoneKind::Sphere => point,
        // the gradient of (x/a)² + (y/b)² + (z/c)²
        ZoneKind::Ellipsoid => Vec3([x.div(a * a), y.div(b * b), z.div(c * c)]),
        // from the segment between both ends
        ZoneKind::Capsule => Vec3([x, y, z - z.min(b).max(-b)]),
        ZoneKind::Cylinder => {
            // on an end if that is nearer than the side
            let side = (a - x.fma(x, y * y).sqrt()).abs();
            let is_end = (b - z.abs()).abs().lt(side);
            Vec3([
                F::select(is_end, zero, x),
                F::select(is_end, zero, y),
                F::select(is_end, sign(z), zero),
            ])
        }
        ZoneKind::Box => {
            // the side that is nearest
            let (dx, dy, dz) = (
                (a - x.abs()).abs(),
                (b - y.abs()).abs(),
                (c - z.abs()).abs(),
            );
            let is_x = !dy.lt(dx) & !dz.lt(dx);
            let is_y = !is_x & !dz.lt(dy);
            Vec3([
                F::select(is_x, sign(x), zero),
                F::select(is_y, sign(y), zero),
                F::select(is_x | is_y, zero, sign(z)),
            ])
        }
    };
    // a point that is on no surface has no normal
    let length = outwards.dot(outwards).sqrt();
    outwards * one.div(F::select(zero.lt(length), length, one))
}

/// The interval in which a ray is in a solid.
#[inline(always)]
fn inside<F: Num>(kind: ZoneKind, size: [F::Real; 3], point: Vec3<F>, along: Vec3<F>) -> Span<F> {
    let [a, b, c] = size.map(F::k);
    match kind {
        ZoneKind::Sphere => ball(point, along, a),
        ZoneKind::Ellipsoid => {
            // in coordinates where the ellipsoid is the unit ball; t stays the same
            let scale = |v: Vec3<F>| Vec3([v[0].div(a), v[1].div(b), v[2].div(c)]);
            ball(scale(point), scale(along), F::c(1.0))
        }
        ZoneKind::Box => {
            // a box is what its three slabs share
            let x = slab(point[0], along[0], a);
            let y = slab(point[1], along[1], b);
            let z = slab(point[2], along[2], c);
            x.and(y).and(z)
        }
        ZoneKind::Cylinder => tube(point, along, a, b),
        ZoneKind::Capsule => {
            // a capsule is convex, so its interval is the least one around those of the tube and both balls
            let end = |sign: f64| Vec3([point[0], point[1], b.fnma(F::c(sign), point[2])]);
            let ends = [ball(end(1.0), along, a), ball(end(-1.0), along, a)];
            tube(point, along, a, b).or(ends[0]).or(ends[1])
        }
    }
}

/// Is a point, in the axes of the zone, in it?
#[inline(always)]
pub(in crate::step::outputs::sensors) fn holds<F: Num>(
    zone: &Zone<F::Real>,
    point: Vec3<F>,
) -> F::Mask {
    let [a, b, c] = zone.size.map(F::k);
    let Vec3([x, y, z]) = point;
    let across = x.fma(x, y * y);
    match zone.kind {
        ZoneKind::Sphere => point.dot(point).lt(a * a),
        ZoneKind::Ellipsoid => {
            // (x/a)² + (y/b)² + (z/c)² < 1
            let scaled = Vec3([x.div(a), y.div(b), z.div(c)]);
            scaled.dot(scaled).lt(F::c(1.0))
        }
        ZoneKind::Box => x.abs().lt(a) & y.abs().lt(b) & z.abs().lt(c),
        ZoneKind::Cylinder => across.lt(a * a) & z.abs().lt(b),
        ZoneKind::Capsule => {
            // distance from the segment between both ends: past an end, z counts too
            let beyond = (z.abs() - b).max(F::c(0.0));
            beyond.fma(beyond, across).lt(a * a)
        }
    }
}

/// |x + t d| ≤ half
#[inline(always)]
fn slab<F: Num>(x: F, d: F, half: F) -> Span<F> {
    // t at both planes; a parallel ray is inside for all t or for none
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
    // a circle as seen along z, and a slab along it
    let flat = |u: Vec3<F>, v: Vec3<F>| u[0].fma(v[0], u[1] * v[1]);
    let side = quadratic(flat(d, d), flat(p, d), radius.fnma(radius, flat(p, p)));
    side.and(slab(p[2], d[2], half))
}

/// a t² + 2 b t + c ≤ 0
#[inline(always)]
fn quadratic<F: Num>(a: F, b: F, c: F) -> Span<F> {
    let zero = F::c(0.0);
    // roots of the quadratic; without a real root the interval is empty
    let constant = a.lt(F::c(PARALLEL * PARALLEL));
    let square = b.fma(b, -(a * c));
    let root = square.max(zero).sqrt();
    let inverse = F::c(1.0).div(F::select(constant, F::c(1.0), a));
    let (far, none) = (F::c(FAR), F::c(-FAR));
    let inside = c.lt(zero);
    let misses = square.lt(zero);
    let first = F::select(misses, far, (-b - root) * inverse);
    let last = F::select(misses, none, (root - b) * inverse);
    // without t² the ray is parallel to the surface: inside for all t or for none
    Span {
        first: F::select(constant, F::select(inside, none, far), first),
        last: F::select(constant, F::select(inside, far, none), last),
    }
}

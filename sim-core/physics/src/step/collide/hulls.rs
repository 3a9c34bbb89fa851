//! Convex hulls against planes, spheres, capsules, boxes and each other.
//!
//! All is found in the hull's frame; of two hulls, in the second's. Planes: the hull's lowest vertices. Spheres, capsules
//! and boxes: the best of all separating axes, which is exact in penetration, and GJK from there where they are apart. A
//! sphere is a point, a capsule a segment, with a radius about it. Two hulls: GJK at a stand-off, and where they penetrate
//! more deeply, the nearest face of their Minkowski difference.

use super::choose::select;
use super::gjk::{NoRestart, closest};
use super::hull_axes::{
    Best, BoxReach, PointReach, Reach, SegmentReach, bounding_axis, hull_axis, slack,
};
use super::hull_depth::LeastDepth;
use super::manifold::{Near, add_points, aligned};
use super::points::{Placed, Points};
use super::sides::{BoxSide, HullSide, SegmentSide};
use super::spread::Spread;
use super::support::{
    Block, Point, Polyhedron, Segment, Support, Turned, across, four, get3, negated, pick3, set3,
    var3,
};
use crate::constants::clip::Cut;
use crate::constants::hull::HullTables;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::{span, when};

/// A plane and a hull: the deepest vertex below the margin and three others that span most.
#[inline(always)]
pub fn plane_hull<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    b: &Placed<C::F>,
    hull: C::I,
    tables: &HullTables,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let hull = Polyhedron { tables, hull };
    let n = b.axes.transpose_mul(axes_a[2]);
    let height = axes_a[2].dot(b.center);
    let half = hull.half_extents(cx);
    let reach = BoxReach(half).reach(n);
    when!(cx, (height - reach).lt(margin), {
        let size = hull.radius(cx);
        let u = across(n);
        let view = Mat3([u, n.cross(u), n]);
        let (first, end) = hull.span(cx, 0);
        let mut spot = [
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
        ];
        let mut found = [
            cx.var(c(0.0)),
            cx.var(c(0.0)),
            cx.var(c(0.0)),
            cx.var(c(0.0)),
        ];
        // of vertices as deep up to rounding the first stays, so that a resting hull keeps its points
        let mut lowest = var3(cx, Vec3([c(0.0), c(0.0), c(1e18)]));
        span!(cx, row in first, end, {
            for point in four(cx, tables, row) {
                let x = view.transpose_mul(point);
                let old = get3(cx, &lowest);
                let deeper = (x[2] + c(2e-6) * size).lt(old[2]);
                set3(cx, &mut lowest, select(deeper, x, old));
            }
        });
        let deepest = get3(cx, &lowest);
        set3(cx, &mut spot[0], deepest);
        cx.set(
            &mut found[0],
            C::F::select((deepest[2] + height).lt(margin), c(1.0), c(0.0)),
        );
        for stage in 0..3 {
            let chosen: [Vec3<C::F>; 3] =
                [get3(cx, &spot[0]), get3(cx, &spot[1]), get3(cx, &spot[2])];
            let spread = Spread::of(stage, chosen);
            let mut best = cx.var(spread.threshold(c(1e-3) * size));
            let mut place = var3(cx, chosen[0]);
            let mut is = cx.var(c(0.0));
            span!(cx, row in first, end, {
                for point in four(cx, tables, row) {
                    let x = view.transpose_mul(point);
                    let score = spread.score(x[0], x[1]);
                    let (old, kept, had) = (cx.get(&best), get3(cx, &place), cx.get(&is));
                    let farther = old.lt(score) & (x[2] + height).lt(margin);
                    cx.set(&mut best, C::F::select(farther, score, old));
                    set3(cx, &mut place, select(farther, x, kept));
                    cx.set(&mut is, C::F::select(farther, c(1.0), had));
                }
            });
            let (x, is) = (get3(cx, &place), cx.get(&is));
            set3(cx, &mut spot[stage + 1], x);
            cx.set(&mut found[stage + 1], is);
        }
        for k in 0..4 {
            let x = get3(cx, &spot[k]);
            let distance = x[2] + height;
            let on_hull = view[0].scale_add(
                x[0],
                view[1].scale_add(x[1], n * (x[2] - c(0.5) * distance)),
            );
            let is = c(0.5).lt(cx.get(&found[k]));
            out.add(
                cx,
                is,
                b.axes.mul_add(on_hull, b.center),
                distance,
                axes_a[2],
            );
        }
    });
}

/// A sphere and a hull: one point.
#[inline(always)]
pub fn sphere_hull<C: Cx>(
    cx: &mut C,
    radius: C::F,
    b: &Placed<C::F>,
    hull: C::I,
    tables: &HullTables,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let hull = Polyhedron { tables, hull };
    let (zero, one) = (c(0.0), c(1.0));
    let upright = Mat3([
        Vec3([one, zero, zero]),
        Vec3([zero, one, zero]),
        Vec3([zero, zero, one]),
    ]);
    let center = negated(b.axes.transpose_mul(b.center));
    let near = near_hull(
        cx,
        &hull,
        &upright,
        center,
        &PointReach,
        &Point(center),
        radius,
        radius,
        margin,
    );
    let point = b.axes.mul_add(near.point, b.center);
    let normal = b.axes * near.normal;
    out.add(cx, near.distance.lt(margin), point, near.distance, normal);
}

/// A capsule along z and a hull: two points where it lies on a face, or one.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn capsule_hull<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    radius: C::F,
    half_height: C::F,
    b: &Placed<C::F>,
    hull: C::I,
    tables: &HullTables,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let hull = Polyhedron { tables, hull };
    let (axes, center) = in_frame_of(b, axes_a);
    let half = axes[2] * half_height;
    let other = SegmentReach(half_height);
    let segment = Segment { center, half };
    let size = radius + half_height;
    let near = near_hull(
        cx, &hull, &axes, center, &other, &segment, radius, size, margin,
    );
    when!(cx, near.distance.lt(margin), {
        let face = HullSide::find(cx, &hull, None, negated(near.normal));
        let side = SegmentSide::new(near.normal.scale_add(radius, center), half, near.normal);
        let flat = aligned(face.outward, near.normal);
        let size = size.min(hull.radius(cx));
        add_points(
            cx,
            &near,
            flat,
            &side,
            &face,
            C::F::c(1.0),
            size,
            margin,
            &b.axes,
            b.center,
            cut,
            out,
        );
    });
}

/// A box and a hull: up to four points.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn box_hull<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    half_a: Vec3<C::F>,
    b: &Placed<C::F>,
    hull: C::I,
    tables: &HullTables,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let hull = Polyhedron { tables, hull };
    let (axes, center) = in_frame_of(b, axes_a);
    let half = [
        axes[0] * half_a[0],
        axes[1] * half_a[1],
        axes[2] * half_a[2],
    ];
    let block = Block {
        center,
        half: Mat3(half),
    };
    let size = half_a.dot(half_a).sqrt();
    let zero = C::F::c(0.0);
    let near = near_hull(
        cx,
        &hull,
        &axes,
        center,
        &BoxReach(half_a),
        &block,
        zero,
        size,
        margin,
    );
    when!(cx, near.distance.lt(margin), {
        let face = HullSide::find(cx, &hull, None, negated(near.normal));
        let side = BoxSide::find(&axes, half_a, center, near.normal);
        let flat = aligned(face.outward, near.normal) | aligned(side.outward, near.normal);
        let size = size.min(hull.radius(cx));
        add_points(
            cx,
            &near,
            flat,
            &side,
            &face,
            C::F::c(1.0),
            size,
            margin,
            &b.axes,
            b.center,
            cut,
            out,
        );
    });
}

/// Two hulls: up to four points.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn hull_hull<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    hull_a: C::I,
    b: &Placed<C::F>,
    hull_b: C::I,
    tables: &HullTables,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let (axes, center) = in_frame_of(b, axes_a);
    let second = Polyhedron {
        tables,
        hull: hull_b,
    };
    let own = Polyhedron {
        tables,
        hull: hull_a,
    };
    let (half_a, half_b) = (own.half_extents(cx), second.half_extents(cx));
    let (radius_a, radius_b) = (own.radius(cx), second.radius(cx));
    let first = Turned { own, axes, center };
    let outer = bounding_axis(half_b, &axes, center, &BoxReach(half_a));
    when!(cx, outer.distance.lt(margin), {
        let small = radius_a.min(radius_b);
        let depth = LeastDepth {
            first: &first,
            second: &second,
            depth: small * C::F::c(DEEP),
            promising: cut.edges,
        };
        let found = closest(
            cx,
            &first,
            &second,
            outer.normal,
            radius_a + radius_b,
            margin,
            &depth,
        );
        let near = found.near();
        when!(cx, near.distance.lt(margin), {
            let side = HullSide::find(cx, &first.own, Some((axes, center)), near.normal);
            let face = HullSide::find(cx, &second, None, negated(near.normal));
            let flat = aligned(face.outward, near.normal) | aligned(side.outward, near.normal);
            add_points(
                cx,
                &near,
                flat,
                &side,
                &face,
                C::F::c(1.0),
                small,
                margin,
                &b.axes,
                b.center,
                cut,
                out,
            );
        });
    });
}

/// Depth past which the nearest axis may not be that of least depth, relative to the smaller radius.
const DEEP: f64 = 0.01;

/// The axes and the centre of the first shape, which is at the origin, in the frame of the second.
#[inline(always)]
pub(super) fn in_frame_of<F: Num>(b: &Placed<F>, axes_a: &Mat3<F>) -> (Mat3<F>, Vec3<F>) {
    let axes = [
        b.axes.transpose_mul(axes_a[0]),
        b.axes.transpose_mul(axes_a[1]),
        b.axes.transpose_mul(axes_a[2]),
    ];
    (Mat3(axes), negated(b.axes.transpose_mul(b.center)))
}

/// Where a shape, with `radius` around what `other` and `shape` say of it, is nearest to a hull; 1e18 m away where they
/// are found to be farther apart than the margin. `size` is its radius about its centre.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn near_hull<C: Cx, R: Reach<C::F>>(
    cx: &mut C,
    hull: &Polyhedron<C>,
    axes: &Mat3<C::F>,
    center: Vec3<C::F>,
    other: &R,
    shape: &impl Support<C>,
    radius: C::F,
    size: C::F,
    margin: C::F,
) -> Near<C::F> {
    let c = C::F::c;
    let limit = margin + radius;
    let mut distance = cx.var(c(1e18));
    let mut normal = var3(cx, Vec3::zero());
    let mut point = var3(cx, Vec3::zero());
    let half = hull.half_extents(cx);
    let outer = bounding_axis(half, axes, center, other);
    when!(cx, outer.distance.lt(limit), {
        let size = size + hull.radius(cx);
        let best = hull_axis(cx, hull, axes, center, other, limit, slack(size));
        let apart = c(0.0).lt(best.axis.distance) & best.axis.distance.lt(limit);
        let inside = !c(0.0).lt(best.axis.distance);
        when!(cx, apart, {
            let found = closest(cx, shape, hull, best.axis.normal, size, limit, &NoRestart);
            set3(cx, &mut normal, found.axis.normal);
            set3(cx, &mut point, found.point);
            cx.set(&mut distance, found.axis.distance);
        });
        when!(cx, inside, {
            let x = deepest_point(cx, hull, axes, shape, &best);
            set3(cx, &mut normal, best.axis.normal);
            set3(cx, &mut point, x);
            cx.set(&mut distance, best.axis.distance);
        });
    });
    let normal = get3(cx, &normal);
    Near {
        normal,
        distance: cx.get(&distance) - radius,
        point: normal.scale_add(c(0.5) * radius, get3(cx, &point)),
    }
}

/// The middle of the closest points along the axis of least depth.
#[inline(always)]
fn deepest_point<C: Cx>(
    cx: &mut C,
    hull: &Polyhedron<C>,
    axes: &Mat3<C::F>,
    shape: &impl Support<C>,
    best: &Best<C::F>,
) -> Vec3<C::F> {
    let c = C::F::c;
    let n = best.axis.normal;
    let half = n * (c(0.5) * best.axis.distance);
    let corner = shape.farthest(cx, n);
    let middle = [
        corner[0] + half[0],
        corner[1] + half[1],
        corner[2] + half[2],
    ];
    let mut point = var3(cx, Vec3(middle));
    when!(cx, best.of_other(), {
        let vertex = hull.farthest(cx, negated(n));
        set3(cx, &mut point, vertex - half);
    });
    when!(cx, best.of_edges(), {
        // the hull's edge x = p + s d and the other's x = r + t q, where n is across both: (p - r + s d - t q) ∥ n
        let edges = hull.tables.edges;
        let (p, d) = (
            pick3(cx, edges, best.edge, 0),
            pick3(cx, edges, best.edge, 3),
        );
        let (first, second) = (best.along.lt(c(0.5)), best.along.lt(c(1.5)));
        let q = select(first, axes[0], select(second, axes[1], axes[2]));
        let mixed = d.dot(q);
        let square = mixed.fnma(mixed, c(1.0)).max(c(1e-7));
        let way = corner - p;
        let s = mixed.fnma(way.dot(q), way.dot(d)).div(square);
        set3(cx, &mut point, d.scale_add(s, p) - half);
    });
    get3(cx, &point)
}

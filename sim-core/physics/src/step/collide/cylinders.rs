//! Cylinders against spheres, capsules, boxes, hulls and each other.
//!
//! A sphere: in closed form. The others: the best of a few axes rejects what is far, and GJK at a stand-off goes on from
//! it with the cylinder's exact farthest points. All is found in the frame of the pair's second shape.

use super::gjk::closest;
use super::hull_axes::{
    Axis, BoxReach, CylinderReach, Reach, SegmentReach, better, bounding_axis, hull_axis, slack,
};
use super::hulls::in_frame_of;
use super::manifold::{Near, add_points, aligned};
use super::points::{Placed, Points};
use super::samples::{Hull, Own, Samples};
use super::sides::{BoxSide, CylinderSide, HullSide, SegmentSide};
use super::support::{Block, Cylinder, Polyhedron, Segment, Upright, negated, signed};
use crate::constants::clip::Cut;
use crate::constants::hull::HullTables;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::when;

/// Segments turned to each other less than this lie along each other [–]: 1.8°.
const PARALLEL: f64 = 0.9995;

/// Depth past which the nearest axis may not be that of least depth, relative to the cylinder's radius.
const DEEP: f64 = 0.03;

/// A sphere and a cylinder: one point.
#[inline(always)]
pub fn sphere_cylinder<C: Cx>(
    cx: &mut C,
    radius: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height_b: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let Vec3([x, y, z]) = negated(b.axes.transpose_mul(b.center));
    let width = x.fma(x, y * y).sqrt();
    // on the axis any direction across it is as good
    let on_axis = width.lt(c(1e-12));
    let unit = one.div(width.max(c(1e-12)));
    let (rx, ry) = (
        C::F::select(on_axis, one, x * unit),
        C::F::select(on_axis, zero, y * unit),
    );
    let (beside, above) = (width - radius_b, z.abs() - half_height_b);
    let (out_r, out_z) = (beside.max(zero), above.max(zero));
    let length = out_r.fma(out_r, out_z * out_z).sqrt();
    let outside = c(1e-12).lt(length);
    let inverse = one.div(length.max(c(1e-12)));
    let over = beside.lt(above);
    let (radial, axial) = (
        C::F::select(outside, out_r * inverse, C::F::select(over, zero, one)),
        C::F::select(outside, out_z * inverse, C::F::select(over, one, zero)),
    );
    let core = C::F::select(outside, length, beside.max(above));
    let normal = [-(rx * radial), -(ry * radial), signed(-axial, z)];
    let normal = b.axes * Vec3(normal);
    let distance = core - radius;
    let point = normal * ((radius + core) * c(0.5));
    out.add(cx, distance.lt(margin), point, distance, normal);
}

/// A capsule and a cylinder, both along z: two points where they lie along each other, or one.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn capsule_cylinder<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    radius: C::F,
    half_height: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height_b: C::F,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (axes, center) = in_frame_of(b, axes_a);
    let half = axes[2] * half_height;
    let pair = Rough {
        axes: &axes,
        center,
        a: &SegmentReach(half_height),
        b: &CylinderReach(radius_b, half_height_b),
    };
    let mut start = pair.along(unit_z());
    start = better(start, pair.along(axes[2].cross(unit_z())), c(0.0));
    start = better(
        start,
        pair.along(beside(half.scale_add(c(-1.0), center))),
        c(0.0),
    );
    start = better(
        start,
        pair.along(beside(half.scale_add(c(1.0), center))),
        c(0.0),
    );
    start = better(start, pair.along(beside(center)), c(0.0));
    let limit = margin + radius;
    when!(cx, start.distance.lt(limit), {
        let segment = Segment { center, half };
        let cylinder = upright(radius_b, half_height_b);
        let size = half_height + around(radius_b, half_height_b);
        let core = closest(
            cx,
            &segment,
            &cylinder,
            start.normal,
            size,
            limit,
            &pair.samples(radius_b * c(DEEP)),
        )
        .near();
        let near = Near {
            distance: core.distance - radius,
            point: core.normal.scale_add(radius * c(0.5), core.point),
            ..core
        };
        when!(cx, near.distance.lt(margin), {
            let n = near.normal;
            let side = SegmentSide::new(n.scale_add(radius, center), half, n);
            let other =
                CylinderSide::find(&unit_axes(), radius_b, half_height_b, zero3(), negated(n));
            let along = !other.cap & c(PARALLEL).lt(axes[2][2].abs());
            let flat = other.flat(n) | along;
            let size = (radius + half_height).min(around(radius_b, half_height_b));
            add_points(
                cx,
                &near,
                flat,
                &side,
                &other,
                c(1.0),
                size,
                margin,
                &b.axes,
                b.center,
                cut,
                out,
            );
        });
    });
}

/// A box and a cylinder along z: four points where a cap lies on a face, two where the side does, or one.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn box_cylinder<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    half_a: Vec3<C::F>,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height_b: C::F,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (axes, center) = in_frame_of(b, axes_a);
    let pair = Rough {
        axes: &axes,
        center,
        a: &BoxReach(half_a),
        b: &CylinderReach(radius_b, half_height_b),
    };
    let mut start = pair.along(unit_z());
    for j in 0..3 {
        start = better(start, pair.along(axes[j]), c(0.0));
        start = better(start, pair.along(axes[j].cross(unit_z())), c(0.0));
    }
    start = better(start, pair.along(beside(center)), c(0.0));
    start = better(start, pair.along(center), c(0.0));
    when!(cx, start.distance.lt(margin), {
        let half = [
            axes[0] * half_a[0],
            axes[1] * half_a[1],
            axes[2] * half_a[2],
        ];
        let block = Block {
            center,
            half: Mat3(half),
        };
        let cylinder = upright(radius_b, half_height_b);
        let (size_a, size_b) = (half_a.dot(half_a).sqrt(), around(radius_b, half_height_b));
        let near = closest(
            cx,
            &block,
            &cylinder,
            start.normal,
            size_a + size_b,
            margin,
            &pair.samples(radius_b * c(DEEP)),
        )
        .near();
        when!(cx, near.distance.lt(margin), {
            let n = near.normal;
            let side =
                CylinderSide::find(&unit_axes(), radius_b, half_height_b, zero3(), negated(n));
            let face = BoxSide::find(&axes, half_a, center, n);
            let flat = side.flat(n) | aligned(face.outward, n);
            let size = size_a.min(size_b);
            add_points(
                cx,
                &near,
                flat,
                &side,
                &face,
                c(-1.0),
                size,
                margin,
                &b.axes,
                b.center,
                cut,
                out,
            );
        });
    });
}

/// Two cylinders along z: four points where their caps meet, two where one lies along the other or on its cap, or one.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn cylinder_cylinder<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    radius_a: C::F,
    half_height_a: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height_b: C::F,
    margin: C::F,
    cut: Cut,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (axes, center) = in_frame_of(b, axes_a);
    let pair = Rough {
        axes: &axes,
        center,
        a: &CylinderReach(radius_a, half_height_a),
        b: &CylinderReach(radius_b, half_height_b),
    };
    let mut start = pair.along(unit_z());
    start = better(start, pair.along(axes[2]), c(0.0));
    start = better(start, pair.along(axes[2].cross(unit_z())), c(0.0));
    start = better(start, pair.along(beside(center)), c(0.0));
    let across_a = axes[2].scale_add(-axes[2].dot(center), center);
    start = better(start, pair.along(across_a), c(0.0));
    start = better(start, pair.along(center), c(0.0));
    when!(cx, start.distance.lt(margin), {
        let first = Cylinder {
            axes,
            center,
            radius: radius_a,
            half_height: half_height_a,
        };
        let second = upright(radius_b, half_height_b);
        let (size_a, size_b) = (
            around(radius_a, half_height_a),
            around(radius_b, half_height_b),
        );
        let near = closest(
            cx,
            &first,
            &second,
            start.normal,
            size_a + size_b,
            margin,
            &pair.samples(radius_b * c(DEEP)),
        )
        .near();
        when!(cx, near.distance.lt(margin), {
            let n = near.normal;
            let side_a = CylinderSide::find(&axes, radius_a, half_height_a, center, n);
            let side_b =
                CylinderSide::find(&unit_axes(), radius_b, half_height_b, zero3(), negated(n));
            let lines = !(side_a.cap | side_b.cap);
            let along = lines & c(PARALLEL).lt(axes[2][2].abs());
            let flat = along | (side_a.flat(n) | side_b.flat(n));
            // what is cut may be a line, what cuts it a line only beside another
            let swap = side_a.cap & !side_b.cap;
            let cut_one = CylinderSide::select(swap, &side_b, &side_a);
            let cutting = CylinderSide::select(swap, &side_a, &side_b);
            let which = C::F::select(swap, c(-1.0), c(1.0));
            let size = size_a.min(size_b);
            add_points(
                cx, &near, flat, &cut_one, &cutting, which, size, margin, &b.axes, b.center, cut,
                out,
            );
        });
    });
}

/// A cylinder along z and a hull: four points where a cap lies on a face, two where the side does, or one.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn cylinder_hull<C: Cx>(
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
    let c = C::F::c;
    let hull = Polyhedron { tables, hull };
    let (axes, center) = in_frame_of(b, axes_a);
    let reach = CylinderReach(radius, half_height);
    let half = hull.half_extents(cx);
    let outer = bounding_axis(half, &axes, center, &reach);
    when!(cx, outer.distance.lt(margin), {
        let (size_a, size_b) = (around(radius, half_height), hull.radius(cx));
        let size = size_a + size_b;
        let best = hull_axis(cx, &hull, &axes, center, &reach, margin, slack(size));
        when!(cx, best.axis.distance.lt(margin), {
            let cylinder = Cylinder {
                axes,
                center,
                radius,
                half_height,
            };
            let samples = Samples {
                axes: &axes,
                center,
                a: &reach,
                b: Hull(&hull),
                depth: radius * c(DEEP),
            };
            let near = closest(
                cx,
                &cylinder,
                &hull,
                best.axis.normal,
                size,
                margin,
                &samples,
            )
            .near();
            when!(cx, near.distance.lt(margin), {
                let n = near.normal;
                let side = CylinderSide::find(&axes, radius, half_height, center, n);
                let face = HullSide::find(cx, &hull, None, negated(n));
                let flat = side.flat(n) | aligned(face.outward, n);
                let size = size_a.min(size_b);
                add_points(
                    cx,
                    &near,
                    flat,
                    &side,
                    &face,
                    c(1.0),
                    size,
                    margin,
                    &b.axes,
                    b.center,
                    cut,
                    out,
                );
            });
        });
    });
}

/// A cylinder at the origin along z.
#[inline(always)]
fn upright<F: Num>(radius: F, half_height: F) -> Upright<F> {
    Upright {
        radius,
        half_height,
    }
}

/// Radius of a ball around a cylinder.
#[inline(always)]
fn around<F: Num>(radius: F, half_height: F) -> F {
    radius.fma(radius, half_height * half_height).sqrt()
}

#[inline(always)]
fn zero3<F: Num>() -> Vec3<F> {
    Vec3([F::c(0.0); 3])
}

#[inline(always)]
fn unit_z<F: Num>() -> Vec3<F> {
    Vec3([F::c(0.0), F::c(0.0), F::c(1.0)])
}

#[inline(always)]
fn unit_axes<F: Num>() -> Mat3<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    Mat3([
        Vec3([one, zero, zero]),
        Vec3([zero, one, zero]),
        Vec3([zero, zero, one]),
    ])
}

/// What of a vector is across z.
#[inline(always)]
fn beside<F: Num>(x: Vec3<F>) -> Vec3<F> {
    Vec3([x[0], x[1], F::c(0.0)])
}

/// Two shapes by their reaches: the first with these axes and centre, the second in its own frame.
struct Rough<'a, F, A, B> {
    axes: &'a Mat3<F>,
    center: Vec3<F>,
    a: &'a A,
    b: &'a B,
}

impl<'a, F: Num, A: Reach<F>, B: Reach<F>> Rough<'a, F, A, B> {
    /// Where to start again past a depth.
    #[inline(always)]
    fn samples(&self, depth: F) -> Samples<'a, F, A, Own<'a, B>> {
        Samples {
            axes: self.axes,
            center: self.center,
            a: self.a,
            b: Own(self.b),
            depth,
        }
    }

    /// Their distance along a direction or against it; a vector without length is no axis.
    #[inline(always)]
    fn along(&self, d: Vec3<F>) -> Axis<F> {
        let square = d.dot(d);
        let unit = F::c(1.0).div(square.max(F::c(1e-16)).sqrt());
        let height = d.dot(self.center);
        let normal = d * signed(-unit, height);
        let reach = self.a.reach(self.axes.transpose_mul(normal)) + self.b.reach(normal);
        let distance = F::select(
            F::c(1e-14).lt(square),
            height.abs() * unit - reach,
            F::c(-1e18),
        );
        Axis { normal, distance }
    }
}

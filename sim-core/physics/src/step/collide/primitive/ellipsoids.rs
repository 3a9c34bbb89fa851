//! Another shape against an ellipsoid: one point, since an ellipsoid is curved everywhere.
//!
//! Plane and sphere have closed forms. The others are convex pairs: GJK at a stand-off goes on from the best of a few axes,
//! with the ellipsoid's exact support function.

use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::Vec3;
use crate::step::collide::convex::ellipsoid::{
    EllipsoidReach, LocalEllipsoid, PosedEllipsoid, largest, nearest_point, on_axis, smallest,
};
use crate::step::collide::convex::gjk::closest_points;
use crate::step::collide::convex::hull_axes::{
    HullAxes, Reach, SeparatingAxis, axis_tolerance, bounding_box_axis,
};
use crate::step::collide::convex::posed::{PosedBox, PosedCapsule, PosedCylinder, PosedShape};
use crate::step::collide::convex::restart::DirectionSamples;
use crate::step::collide::convex::start_axes::StartAxes;
use crate::step::collide::manifold::clipped::Separation;
use crate::step::collide::manifold::points::Points;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::primitive::cylinders::DEEP;
use crate::step::collide::primitive::planes::add_plane_contact;
use crate::when;

/// Plane and ellipsoid: the lowest point (MuJoCo: `mjc_PlaneConvex`).
#[inline(always)]
pub fn plane_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (normal, b) = (pair.axes_a[2], pair.pose_b);
    let local = LocalEllipsoid(pair.b.half_extents());
    // against the plane's normal, in the ellipsoid's axes
    let lowest = local.farthest_along(-b.axes.transpose_mul(normal));
    let at = b.axes.mul_add(lowest, b.center);
    add_plane_contact(cx, pair, at, normal.dot(at), out);
}

/// Sphere and ellipsoid: from the point of the ellipsoid that is nearest to the sphere's centre.
#[inline(always)]
pub fn sphere_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (radius, b) = (pair.a.radius(), pair.pose_b);
    // the centre of the sphere in the ellipsoid's axes
    let center = -b.axes.transpose_mul(b.center);
    let (nearest, outward) = nearest_point(pair.b.half_extents(), center);
    // the centre's height above the surface, negative inside
    let distance = (center - nearest).dot(outward) - radius;
    // half-way between the surfaces; the normal points to the ellipsoid
    let near = Separation {
        normal: -outward,
        distance,
        point: outward.scale_add(distance * C::F::c(0.5), nearest),
    };
    add_nearest(cx, pair, &near, out);
}

/// Capsule and ellipsoid.
#[inline(always)]
pub fn capsule_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    add_with_ellipsoid(cx, pair, &PosedCapsule::from_pair(pair), out);
}

/// Box and ellipsoid.
#[inline(always)]
pub fn box_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    add_with_ellipsoid(cx, pair, &PosedBox::from_pair(pair), out);
}

/// Cylinder and ellipsoid.
#[inline(always)]
pub fn cylinder_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    add_with_ellipsoid(cx, pair, &PosedCylinder::from_pair(pair), out);
}

/// Two ellipsoids.
#[inline(always)]
pub fn ellipsoid_ellipsoid<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    add_with_ellipsoid(cx, pair, &PosedEllipsoid::from_pair(pair), out);
}

/// Ellipsoid and hull.
#[inline(always)]
pub fn ellipsoid_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (hull, first) = (pair.hull_b(), PosedEllipsoid::from_pair(pair));
    let (pose, radii) = (first.pose, first.radii);
    let reach = EllipsoidReach(radii);
    // an ellipsoid has no radius around a core
    let limit = pair.margin;
    // a few axes of the hull's bounding box reject; its faces are where GJK begins
    let half = hull.half_extents(cx);
    let outer = bounding_box_axis(half, &pose, &reach);
    when!(cx, outer.distance.lt(limit), {
        // all axes of the hull: one of its faces is the axis where a face touches
        let size = PosedShape::<C>::size(&first) + hull.radius(cx);
        let axes = HullAxes {
            hull: &hull,
            axes: &pose.axes,
            center: pose.center,
            other: &reach,
            limit,
            tolerance: axis_tolerance(size),
        };
        let start = axes.best(cx).axis;
        when!(cx, start.distance.lt(limit), {
            let restart = DirectionSamples {
                axes: pose.axes,
                center: pose.center,
                a: reach,
                b: hull,
                depth: smallest(radii) * C::F::c(DEEP),
            };
            // GJK from there
            let core = PosedShape::<C>::core(&first);
            let closest = closest_points(cx, &core, &hull, start.normal, size, limit, &restart);
            add_nearest(cx, pair, &core.on_axis(closest, start), out);
        });
    });
}

/// Adds the contact of a shape, in the frame of an ellipsoid, with that.
#[inline(always)]
fn add_with_ellipsoid<C: Cx, A: PosedShape<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    first: &A,
    out: &mut Points<C>,
) {
    let radii = pair.b.half_extents();
    let axes = StartAxes {
        pose: first.pose(),
        a: first.reach(),
        b: EllipsoidReach(radii),
    };
    let start = start_axis(&axes, radii);
    // cores are farther apart than surfaces, by the radius
    let radius = first.radius().unwrap_or(C::F::c(0.0));
    let limit = pair.margin + radius;
    when!(cx, start.distance.lt(limit), {
        let size = first.core_size() + largest(radii);
        // GJK from the best axis; in deep penetration from sampled directions, too
        let restart = axes.samples(smallest(radii) * C::F::c(DEEP));
        // both without the radius around the first
        let (core, second) = (first.core(), LocalEllipsoid(radii));
        let core = closest_points(cx, &core, &second, start.normal, size, limit, &restart);
        // the ellipsoid is the second shape: it faces against the normal
        let surface = second.farthest_along(-core.normal);
        let half = core.distance * C::F::c(-0.5);
        let near = on_axis(core, start, core.normal.scale_add(half, surface));
        // the first surface is a radius nearer, so the middle moves by half of it along the normal
        let near = Separation {
            distance: near.distance - radius,
            point: near.normal.scale_add(radius * C::F::c(0.5), near.point),
            ..near
        };
        add_nearest(cx, pair, &near, out);
    });
}

/// The best of a few axes of a shape and an ellipsoid: those of the shape's faces, of the ellipsoid, and two from centre to
/// centre, straight and along the normal of the ellipsoid on this way.
#[inline(always)]
fn start_axis<F: Num, A: Reach<F> + Copy>(
    axes: &StartAxes<'_, F, A, EllipsoidReach<F>>,
    radii: Vec3<F>,
) -> SeparatingAxis<F> {
    let center = axes.pose.center;
    // the normal of an ellipsoid is x / a²
    let mut normal = center;
    for k in 0..3 {
        let share = smallest(radii).div(radii[k]);
        normal[k] = center[k] * (share * share);
    }
    // of equal ones the first
    let mut start = axes.own_axis(2).or(axes.own_axis(0)).or(axes.own_axis(1));
    for &j in A::FACES {
        start = start.or(axes.first_axis(j));
    }
    start.or(axes.along(center)).or(axes.along(normal)).best
}

/// Adds a contact that is given in the frame of the second shape.
#[inline(always)]
fn add_nearest<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    near: &Separation<C::F>,
    out: &mut Points<C>,
) {
    let b = pair.pose_b;
    // in the frame of the pair
    let touches: MaskOf<C> = near.distance.lt(pair.margin);
    let point = b.axes.mul_add(near.point, b.center);
    out.add(cx, touches, point, near.distance, b.axes * near.normal);
}

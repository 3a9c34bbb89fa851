//! A plane against sphere, capsule, box and cylinder (MuJoCo: `engine_collision_primitive.c`).
//!
//! The plane is z = 0 of the first shape, so the normal is its z axis. The distance of a point x of the other shape is n · x.

use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::sign;
use crate::step::collide::narrow::ShapePair;

/// Half the side of an equilateral triangle in a circle, relative to its radius: √3/2.
const SIDE: f64 = 0.866_025_403_784_438_6;

/// Sine between a cylinder's axis and the normal below which it stands upright: its first rim point is then on its x axis.
/// MuJoCo's `mjMINVAL`, or above the rounding of `f32`: the height of the rim is wrong by at most that part of the radius.
const fn upright<F: Num>() -> f64 {
    match F::Real::EPSILON > 1e-10 {
        true => 2e-6,
        false => 1e-15,
    }
}

/// Adds the contact of a point of a shape with the plane, half-way between both.
#[inline(always)]
pub(in crate::step::collide) fn add_plane_contact<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    at: Vec3<C::F>,
    distance: C::F,
    out: &mut Points<C>,
) {
    let normal = pair.axes_a[2];
    let middle = normal.scale_add(distance * C::F::c(-0.5), at);
    out.add(cx, distance.lt(pair.margin), middle, distance, normal);
}

/// Adds the contact of a sphere with the plane.
#[inline(always)]
fn add_sphere<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, center: Vec3<C::F>, out: &mut Points<C>) {
    // the lowest point of the sphere, at n · c - r
    let (normal, radius) = (pair.axes_a[2], pair.b.radius());
    let distance = normal.dot(center) - radius;
    let at = normal.scale_add(-radius, center);
    add_plane_contact(cx, pair, at, distance, out);
}

/// Plane and sphere: one point.
#[inline(always)]
pub fn plane_sphere<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    add_sphere(cx, pair, pair.pose_b.center, out);
}

/// Plane and capsule: a point for each end.
#[inline(always)]
pub fn plane_capsule<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (b, half_height) = (pair.pose_b, pair.b.half_height());
    // the first tangent lies along the capsule (MuJoCo: `mjc_PlaneCapsule`)
    if out.along.is_some() {
        out.along = Some(b.axes[2]);
    }
    // each end of the axis carries a sphere
    for half in [half_height, -half_height] {
        let end = b.axes[2].scale_add(half, b.center);
        add_sphere(cx, pair, end, out);
    }
}

/// Plane and box: the lower corner of each pair of opposite corners. All four lowest corners are among them.
#[inline(always)]
pub fn plane_box<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (normal, b, half) = (pair.axes_a[2], pair.pose_b, pair.b.half_extents());
    // height of the centre, and half edges: a corner is the centre plus or minus each of them
    let height = normal.dot(b.center);
    let x = b.axes[0] * half[0];
    let y = b.axes[1] * half[1];
    let z = b.axes[2] * half[2];
    if pair.ordered_corners {
        // all eight, x first; those above the centre are left out, and all after the fourth that touches
        let mut left = C::F::c(4.0);
        for corner in 0..8 {
            let along = |axis: Vec3<C::F>, bit: usize| match corner & bit {
                0 => axis * C::F::c(-1.0),
                _ => axis,
            };
            let corner = along(x, 1) + (along(y, 2) + along(z, 4));
            let above = normal.dot(corner);
            let far = C::F::c(0.0).lt(above) | left.lt(C::F::c(0.5));
            let distance = C::F::select(far, pair.margin, height + above);
            let touches = distance.lt(pair.margin);
            left = left - C::F::select(touches, C::F::c(1.0), C::F::c(0.0));
            add_plane_contact(cx, pair, b.center + corner, distance, out);
        }
        return;
    }
    for (y, z) in [
        (y, z),
        (y * C::F::c(-1.0), z),
        (y, z * C::F::c(-1.0)),
        (y * C::F::c(-1.0), z * C::F::c(-1.0)),
    ] {
        // the corner or its opposite: whichever is below the centre
        let corner = x + (y + z);
        let above = normal.dot(corner);
        let at = corner.scale_add(-sign(above), b.center);
        add_plane_contact(cx, pair, at, height - above.abs(), out);
    }
}

/// Plane and cylinder: the lowest point of the lower rim, the point of the upper rim above it, and two points of the lower rim
/// that make an equilateral triangle with the first (MuJoCo: `mjc_PlaneCylinder`).
#[inline(always)]
pub fn plane_cylinder<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let c = C::F::c;
    let (normal, b) = (pair.axes_a[2], pair.pose_b);
    let (radius, half_height) = (pair.b.radius(), pair.b.half_height());
    let height = normal.dot(b.center);
    // of a cylinder that lies the end of the axis is the lower one
    let points_up = c(4.0 * <C::F as Num>::Real::EPSILON).lt(normal.dot(b.axes[2]));
    let down = select(points_up, -b.axes[2], b.axes[2]);
    let cosine = normal.dot(down);
    // the part of -normal across the axis points to the lowest point of the rim
    let across = (down * cosine) - normal;
    let sine = across.dot(across).sqrt();
    let upright = sine.lt(c(upright::<C::F>()));
    let unit = c(1.0).div(C::F::select(upright, c(1.0), sine));
    let rim = select(upright, b.axes[0], across * unit) * radius;
    // corners of the triangle are at -rim/2 ± side, with |side| = √3/2 r
    let side = down.cross(rim) * c(SIDE);
    let lower_cap = down.scale_add(half_height, b.center);
    let upper_cap = down.scale_add(-half_height, b.center);
    let opposite = rim.scale_add(c(-0.5), lower_cap);
    // heights of the axis above its middle, and of the rim's directions above a cap
    let (reach, fall, lean) = (half_height * cosine, normal.dot(rim), normal.dot(side));
    let far = fall.fma(c(-0.5), height + reach);
    for (at, distance) in [
        (lower_cap + rim, height + reach + fall),
        (upper_cap + rim, height - reach + fall),
        (opposite - side, far - lean),
        (opposite + side, far + lean),
    ] {
        add_plane_contact(cx, pair, at, distance, out);
    }
}

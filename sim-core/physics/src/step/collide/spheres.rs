//! A sphere against sphere, capsule and box. The sphere's centre is the origin.

use super::choose::{clamped, lowest_of, one_of, select, sign};
use super::points::{Placed, Points};
use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::{Mat3, Vec3};

/// Adds the contact of two spheres; `beside` is the normal where their centres coincide.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // two spheres, and where points go
pub fn spheres<C: Cx>(
    cx: &mut C,
    center_a: Vec3<C::F>,
    radius_a: C::F,
    center_b: Vec3<C::F>,
    radius_b: C::F,
    beside: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let between = center_b - center_a;
    let square = between.dot(between);
    let apart = c(0.0).lt(square);
    let length = square.sqrt();
    let inverse = c(1.0).div(C::F::select(apart, length, c(1.0)));
    let normal = select(apart, between * inverse, beside);
    let distance = length - radius_a - radius_b;
    let at = normal.scale_add(distance.fma(c(0.5), radius_a), center_a);
    out.add(cx, distance.lt(margin), at, distance, normal);
}

/// Contact point of two spheres.
#[inline(always)]
pub fn sphere_sphere<C: Cx>(
    cx: &mut C,
    radius_a: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let up = Vec3([C::F::c(0.0), C::F::c(0.0), C::F::c(1.0)]);
    spheres(
        cx,
        Vec3::zero(),
        radius_a,
        b.center,
        radius_b,
        up,
        margin,
        out,
    );
}

/// Contact point of a sphere and a capsule: of the sphere and that of the capsule's axis nearest to it.
#[inline(always)]
pub fn sphere_capsule<C: Cx>(
    cx: &mut C,
    radius_a: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let along = (-b.axes[2].dot(b.center))
        .min(half_height)
        .max(-half_height);
    let nearest = b.axes[2].scale_add(along, b.center);
    spheres(
        cx,
        Vec3::zero(),
        radius_a,
        nearest,
        radius_b,
        b.axes[0],
        margin,
        out,
    );
}

/// Contact point of a sphere and a box. A centre inside the box leaves through the nearest face.
#[inline(always)]
pub fn sphere_box<C: Cx>(
    cx: &mut C,
    radius: C::F,
    b: &Placed<C::F>,
    half: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let center = b.axes.transpose_mul(b.center) * C::F::c(-1.0);
    let (distance, way) = leave_box(center, half);
    let always = !margin.lt(margin);
    sphere_off_box(cx, radius, center, distance, way, b, always, margin, out);
}

/// Adds the contact of a sphere and a box: the sphere's centre is `at` in the box's frame, `distance` from the box along the
/// unit vector `way`.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // a sphere, its way out of the box, and where points go
pub fn sphere_off_box<C: Cx>(
    cx: &mut C,
    radius: C::F,
    at: Vec3<C::F>,
    distance: C::F,
    way: Vec3<C::F>,
    b: &Placed<C::F>,
    mask: MaskOf<C>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    // the surfaces are at -radius and at -distance
    let middle = way.scale_add((radius + distance) * c(-0.5), at);
    let distance = distance - radius;
    out.add(
        cx,
        mask & distance.lt(margin),
        b.axes.mul_add(middle, b.center),
        distance,
        (b.axes * way) * c(-1.0),
    );
}

/// The way from a box to a point in its frame: the distance, negative inside, and the unit direction.
#[inline(always)]
pub fn leave_box<F: Num>(point: Vec3<F>, half: Vec3<F>) -> (F, Vec3<F>) {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let apart = point - clamped(point, half);
    let square = apart.dot(apart);
    let outside = zero.lt(square);
    let length = square.sqrt();
    let inverse = one.div(F::select(outside, length, one));
    let depths = Vec3([
        half[0] - point[0].abs(),
        half[1] - point[1].abs(),
        half[2] - point[2].abs(),
    ]);
    let (face, depth) = lowest_of(depths);
    let faces = Mat3([
        Vec3([sign(point[0]), zero, zero]),
        Vec3([zero, sign(point[1]), zero]),
        Vec3([zero, zero, sign(point[2])]),
    ]);
    let direction = select(outside, apart * inverse, one_of(face, faces));
    (F::select(outside, length, -depth), direction)
}

//! A plane against sphere, capsule, box and cylinder. The plane is z = 0 of the first shape, and its z axis the normal.

use super::choose::{select, sign};
use super::points::{Placed, Points};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};

/// Below this sine between axis and normal a cylinder stands: its lowest rim point is then its x axis'. Above the rounding
/// of f32; the height of the rim is wrong by that part of the radius at most.
const UPRIGHT: f64 = 2e-6;

/// Adds the contact of a point of a shape with the plane.
#[inline(always)]
fn lowest<C: Cx>(
    cx: &mut C,
    normal: Vec3<C::F>,
    at: Vec3<C::F>,
    distance: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let middle = normal.scale_add(distance * C::F::c(-0.5), at);
    out.add(cx, distance.lt(margin), middle, distance, normal);
}

/// Contact point of a plane and a sphere.
#[inline(always)]
pub fn plane_sphere<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    b: &Placed<C::F>,
    radius: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let normal = axes_a[2];
    let distance = normal.dot(b.center) - radius;
    let at = normal.scale_add(-radius, b.center);
    lowest(cx, normal, at, distance, margin, out);
}

/// Contact points of a plane and a capsule: one of each end. The first tangent lies along the capsule, as MuJoCo's.
#[inline(always)]
pub fn plane_capsule<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    b: &Placed<C::F>,
    radius: C::F,
    half_height: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    if out.along.is_some() {
        out.along = Some(b.axes[2]);
    }
    for half in [half_height, -half_height] {
        let end = Placed {
            axes: b.axes,
            center: b.axes[2].scale_add(half, b.center),
        };
        plane_sphere(cx, axes_a, &end, radius, margin, out);
    }
}

/// Contact points of a plane and a box: of each pair of opposite corners the lower one.
#[inline(always)]
pub fn plane_box<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    b: &Placed<C::F>,
    half: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let normal = axes_a[2];
    let height = normal.dot(b.center);
    let x = b.axes[0] * half[0];
    let y = b.axes[1] * half[1];
    let z = b.axes[2] * half[2];
    for (y, z) in [
        (y, z),
        (y * C::F::c(-1.0), z),
        (y, z * C::F::c(-1.0)),
        (y * C::F::c(-1.0), z * C::F::c(-1.0)),
    ] {
        let corner = x + (y + z);
        let above = normal.dot(corner);
        let at = corner.scale_add(-sign(above), b.center);
        lowest(cx, normal, at, height - above.abs(), margin, out);
    }
}

/// Contact points of a plane and a cylinder: a square on the rim of the lower end, turned so that one corner is the lowest
/// point, and the rim of the other end above that corner.
#[inline(always)]
pub fn plane_cylinder<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    b: &Placed<C::F>,
    radius: C::F,
    half_height: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let normal = axes_a[2];
    let height = normal.dot(b.center);
    let down = b.axes[2] * -sign(normal.dot(b.axes[2]));
    let cosine = normal.dot(down);
    // the part of -normal across the axis
    let across = (down * cosine) - normal;
    let sine = across.dot(across).sqrt();
    let upright = sine.lt(c(UPRIGHT));
    let unit = c(1.0).div(C::F::select(upright, c(1.0), sine));
    let rim = select(upright, b.axes[0], across * unit) * radius;
    let side = down.cross(rim);
    let end = down.scale_add(half_height, b.center);
    let other = down.scale_add(-half_height, b.center);
    let reach = half_height * cosine;
    let (fall, lean) = (normal.dot(rim), normal.dot(side));
    lowest(cx, normal, end + rim, height + reach + fall, margin, out);
    lowest(cx, normal, other + rim, height - reach + fall, margin, out);
    lowest(cx, normal, end + side, height + reach + lean, margin, out);
    lowest(cx, normal, end - side, height + reach - lean, margin, out);
    lowest(cx, normal, end - rim, height + reach - fall, margin, out);
}

//! Rays and triangles (MuJoCo: `mj_rayMesh`, `mj_rayHfield`).
//!
//! ```text
//! a, b, c                corners from the origin of the ray, along x, y and z, z the direction
//! u = b × c    v = c × a    w = a × b         of the parts along x and y; the ray passes inside if
//! t = (u a_z + v b_z + w c_z) / (u + v + w)   none of them has another sign than the others
//! ```
//!
//! A triangle is met from both sides. Its normal is where its corners run counter-clockwise.

use crate::constants::sensors::RayTables;
use crate::lane::{Cx, Num, Real, map};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::ConstantsOf;
use crate::{span, when};

/// Larger than any distance that matters [m].
const FAR: f64 = 1e15;
/// Part of a direction below which a ray is parallel to a side [–], and twice the area across a ray
/// below which it meets no triangle [m²] (MuJoCo: `mjMINVAL`).
const SMALL: f64 = 1e-15;

/// Distance to the nearest of some triangles along a ray, or -1, and its normal if that is wanted.
/// All are in the axes of their geom. The third of `axes` is the direction of the ray.
#[inline(always)]
pub(super) fn to_triangles<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    boxes: (usize, usize),
    point: Vec3<C::F>,
    axes: &Mat3<C::F>,
    has_normal: bool,
) -> (C::F, Vec3<C::F>) {
    let tables: RayTables = m.sensors.triangles;
    let zero = C::F::c(0.0);
    let mut nearest = cx.var(C::F::c(FAR));
    let mut normal: [C::V; 3] = [cx.var(zero), cx.var(zero), cx.var(zero)];
    let (first, end) = (cx.at(boxes.0), cx.at(boxes.1));
    span!(cx, part in first, end, {
        // only the triangles of boxes that the ray enters before what it has met
        let [x, y, z, a, b, c] = cx.constants(tables.boxes, part, 0);
        let limit = cx.get(&nearest);
        let enters = is_entered([Vec3([x, y, z]), Vec3([a, b, c])], point, axes[2], limit);
        when!(cx, enters, {
            let rows = tables.triangles.rows + 1;
            let start = cx.index(tables.spans, part, 0, rows);
            let stop = cx.index(tables.spans, part, 1, rows);
            span!(cx, row in start, stop, {
                let n: [C::F; 9] = cx.constants(tables.triangles, row, 0);
                let corners = [
                    Vec3([n[0], n[1], n[2]]),
                    Vec3([n[3], n[4], n[5]]),
                    Vec3([n[6], n[7], n[8]]),
                ];
                // no triangle is at FAR
                let far = to_triangle(corners, point, axes);
                let limit = cx.get(&nearest);
                let is_nearer = far.lt(limit);
                let least = C::F::select(is_nearer, far, limit);
                cx.set(&mut nearest, least);
                if has_normal {
                    // its length does not matter until the end
                    let [p, q, r] = corners;
                    let outwards = (p - r).cross(q - r);
                    for (k, cell) in normal.iter_mut().enumerate() {
                        let x = C::F::select(is_nearer, outwards[k], cx.get(cell));
                        cx.set(cell, x);
                    }
                }
            });
        });
    });
    // -1 where none was nearer than FAR; the normal gets length 1, or stays 0
    let far = cx.get(&nearest);
    let is_met = far.lt(C::F::c(FAR));
    let outwards = Vec3([cx.get(&normal[0]), cx.get(&normal[1]), cx.get(&normal[2])]);
    let length = outwards.dot(outwards).sqrt();
    let inverse = C::F::c(1.0).div(C::F::select(zero.lt(length), length, C::F::c(1.0)));
    let far = C::F::select(is_met, far, C::F::c(-1.0));
    (far, outwards * inverse)
}

/// Does a ray enter a box, given by its centre and half extents, before a limit?
#[inline(always)]
fn is_entered<F: Num>(
    [center, half]: [Vec3<F>; 2],
    point: Vec3<F>,
    along: Vec3<F>,
    limit: F,
) -> F::Mask {
    let (small, far) = (F::c(SMALL), F::c(FAR));
    let (mut first, mut last) = (F::c(0.0), limit);
    // the part of the ray that is between the sides of each pair
    for k in 0..3 {
        let from = center[k] - point[k];
        // wider by what rounding takes from a place
        let wide = from.abs().fma(F::c(16.0 * F::Real::EPSILON), half[k]);
        // t at both sides; a parallel ray is between them for all t or for none
        let parallel = along[k].abs().lt(small);
        let inverse = F::c(1.0).div(F::select(parallel, F::c(1.0), along[k]));
        let [one, other] = map([from - wide, from + wide], |x| x * inverse);
        let beyond = wide.lt(from.abs());
        let enters = F::select(parallel, F::select(beyond, far, -far), one.min(other));
        let leaves = F::select(parallel, F::select(beyond, -far, far), one.max(other));
        first = first.max(enters);
        last = last.min(leaves);
    }
    !last.lt(first)
}

/// Distance along a ray to a triangle; more than FAR where it is not met.
#[inline(always)]
fn to_triangle<F: Num>(corners: [Vec3<F>; 3], point: Vec3<F>, axes: &Mat3<F>) -> F {
    let zero = F::c(0.0);
    let [a, b, c] = map(corners, |corner| axes.transpose_mul(corner - point));
    // edges around the ray, as seen along it: the same number for both triangles beside an edge
    let (u, v, w) = (turn(b, c), turn(c, a), turn(a, b));
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    let misses = least.lt(zero) & zero.lt(most);
    // twice the area across the ray
    let area = u + v + w;
    let is_thin = area.abs().lt(F::c(SMALL));
    let inverse = F::c(1.0).div(F::select(is_thin, F::c(1.0), area));
    let far = u.fma(a[2], v.fma(b[2], w * c[2])) * inverse;
    // behind the origin it is not met either
    let is_met = !(misses | is_thin | far.lt(zero));
    F::select(is_met, far, F::c(2.0 * FAR))
}

/// The product of the parts of two vectors along x and y.
#[inline(always)]
fn turn<F: Num>(p: Vec3<F>, q: Vec3<F>) -> F {
    p[0] * q[1] - p[1] * q[0]
}

//! How two geoms are apart (MuJoCo: `mj_geomDistance`), of planes, spheres and capsules.
//!
//! ```text
//! p = x a     q = c + y d     the nearest points of two axes, x and y within their halves
//! n = (q - p) / |q - p|       the segment goes from p + r n to q - s n, r and s the radii
//! ```
//!
//! A sphere is a capsule whose axis has no length. The ends of the segment change sides where the
//! geoms overlap. Of parallel axes, all points beside each other are as near.

use super::put;
use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::constants::sensors::{DistancePart, DistanceSensor, RayGeom, Sensor, ZoneKind};
use crate::lane::{Num, Real};
use crate::math::vec3::Vec3;
use crate::step::outputs::sites::{axes, position, reference};

/// Squared sine below which two axes are parallel [–].
const PARALLEL: f64 = 1e-12;
/// Length below which a segment has no direction (MuJoCo: `mjMINVAL`) [m].
const SHORT: f64 = 1e-15;

/// The segment between two geoms.
#[derive(Clone, Copy)]
struct Between<F> {
    /// Its length, negative where they overlap [m].
    distance: F,
    /// Its ends on the first and on the second geom, from a point of the world [m].
    ends: [Vec3<F>; 2],
    /// Unit vector from the inside of the first geom to that of the second.
    normal: Vec3<F>,
}

/// Writes what a sensor shows of the nearest pair.
#[inline(always)]
pub(super) fn show<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    sensor: &Sensor<F::Real>,
    of_pairs: &DistanceSensor<F::Real>,
) {
    let zero = F::c(0.0);
    // where none is nearer than the limit, that is the distance, and the rest is 0
    let mut least = F::k(of_pairs.limit);
    let mut rest = [zero; 9];
    for pair in &of_pairs.pairs {
        let [first, second] = [&m.sensors.geoms[pair[0]], &m.sensors.geoms[pair[1]]];
        let Between {
            distance,
            ends: [from, to],
            normal,
        } = between(w, first, second);
        // the segment of geoms that overlap goes back
        let sign = F::select(distance.lt(zero), F::c(-1.0), F::c(1.0));
        let all = [from.0, to.0, (normal * sign).0];
        let is_nearer = distance.lt(least);
        least = F::select(is_nearer, distance, least);
        for (x, y) in rest.iter_mut().zip(all.as_flattened()) {
            *x = F::select(is_nearer, *y, *x);
        }
    }
    let data = &mut w.sensordata;
    match of_pairs.part {
        DistancePart::Distance => put(data, sensor, &[least]),
        DistancePart::Normal => put(data, sensor, &rest[6..]),
        DistancePart::Ends => put(data, sensor, &rest[..6]),
    }
}

/// The segment from one geom to another, its ends in the world.
#[inline(always)]
fn between<F: Num>(
    w: &Workspace<F>,
    first: &RayGeom<F::Real>,
    second: &RayGeom<F::Real>,
) -> Between<F> {
    // the second centre from the first one; within a tree reference points cancel
    let mut center = position(w, &second.at) - position(w, &first.at);
    if first.at.tree != second.at.tree {
        center = center + (reference(w, &second.at) - reference(w, &first.at));
    }
    let origin = position(w, &first.at) + reference(w, &first.at);
    let (a, d) = (axes(w, &first.at)[2], axes(w, &second.at)[2]);
    let [[r, half_a], [s, half_b]] = [measures(first), measures(second)];
    let mut segment = match (first.kind, second.kind) {
        // from the plane upwards, or the other way round from the second one
        (None, _) => from_plane(a, center, d, [s, half_b]),
        (_, None) => {
            let back = from_plane(d, -center, a, [r, half_a]);
            let [plane, other] = back.ends;
            Between {
                ends: [other + center, plane + center],
                normal: -back.normal,
                ..back
            }
        }
        _ => of_axes([a, d], center, [r, s], [half_a, half_b]),
    };
    for end in &mut segment.ends {
        *end = *end + origin;
    }
    segment
}

/// Radius, and half the length of the axis.
#[inline(always)]
fn measures<F: Num>(geom: &RayGeom<F::Real>) -> [F; 2] {
    let half = match geom.kind {
        Some(ZoneKind::Capsule) => F::k(geom.size[1]),
        _ => F::c(0.0),
    };
    [F::k(geom.size[0]), half]
}

/// From a plane through the origin with a normal to a capsule, the lower end of which counts.
#[inline(always)]
fn from_plane<F: Num>(
    normal: Vec3<F>,
    center: Vec3<F>,
    axis: Vec3<F>,
    [radius, half]: [F; 2],
) -> Between<F> {
    // the end of the axis that is nearer to the plane, and the lowest point of the ball around it
    let falls = axis.dot(normal).lt(F::c(0.0));
    let low = axis.scale_add(F::select(falls, half, -half), center);
    let distance = low.dot(normal) - radius;
    let to = normal.scale_add(-radius, low);
    Between {
        distance,
        ends: [normal.scale_add(-distance, to), to],
        normal,
    }
}

/// From a capsule at the origin to another one.
#[inline(always)]
fn of_axes<F: Num>(
    [a, d]: [Vec3<F>; 2],
    center: Vec3<F>,
    [r, s]: [F; 2],
    [half_a, half_b]: [F; 2],
) -> Between<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    // nearest points of the lines; of parallel ones, that beside the other centre
    let product = a.cross(d);
    let square = product.dot(product);
    let parallel = square.lt(F::c(PARALLEL.max(F::Real::EPSILON)));
    let safe = F::select(parallel, one, square);
    let free = center.cross(d).dot(product).div(safe);
    let free = F::select(parallel, a.dot(center), free);
    // one after the other is put on its axis (Ericson 2005, section 5.1.9)
    let x = free.min(half_a).max(-half_a);
    let y = d.dot(a * x - center).min(half_b).max(-half_b);
    let q = d.scale_add(y, center);
    let p = a * a.dot(q).min(half_a).max(-half_a);
    // the direction between them, x where they are the same
    let way = q - p;
    let length = way.dot(way).sqrt();
    let is_short = length.lt(F::c(SHORT));
    let inverse = one.div(F::select(is_short, one, length));
    let normal = Vec3([
        F::select(is_short, one, way[0] * inverse),
        F::select(is_short, zero, way[1] * inverse),
        F::select(is_short, zero, way[2] * inverse),
    ]);
    Between {
        distance: length - r - s,
        ends: [normal.scale_add(r, p), normal.scale_add(-s, q)],
        normal,
    }
}

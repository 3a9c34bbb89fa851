//! A capsule against capsule and box. The capsule's centre is the origin, its axis is z of its frame.

use super::choose::{clamped, one_of, one_of_numbers, reciprocal, select, sign, unless};
use super::points::{Placed, Points};
use super::spheres::{leave_box, sphere_off_box, spheres};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::when;

/// Below this sine axes are parallel, or perpendicular to a normal: then two points are given, or one end rocks.
const PARALLEL: f64 = 0.01;
/// How much nearer, in roundings of the shapes' size, the nearest point must be than those of the ends, to be a point of its
/// own.
const NEARER: f64 = 8.0;
/// An end that close to the nearest point, of the axis, is that point.
const SAME: f64 = 0.05;
/// A face is larger by this, relatively, where the axis is cut to it.
const ON_PLANE: f64 = 1e-6;
/// The axis is inside a box if it is nearer than this to its surface, of the shapes' size.
const INSIDE: f64 = 1e-6;
/// How much a direction across an edge must exceed one across a face, before division by its length, of the shapes' size.
const PREFER_FACES: f64 = 4e-7;
/// Squared sine below which the axis is parallel to an edge.
const PARALLEL_EDGE: f64 = 1e-8;

/// Contact points of two capsules: the spheres about the closest points of their axes (Ericson 2005, section 5.1.9); where
/// the axes are parallel, about the ends of their overlap.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // two capsules, and where points go
pub fn capsule_capsule<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    radius_a: C::F,
    half_height_a: C::F,
    b: &Placed<C::F>,
    radius_b: C::F,
    half_height_b: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let one = c(1.0);
    let (a, d, center) = (axes_a[2], b.axes[2], b.center);
    let (along_a, along_b) = (a.dot(center), d.dot(center));
    let cosine = a.dot(d);
    let product = a.cross(d);
    let square = product.dot(product);
    let parallel = square.lt(c(PARALLEL * PARALLEL));
    let safe = C::F::select(c(1e-12).lt(square), square, one);

    let free = center.cross(d).dot(product).div(safe);
    let x = free.min(half_height_a).max(-half_height_a);
    let y = cosine
        .fma(x, -along_b)
        .min(half_height_b)
        .max(-half_height_b);
    let x = cosine
        .fma(y, along_a)
        .min(half_height_a)
        .max(-half_height_a);
    let nearest = [a * x, d.scale_add(y, center)];

    // the ends of what the axes have in common; where they have nothing, both are the nearest end
    let reach = half_height_b * cosine.abs();
    let low = (along_a - reach).max(-half_height_a).min(half_height_a);
    let high = (along_a + reach).min(half_height_a).max(-half_height_a);
    let common = parallel & (low + c(SAME) * half_height_a).lt(high);
    let beside = select(
        c(1e-12).lt(square),
        product * one.div(safe.sqrt()),
        axes_a[0],
    );
    let mut least = c(1e9);
    let mut ends = [nearest; 2];
    for (end, at) in ends.iter_mut().zip([low, high]) {
        let y = cosine
            .fma(at, -along_b)
            .min(half_height_b)
            .max(-half_height_b);
        *end = [a * at, d.scale_add(y, center)];
        let between = end[1] - end[0];
        least = least.min(between.dot(between).sqrt());
    }
    let size = radius_a + radius_b + half_height_a + half_height_b;
    let between = nearest[1] - nearest[0];
    let middle =
        (between.dot(between).sqrt() + size * c(NEARER * <C::F as Num>::Real::EPSILON)).lt(least);
    let alone = !common | middle;
    when!(cx, alone, {
        let [p, q] = nearest;
        spheres(cx, p, radius_a, q, radius_b, beside, margin, out);
    });
    when!(cx, common, {
        for [p, q] in ends {
            spheres(cx, p, radius_a, q, radius_b, beside, margin, out);
        }
    });
}

/// Contact points of a capsule and a box: the sphere about the point of the axis nearest to the box, and those about the
/// ends of the part of the axis that lies over the face or edge which that sphere touches.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // a capsule, a box, and where points go
pub fn capsule_box<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    radius: C::F,
    half_height: C::F,
    b: &Placed<C::F>,
    half: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let axis = Axis {
        middle: (b.axes.transpose_mul(b.center) * c(-1.0)),
        along: b.axes.transpose_mul(axes_a[2]),
        half_height,
        radius,
    };
    let size = half[0] + half[1] + half[2] + half_height + radius;
    let nearest = nearest(&axis, half);
    let (distance, way) = leave_box(axis.at(nearest), half);
    let inside = distance.lt(size * c(INSIDE));
    let touches = (distance - radius).lt(margin);
    when!(cx, touches & !inside, {
        let (low, high) = over(&axis, way, half);
        let close = half_height * c(SAME);
        let at_low = (nearest - low).abs().lt(close);
        let at_high = !at_low & (high - nearest).abs().lt(close);
        let low = C::F::select(at_low, nearest, low);
        let high = C::F::select(at_high, nearest, high);
        let two = (low + close).lt(high);
        let low = C::F::select(two, low, nearest);
        let first = leave_box(axis.at(low), half).0;
        let second = leave_box(axis.at(high), half).0;
        let nearer =
            (distance + size * c(NEARER * <C::F as Num>::Real::EPSILON)).lt(first.min(second));
        let between = two & nearer;
        let all = two | !two;
        sphere(cx, &axis, low, half, b, all, margin, out);
        sphere(cx, &axis, high, half, b, two, margin, out);
        sphere(cx, &axis, nearest, half, b, between, margin, out);
    });
    when!(cx, inside, {
        pierced(cx, &axis, half, b, size * c(PREFER_FACES), margin, out);
    });
}

/// The axis of a capsule in the frame of a box.
struct Axis<F> {
    middle: Vec3<F>,
    along: Vec3<F>,
    half_height: F,
    radius: F,
}

impl<F: Num> Axis<F> {
    /// The point at a height.
    #[inline(always)]
    fn at(&self, height: F) -> Vec3<F> {
        self.along.scale_add(height, self.middle)
    }
}

/// The height of the axis where it is nearest to the box. The squared distance is convex in it and its derivative
/// piecewise linear, with bends where the axis crosses the planes of the faces: interpolated between the two about its root.
#[inline(always)]
fn nearest<F: Num>(axis: &Axis<F>, half: Vec3<F>) -> F {
    let zero = F::c(0.0);
    let (mut low, mut high) = (-axis.half_height, axis.half_height);
    let mut below = slope(axis, low, half);
    let mut above = slope(axis, high, half);
    let (lowest, highest) = (low, high);
    let starts = below.lt(zero);
    let ends = zero.lt(above);
    for k in 0..3 {
        let inverse = reciprocal(axis.along[k]);
        for face in [-half[k], half[k]] {
            let height = ((face - axis.middle[k]) * inverse).min(highest).max(lowest);
            let here = slope(axis, height, half);
            let falls = here.lt(zero);
            let up = falls & low.lt(height);
            low = F::select(up, height, low);
            below = F::select(up, here, below);
            let down = !falls & height.lt(high);
            high = F::select(down, height, high);
            above = F::select(down, here, above);
        }
    }
    let rise = above - below;
    let part = (-below).div(F::select(zero.lt(rise), rise, F::c(1.0)));
    let root = part.min(F::c(1.0)).max(zero).fma(high - low, low);
    F::select(starts, F::select(ends, root, highest), lowest)
}

/// Half the derivative of the squared distance from the box.
#[inline(always)]
fn slope<F: Num>(axis: &Axis<F>, height: F, half: Vec3<F>) -> F {
    let at = axis.at(height);
    axis.along.dot(at - clamped(at, half))
}

/// The part of the axis over the face or edge that a normal belongs to: between the planes of the faces beside it.
#[inline(always)]
fn over<F: Num>(axis: &Axis<F>, normal: Vec3<F>, half: Vec3<F>) -> (F, F) {
    let (mut low, mut high) = (-axis.half_height, axis.half_height);
    for k in 0..3 {
        let beside = normal[k].abs().lt(F::c(PARALLEL));
        let inverse = reciprocal(axis.along[k]);
        let middle = -(axis.middle[k] * inverse);
        // on the plane of a face counts as inside it
        let reach = (half[k].fma(F::c(ON_PLANE), half[k]) * inverse).abs();
        low = F::select(beside, low.max(middle - reach), low);
        high = F::select(beside, high.min(middle + reach), high);
    }
    let low = low.min(axis.half_height).max(-axis.half_height);
    (low, high.min(axis.half_height).max(low))
}

/// Adds the contact of a sphere of the capsule.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // where, against what, and where points go
fn sphere<C: Cx>(
    cx: &mut C,
    axis: &Axis<C::F>,
    height: C::F,
    half: Vec3<C::F>,
    b: &Placed<C::F>,
    mask: MaskOf<C>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let at = axis.at(height);
    let (distance, way) = leave_box(at, half);
    sphere_off_box(cx, axis.radius, at, distance, way, b, mask, margin, out);
}

/// Contact points where the axis is inside the box: along the separating axis of least depth, two if that is of a face.
#[inline(always)]
fn pierced<C: Cx>(
    cx: &mut C,
    axis: &Axis<C::F>,
    half: Vec3<C::F>,
    b: &Placed<C::F>,
    noise: C::F,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let (p, d, h) = (axis.middle, axis.along, axis.half_height);
    let (mut face, mut number) = (c(-1e9), zero);
    for k in 0..3 {
        let x = p[k].abs() - half[k] - h * d[k].abs();
        let better = face.lt(x);
        face = C::F::select(better, x, face);
        number = C::F::select(better, c(k as f64), number);
    }
    let (mut score, mut square, mut across) = (face, one, c(-1.0));
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let l = d[i].fma(d[i], d[j] * d[j]);
        let x = d[i].fnma(p[j], d[j] * p[i]).abs() - half[i].fma(d[j].abs(), half[j] * d[i].abs());
        let parallel = l.lt(c(PARALLEL_EDGE));
        let length = C::F::select(parallel, one, l).sqrt();
        let x = (x - noise).div(length);
        let better = !parallel & score.lt(x);
        score = C::F::select(better, x, score);
        square = C::F::select(better, l, square);
        across = C::F::select(better, c(k as f64), across);
    }
    let edge = c(-0.5).lt(across);
    when!(cx, !edge, {
        let side = sign(one_of_numbers(number, p));
        let way = Vec3([
            one_if(number, 0, side),
            one_if(number, 1, side),
            one_if(number, 2, side),
        ]);
        let (low, high) = over(axis, way, half);
        let two = (low + h * c(SAME)).lt(high);
        // of ends that close the deeper one
        let falls = way.dot(d).lt(zero);
        let (low, high) = (
            C::F::select(falls, high, low),
            C::F::select(falls, low, high),
        );
        for (height, mask) in [(low, two | !two), (high, two)] {
            let at = axis.at(height);
            let distance = way.dot(at) - one_of_numbers(number, half);
            sphere_off_box(cx, axis.radius, at, distance, way, b, mask, margin, out);
        }
    });
    when!(cx, edge, {
        let product = one_of(
            across,
            Mat3([
                Vec3([zero, d[2], -d[1]]),
                Vec3([-d[2], zero, d[0]]),
                Vec3([d[1], -d[0], zero]),
            ]),
        );
        let way = product * sign(product.dot(p)).div(square.sqrt());
        let mut corner = Vec3::zero();
        let mut flat = corner;
        for k in 0..3 {
            corner[k] = unless(across, k, sign(way[k]) * half[k]);
            flat[k] = unless(across, k, d[k]);
        }
        let to = flat.dot(corner - p).div(square);
        let at = axis.at(to.min(h).max(-h));
        let distance = way.dot(at - Vec3(corner.0));
        let all = edge | !edge;
        sphere_off_box(cx, axis.radius, at, distance, way, b, all, margin, out);
    });
}

/// `x` if `k` is that number, or 0.
#[inline(always)]
fn one_if<F: Num>(number: F, k: usize, x: F) -> F {
    x - unless(number, k, x)
}

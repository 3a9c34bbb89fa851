//! A capsule against capsule and box (MuJoCo: `mjc_CapsuleCapsule`, `mjc_CapsuleBox`).
//!
//! The capsule's centre is the origin, its axis is z of its frame. A contact point of a capsule is that of the sphere around
//! a point of its axis, so both functions look for points of the axis.

use super::capsule_box::two_point_capsule_box;
use super::spheres::{Ball, BoxExit, add_sphere_box, add_sphere_sphere};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::{
    clamp_to_box, column_at, component_at, only_at, reciprocal, sign, with_sign, zero_at,
};
use crate::step::collide::narrow::ShapePair;
use crate::when;

/// Sine below which the axes of two capsules are parallel: two points are given then (MuJoCo 3.17).
const PARALLEL_AXES: f64 = 1e-4;
/// Sine below which an axis is perpendicular to a normal: two points are given then, or one end would rock.
const PARALLEL: f64 = 0.01;
/// How much nearer, in roundings of the shapes' size, the nearest point must be than those of the ends to be a point of its
/// own.
const NEARER: f64 = 8.0;
/// An end that is nearer than this part of the half height to the nearest point is that point [–].
const SAME: f64 = 0.05;
/// Relative growth of a face where the axis is clipped to it.
const ON_PLANE: f64 = 1e-6;
/// The axis is inside a box if it is nearer than this to its surface, relative to the shapes' size.
const INSIDE: f64 = 1e-6;
/// How much a direction across an edge must exceed one across a face, before division by its length, relative to the
/// shapes' size.
const PREFER_FACES: f64 = 4e-7;
/// Squared sine below which the axis is parallel to an edge.
const PARALLEL_EDGE: f64 = 1e-8;

/// Two capsules: the spheres around the closest points of their axes (Ericson 2005, section 5.1.9), or, where the axes are
/// parallel, around the ends of their overlap. Without an overlap both ends are the same.
#[inline(always)]
pub fn capsule_capsule<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let c = C::F::c;
    let one = c(1.0);
    let (axes_a, b) = (pair.axes_a, pair.pose_b);
    let (half_height_a, half_height_b) = (pair.a.half_height(), pair.b.half_height());
    let (a, d, center) = (axes_a[2], b.axes[2], b.center);
    // c along both axes, and their common perpendicular a × d
    let (along_a, along_b) = (a.dot(center), d.dot(center));
    let cosine = a.dot(d);
    let product = a.cross(d);
    let square = product.dot(product);
    let parallel = square.lt(c(PARALLEL_AXES * PARALLEL_AXES));
    when!(cx, !parallel, {
        // closest points of the lines, clamped to the segments one after the other
        let square = C::F::select(parallel, one, square);
        let free = center.cross(d).dot(product).div(square);
        let x = free.min(half_height_a).max(-half_height_a);
        let y = clamped_height(cosine, x, -along_b, half_height_b);
        let x = clamped_height(cosine, y, along_a, half_height_a);
        add_balls(cx, pair, [a * x, d.scale_add(y, center)], out);
    });
    when!(cx, parallel, {
        // each end of the overlap is an end of one axis, and the nearest point of the other; B reaches h |cos| along A
        let reach = half_height_b * cosine.abs();
        for side in [-1.0, 1.0] {
            let end_b = c(side).fma(reach, along_a);
            // the end of B if it lies beside A, else the end of A on that side
            let of_b = end_b.abs().lt(half_height_a);
            let end_a = end_b.min(half_height_a).max(-half_height_a);
            let y = clamped_height(cosine, end_a, -along_b, half_height_b);
            let y = C::F::select(of_b, with_sign(half_height_b, cosine * c(side)), y);
            let x = clamped_height(cosine, y, along_a, half_height_a);
            let x = C::F::select(of_b, x, end_a);
            add_balls(cx, pair, [a * x, d.scale_add(y, center)], out);
        }
    });
}

/// cosine × at + offset, clamped to a segment: the point of one line that is nearest to a point of the other.
#[inline(always)]
fn clamped_height<F: Num>(cosine: F, at: F, offset: F, half_height: F) -> F {
    cosine.fma(at, offset).min(half_height).max(-half_height)
}

/// Adds the contact of the spheres around a point of each axis.
#[inline(always)]
fn add_balls<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    [p, q]: [Vec3<C::F>; 2],
    out: &mut Points<C>,
) {
    let a = Ball {
        center: p,
        radius: pair.a.radius(),
    };
    let b = Ball {
        center: q,
        radius: pair.b.radius(),
    };
    add_sphere_sphere(cx, pair, &a, &b, out);
}

/// Capsule and box, unless the points of [`super::capsule_box`] are wanted: the sphere around the point of the axis that is
/// nearest to the box, and those around the ends of the part of the axis over the face or edge which that sphere touches.
#[inline(always)]
pub fn capsule_box<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let c = C::F::c;
    let (b, half) = (pair.pose_b, pair.b.half_extents());
    let (radius, half_height) = (pair.a.radius(), pair.a.half_height());
    // the axis in the frame of the box
    let axis = CapsuleAxis {
        middle: (b.axes.transpose_mul(b.center) * c(-1.0)),
        along: b.axes.transpose_mul(pair.axes_a[2]),
        half_height,
    };
    if pair.two_point_capsule_boxes {
        return two_point_capsule_box(cx, pair, &axis, out);
    }
    // the sphere at the nearest point decides whether they touch, and over which face or edge
    let size = half[0] + half[1] + half[2] + half_height + radius;
    let nearest = axis.nearest_to_box(half);
    let exit = BoxExit::find(axis.at(nearest), half);
    let inside = exit.distance.lt(size * c(INSIDE));
    let touches = (exit.distance - radius).lt(pair.margin);
    when!(cx, touches & !inside, {
        let (low, high) = axis.clip_over(exit.direction, half);
        // ends that are the nearest point, up to rounding, are that point
        let close = half_height * c(SAME);
        let at_low = (nearest - low).abs().lt(close);
        let at_high = !at_low & (high - nearest).abs().lt(close);
        let low = C::F::select(at_low, nearest, low);
        let high = C::F::select(at_high, nearest, high);
        // ends that are close together make one point, the nearest
        let two = (low + close).lt(high);
        let low = C::F::select(two, low, nearest);
        // a nearest point between both ends, and nearer than they are, is a third one
        let first = BoxExit::find(axis.at(low), half).distance;
        let second = BoxExit::find(axis.at(high), half).distance;
        let nearer =
            (exit.distance + size * c(NEARER * <C::F as Num>::Real::EPSILON)).lt(first.min(second));
        let between = two & nearer;
        let all = two | !two;
        add_ball_at(cx, pair, &axis, low, all, out);
        add_ball_at(cx, pair, &axis, high, two, out);
        add_ball_at(cx, pair, &axis, nearest, between, out);
    });
    when!(cx, inside, {
        capsule_in_box(cx, pair, &axis, size * c(PREFER_FACES), out);
    });
}

/// Adds the contact of the sphere around a point of the axis.
#[inline(always)]
pub(in crate::step::collide) fn add_ball_at<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    axis: &CapsuleAxis<C::F>,
    height: C::F,
    mask: MaskOf<C>,
    out: &mut Points<C>,
) {
    let at = axis.at(height);
    let exit = BoxExit::find(at, pair.b.half_extents());
    add_sphere_box(cx, pair, mask, at, &exit, out);
}

/// The axis of a capsule in the frame of a box.
pub(in crate::step::collide) struct CapsuleAxis<F> {
    /// Its middle [m].
    pub middle: Vec3<F>,
    /// Its direction [–].
    pub along: Vec3<F>,
    /// Half its length [m].
    pub half_height: F,
}

impl<F: Num> CapsuleAxis<F> {
    /// The point at a height.
    #[inline(always)]
    fn at(&self, height: F) -> Vec3<F> {
        self.along.scale_add(height, self.middle)
    }

    /// The height where the axis is nearest to the box.
    ///
    /// The squared distance is convex along the axis. Its derivative is piecewise linear and bends where the axis crosses
    /// the planes of the faces: the root lies between the two bends around it.
    #[inline(always)]
    fn nearest_to_box(&self, half: Vec3<F>) -> F {
        let zero = F::c(0.0);
        // the bracket of the root, and the derivative at its ends
        let (mut low, mut high) = (-self.half_height, self.half_height);
        let mut below = self.slope(low, half);
        let mut above = self.slope(high, half);
        let (lowest, highest) = (low, high);
        let starts = below.lt(zero);
        let ends = zero.lt(above);
        for k in 0..3 {
            // each bend between the ends becomes a bound of the bracket, lower where the distance still falls
            let inverse = reciprocal(self.along[k]);
            for face in [-half[k], half[k]] {
                let height = ((face - self.middle[k]) * inverse).min(highest).max(lowest);
                let here = self.slope(height, half);
                let falls = here.lt(zero);
                let up = falls & low.lt(height);
                low = F::select(up, height, low);
                below = F::select(up, here, below);
                let down = !falls & height.lt(high);
                high = F::select(down, height, high);
                above = F::select(down, here, above);
            }
        }
        // linear between two bends: the secant meets the root; without a change of sign an end is nearest
        let rise = above - below;
        let part = (-below).div(F::select(zero.lt(rise), rise, F::c(1.0)));
        let root = part.min(F::c(1.0)).max(zero).fma(high - low, low);
        F::select(starts, F::select(ends, root, highest), lowest)
    }

    /// Half the derivative of the squared distance from the box.
    #[inline(always)]
    fn slope(&self, height: F, half: Vec3<F>) -> F {
        let at = self.at(height);
        self.along.dot(at - clamp_to_box(at, half))
    }

    /// The part of the axis over the face or edge with this normal: between the planes of the neighbouring faces.
    #[inline(always)]
    fn clip_over(&self, normal: Vec3<F>, half: Vec3<F>) -> (F, F) {
        let (mut low, mut high) = (-self.half_height, self.half_height);
        for k in 0..3 {
            // only faces that the normal is across bound the part: |p + t d| ≤ half
            let beside = normal[k].abs().lt(F::c(PARALLEL));
            let inverse = reciprocal(self.along[k]);
            let middle = -(self.middle[k] * inverse);
            // on the plane of a face counts as inside it
            let reach = (half[k].fma(F::c(ON_PLANE), half[k]) * inverse).abs();
            low = F::select(beside, low.max(middle - reach), low);
            high = F::select(beside, high.min(middle + reach), high);
        }
        // both within the axis, in order, also where no part is left
        let low = low.min(self.half_height).max(-self.half_height);
        (low, high.min(self.half_height).max(low))
    }
}

/// Contact points where the axis is inside the box: along the separating axis of least depth (Gottschalk, Lin and Manocha
/// 1996), two if that is the normal of a face.
#[inline(always)]
fn capsule_in_box<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    axis: &CapsuleAxis<C::F>,
    noise: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let half = pair.b.half_extents();
    let (p, d, h) = (axis.middle, axis.along, axis.half_height);
    // face axes: |p · eₖ| - hₖ - h |d · eₖ|
    let (mut face, mut index) = (c(-1e9), c(0.0));
    for k in 0..3 {
        let x = p[k].abs() - half[k] - h * d[k].abs();
        let better = face.lt(x);
        face = C::F::select(better, x, face);
        index = C::F::select(better, c(k as f64), index);
    }
    // edge axes d × eₖ, by separation over length
    let (mut score, mut square, mut across) = (face, c(1.0), c(-1.0));
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        // |p · (d × eₖ)| less the half width of the box; the axis itself has none across d
        let l = d[i].fma(d[i], d[j] * d[j]);
        let x = d[i].fnma(p[j], d[j] * p[i]).abs() - half[i].fma(d[j].abs(), half[j] * d[i].abs());
        let parallel = l.lt(c(PARALLEL_EDGE));
        // faces are preferred by the noise, before division by the length
        let length = C::F::select(parallel, c(1.0), l).sqrt();
        let x = (x - noise).div(length);
        let better = !parallel & score.lt(x);
        score = C::F::select(better, x, score);
        square = C::F::select(better, l, square);
        across = C::F::select(better, c(k as f64), across);
    }
    let edge = c(-0.5).lt(across);
    when!(cx, !edge, {
        leave_through_face(cx, pair, axis, index, out);
    });
    when!(cx, edge, {
        leave_over_edge(cx, pair, axis, [across, square], edge, out);
    });
}

/// Contact points of an axis inside the box that leaves through the face with this index: the ends of its part over it.
#[inline(always)]
fn leave_through_face<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    axis: &CapsuleAxis<C::F>,
    index: C::F,
    out: &mut Points<C>,
) {
    let (c, half) = (C::F::c, pair.b.half_extents());
    // the outward normal of the face, and the part of the axis over it
    let side = sign(component_at(index, axis.middle));
    let direction = Vec3([
        only_at(index, 0, side),
        only_at(index, 1, side),
        only_at(index, 2, side),
    ]);
    let (low, high) = axis.clip_over(direction, half);
    let two = (low + axis.half_height * c(SAME)).lt(high);
    // of ends that are close together the deeper one
    let falls = direction.dot(axis.along).lt(c(0.0));
    let (low, high) = (
        C::F::select(falls, high, low),
        C::F::select(falls, low, high),
    );
    for (height, mask) in [(low, two | !two), (high, two)] {
        // the ball leaves along the normal of the face, also where another face is nearer
        let at = axis.at(height);
        let distance = direction.dot(at) - component_at(index, half);
        let exit = BoxExit {
            distance,
            direction,
        };
        add_sphere_box(cx, pair, mask, at, &exit, out);
    }
}

/// Contact point of an axis inside the box that leaves over an edge along axis `across`; `square` is the squared length of
/// d × that axis.
#[inline(always)]
fn leave_over_edge<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    axis: &CapsuleAxis<C::F>,
    [across, square]: [C::F; 2],
    edge: MaskOf<C>,
    out: &mut Points<C>,
) {
    let (zero, half) = (C::F::c(0.0), pair.b.half_extents());
    let (p, d, h) = (axis.middle, axis.along, axis.half_height);
    // d × eₖ, of length 1, from the centre of the box to the axis
    let product = column_at(
        across,
        Mat3([
            Vec3([zero, d[2], -d[1]]),
            Vec3([-d[2], zero, d[0]]),
            Vec3([d[1], -d[0], zero]),
        ]),
    );
    let direction = product * sign(product.dot(p)).div(square.sqrt());
    // the edge, and the axis seen along it
    let mut corner = Vec3::zero();
    let mut flat = corner;
    for k in 0..3 {
        corner[k] = zero_at(across, k, sign(direction[k]) * half[k]);
        flat[k] = zero_at(across, k, d[k]);
    }
    // where the axis is nearest to the edge, and how far it is from there along the direction
    let to = flat.dot(corner - p).div(square);
    let at = axis.at(to.min(h).max(-h));
    let distance = direction.dot(at - corner);
    let exit = BoxExit {
        distance,
        direction,
    };
    let all = edge | !edge;
    add_sphere_box(cx, pair, all, at, &exit, out);
}

//! A capsule against a box with the points that MuJoCo gives (`mjraw_CapsuleBox`); [`super::capsules`] has ours.
//!
//! The nearest point of the axis is the first point. It is an end over a face or inside the box, or the point nearest to
//! an edge. Where that edge point is the edge's end, the feature is a corner. The second point lies on the axis, at most as
//! far as the axis is above the box:
//!
//! | Nearest feature | Second point |
//! |---|---|
//! | face | where the axis leaves the space above the face, or its other end |
//! | edge | the same, if the axis lies above exactly one of the faces beside the edge |
//! | corner | the same along the edge or over the face that the axis is nearest to |
//! | inside | none |
//!
//! Each point is then the contact of a sphere around it. MuJoCo's rule has these faults:
//!
//! - An axis that lies exactly flat across a box has one point, where it crosses the first edge.
//! - Where an end is nearest to an edge or a corner, both points may be the same.
//! - An axis inside a box leaves at its end, and one that pierces it leaves along itself. Neither is the short way out.
//!
//! In single precision a component of the axis below its rounding does not choose: a capsule that lies flat has two points.

use super::capsules::{CapsuleAxis, add_ball_at};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::{
    clamp_to_box, component_at, largest_axis, min_component, reciprocal, sign, zero_at,
};
use crate::step::collide::narrow::ShapePair;

/// An edge must be nearer by this to count before a face or an edge before it (MuJoCo: `mjMINVAL`) [m²].
const NEARER: f64 = 1e-15;
/// Edges are parallel to the axis below this product of squared lengths and squared sine (MuJoCo: `mjMINVAL`) [m⁴].
const PARALLEL: f64 = 1e-15;
/// Roundings of a component of the axis in single precision [–].
const ROUNDINGS: f64 = 8.0;
/// No limit: the axis is 2 long.
const FAR: f64 = 1e9;
/// Epsilons above this are those of single precision.
const SINGLE: f64 = 1e-10;

/// Kinds of features.
const END: f64 = 0.0;
const EDGE: f64 = 1.0;
const CORNER: f64 = 2.0;

/// The feature of a box that is nearest to an axis.
struct Nearest<F> {
    /// Squared distance [m²].
    square: F,
    /// Where the axis is nearest, from -1 to 1.
    height: F,
    /// `END`, `EDGE` or `CORNER`.
    kind: F,
    /// Of an end, the axis across its face, or -1 inside; of others, the axis along the edge.
    index: F,
    /// Of an edge or corner, on which side of the centre it is.
    side: Vec3<F>,
    /// Of an edge, where along it [m].
    along: F,
}

impl<F: Num> Nearest<F> {
    /// Takes another feature in the worlds of the mask.
    #[inline(always)]
    fn take(&mut self, better: F::Mask, other: Nearest<F>) {
        self.square = F::select(better, other.square, self.square);
        self.height = F::select(better, other.height, self.height);
        self.kind = F::select(better, other.kind, self.kind);
        self.index = F::select(better, other.index, self.index);
        self.side = select(better, other.side, self.side);
        self.along = F::select(better, other.along, self.along);
    }
}

/// Half the axis of a capsule, from its middle to its upper end, and half extents of the box in whose frame it is [m].
struct Beside<F> {
    middle: Vec3<F>,
    rise: Vec3<F>,
    half: Vec3<F>,
}

/// Capsule and box: at most two points, those of MuJoCo.
#[inline(always)]
pub(in crate::step::collide) fn two_point_capsule_box<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    axis: &CapsuleAxis<C::F>,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (half, radius) = (pair.b.half_extents(), pair.a.radius());
    let beside = Beside {
        middle: axis.middle,
        rise: axis.along * axis.half_height,
        half,
    };
    // rounding of squared distances where the surfaces touch, at about the radius
    let size = half[0] + half[1] + half[2] + axis.half_height + radius;
    let rounding = size * radius * c(4.0 * <C::F as Num>::Real::EPSILON);
    // the nearest feature: an end over a face or inside, or an edge or corner that is nearer
    let mut nearest = beside.nearest_end();
    beside.add_edges(&mut nearest, c(NEARER).max(rounding));
    // the way to the second point from either kind of feature: worlds differ, so both are computed
    let is_end = nearest.kind.lt(c(0.5));
    let (from_end, of_end) = beside.way_from_end(&nearest);
    let (from_edge, of_edge) = beside.way_from_edge(&nearest);
    let exists = (is_end & of_end) | (!is_end & of_edge);
    let way = C::F::select(is_end, from_end, from_edge);
    // from parts of the half axis to heights along it [m]
    let first = nearest.height * axis.half_height;
    let second = (nearest.height + way) * axis.half_height;
    // an axis through the box may be farther from each edge than the radius, so each sphere decides by itself
    let all = is_end | !is_end;
    add_ball_at(cx, pair, axis, first, all, out);
    add_ball_at(cx, pair, axis, second, exists, out);
}

impl<F: Num> Beside<F> {
    /// The end that is nearest of those over a face or inside the box.
    #[inline(always)]
    fn nearest_end(&self) -> Nearest<F> {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let mut nearest = Nearest {
            square: F::c(FAR),
            height: zero,
            kind: F::c(END),
            index: -one,
            side: Vec3::zero(),
            along: zero,
        };
        for end in [-1.0, 1.0] {
            let at = self.rise.scale_add(F::c(end), self.middle);
            let apart = at - clamp_to_box(at, self.half);
            // beyond no face an end is inside, beyond one over that face, beyond more nearest to an edge or corner
            let (mut planes, mut face) = (zero, -one);
            for k in 0..3 {
                let beyond = self.half[k].lt(at[k].abs());
                planes = planes + F::select(beyond, one, zero);
                face = F::select(beyond, F::c(k as f64), face);
            }
            // only ends inside or over a face count here
            let square = apart.dot(apart);
            let better = planes.lt(F::c(1.5)) & square.lt(nearest.square);
            let other = Nearest {
                square,
                height: F::c(end),
                kind: F::c(END),
                index: face,
                side: Vec3::zero(),
                along: zero,
            };
            nearest.take(better, other);
        }
        nearest
    }

    /// Takes the nearest of the twelve edges where it is nearer by more than a rounding.
    ///
    /// The closest points of two lines, clamped to the edge, then to the axis, then to the edge (Ericson 2005, section
    /// 5.1.9). Seen along the edge, the axis is nearest where it is nearest to a point.
    #[inline(always)]
    fn add_edges(&self, nearest: &mut Nearest<F>, rounding: F) {
        let one = F::c(1.0);
        let (p, h, half) = (self.middle, self.rise, self.half);
        let inverse_square = one.div(h.dot(h));
        for j in 0..3 {
            // of the other two axes the lower changes first, so that of equals MuJoCo's is taken
            let (u, v) = [(1, 2), (0, 2), (0, 1)][j];
            // squared length of half the axis across the edge. An axis along the edge is nearest to other features
            let across = h[u].fma(h[u], h[v] * h[v]);
            let crosses = !(half[j] * half[j] * across).lt(F::c(PARALLEL));
            let inverse = one.div(F::select(crosses, across, one));
            for (side_v, side_u) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let (side_u, side_v) = (F::c(side_u), F::c(side_v));
                // seen along the edge: t = d · h / |h|², with d from the middle of the axis to the edge
                let (du, dv) = (side_u.fma(half[u], -p[u]), side_v.fma(half[v], -p[v]));
                let product = du.fma(h[u], dv * h[v]);
                let height = product * inverse;
                // past the end of the edge the corner counts, with the height where the axis is nearest to it
                let free = height.fma(h[j], p[j]);
                let past = half[j].lt(free.abs());
                let on_edge = free.min(half[j]).max(-half[j]);
                let of_corner = (on_edge - p[j]).fma(h[j], product) * inverse_square;
                let height = F::select(past, of_corner, height);
                // past an end of the axis that end counts, with its nearest place on the edge
                let beyond = one.lt(height.abs());
                let height = height.min(one).max(-one);
                let of_end = height.fma(h[j], p[j]);
                let past_again = beyond & half[j].lt(of_end.abs());
                let along = F::select(beyond, of_end.min(half[j]).max(-half[j]), on_edge);
                let corner = past | past_again;
                // the edge or corner by its side of the centre along each axis
                let mut side = Vec3::zero();
                side[u] = side_u;
                side[v] = side_v;
                side[j] = sign(F::select(past_again, of_end, free));
                // squared distance; an edge must be nearer than the features before it by more than rounding
                let gap = [
                    height.fnma(h[u], du),
                    height.fnma(h[v], dv),
                    height.fnma(h[j], along - p[j]),
                ];
                let square = gap[0].fma(gap[0], gap[1].fma(gap[1], gap[2] * gap[2]));
                let better = crosses & square.lt(nearest.square - rounding);
                let other = Nearest {
                    square,
                    height,
                    kind: F::select(corner, F::c(CORNER), F::c(EDGE)),
                    index: F::c(j as f64),
                    side,
                    along,
                };
                nearest.take(better, other);
            }
        }
    }

    /// How far the axis stays over the face that its end is nearest to, and whether there is one.
    #[inline(always)]
    fn way_from_end(&self, nearest: &Nearest<F>) -> (F, F::Mask) {
        let (zero, far) = (F::c(0.0), F::c(FAR));
        // from this end towards the other one, 2 half axes away
        let back = -nearest.height;
        let at = self.rise.scale_add(nearest.height, self.middle);
        let mut way = F::c(2.0);
        for k in 0..3 {
            // the part of the way to the plane of a face beside, which the axis heads for; the first plane ends it
            let step = self.rise[k] * back;
            let to = (sign(step) * self.half[k] - at[k]) * reciprocal(step);
            let is_face = (nearest.index - F::c(k as f64)).abs().lt(F::c(0.5));
            let counts = !is_face & zero.lt(to);
            way = way.min(F::select(counts, to, far));
        }
        (way * back, F::c(-0.5).lt(nearest.index))
    }

    /// How far the axis stays above the box from an edge or a corner, and whether it does.
    #[inline(always)]
    fn way_from_edge(&self, nearest: &Nearest<F>) -> (F, F::Mask) {
        let (zero, one, two) = (F::c(0.0), F::c(1.0), F::c(2.0));
        let (h, half) = (self.rise, self.half);
        let is_edge = nearest.kind.lt(F::c(1.5));
        // along an edge nothing is beside it
        let across = F::select(is_edge, nearest.index, -one);
        let mut beside = Vec3::zero();
        let mut inward = Vec3::zero();
        let mut widths = Vec3::zero();
        for k in 0..3 {
            // how far half the axis runs along k, and the part of it that crosses half the box
            beside[k] = zero_at(across, k, h[k].abs());
            widths[k] = half[k] * reciprocal(h[k]).abs();
            // 1 where the upper half of the axis leads from this side over the box
            let up = F::select(zero.lt(h[k]), one, -one);
            let leaves = (up * nearest.side[k]).lt(zero);
            inward[k] = zero_at(across, k, F::select(leaves, one, zero));
        }
        // the component in which the axis runs fastest decides which way is over the box
        let longest = largest_axis(beside);
        let main = component_at(longest, inward);
        if <F::Real as Real>::EPSILON > SINGLE {
            // what is rounding lets the axis lie flat
            let noise = h.dot(h).sqrt() * F::c(ROUNDINGS * <F::Real as Real>::EPSILON);
            for k in 0..3 {
                let flat = zero_at(across, k, one - main);
                inward[k] = F::select(h[k].abs().lt(noise), flat, inward[k]);
            }
        }
        // where all lead alike, the axis passes the feature; over an edge exactly one leads over the box
        let count = inward[0] + inward[1] + inward[2];
        let single = count.lt(F::c(1.5));
        let exists = F::c(0.5).lt(count) & count.lt(F::c(2.5));

        // over an edge: towards the face that the axis is above, and no farther than that face reaches
        let up = F::select(F::c(0.5).lt(main), one, -one);
        // to the end of the edge that this way heads for
        let slope = component_at(nearest.index, h);
        let rises = F::select(zero.lt(slope), one, -one) * up;
        let edge_half = component_at(nearest.index, half);
        let to_end = rises.fnma(nearest.along, edge_half) * reciprocal(slope).abs();
        // the way ends at the end of the axis, past the face, or at the end of the edge
        let width = two * component_at(longest, widths);
        let from_edge = up * up.fnma(nearest.height, one).min(width).min(to_end);

        // over a corner: the odd axis is that whose side is unlike those of both others
        let mut others = widths;
        let mut odd = zero;
        for k in 0..3 {
            let is_odd = F::select(single, inward[k], one - inward[k]);
            odd = is_odd.fma(F::c(k as f64), odd);
            others[k] = F::select(F::c(0.5).lt(is_odd), F::c(FAR), widths[k]);
        }
        let up = F::select(single, one, -one);
        // steeper than 45° along the odd axis: along that edge; else over the face across it
        let steep = component_at(odd, h);
        let along_edge = h.dot(h).lt(two * steep * steep);
        let (_, width) = min_component(others);
        let width = two * F::select(along_edge, component_at(odd, widths), width);
        let up = F::select(along_edge, up, -up);
        let from_corner = up * up.fnma(nearest.height, one).min(width);

        (
            F::select(is_edge, from_edge, from_corner),
            exists & (!is_edge | single),
        )
    }
}

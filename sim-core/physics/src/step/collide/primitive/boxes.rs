//! Box against box: separating axes (Gottschalk, Lin and Manocha 1996), then a face of each clipped by the other (MuJoCo:
//! `mjc_BoxBox`).
//!
//! ```text
//! separation along l = |l·c| - Σ hₐ|l·aᵢ| - Σ h_b|l·bⱼ|,   l ∈ {aᵢ, bⱼ, aᵢ × bⱼ}/|·|;   the largest is kept
//! ```
//!
//! - Face axis: that face is the reference, and the most opposite face of the other box is clipped to its rectangle.
//! - Edge axis: one point, between the edges. A face is kept where it is nearly as good and nearly the same axis
//!   ([`SAME_AXIS`], [`LITTLE`]).
//!
//! Boxes apart whose faces share no area have no point, although a vertex may be within the margin.

use super::box_faces::FacePair;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::{column_at, component_at, sign, transpose, zero_at};
use crate::step::collide::narrow::ShapePair;
use crate::when;

/// How much the separation along a face of B must exceed that along the faces of A, in roundings of the boxes' size: the
/// reference face must not switch between parallel faces.
const PREFER_FIRST: f64 = 4.0;
/// The same for edges against faces, before division by the length of the axis: noise grows as edges become parallel.
const PREFER_FACES: f64 = 4.0;
/// Sine, in roundings, below which edges are parallel.
const PARALLEL: f64 = 840.0;
/// Cosine between an edge axis and the face axis above which they count as one: a face is kept if it is nearly as good, or one
/// point in place of several would let the box rock (MuJoCo 3.17).
const SAME_AXIS: f64 = 0.99;
/// Part of the face's separation by which that of an edge must exceed it then.
const LITTLE: f64 = 0.05;
/// The same absolutely [m], for faces that just touch.
const LEAST: f64 = 1e-15;

/// The axis of largest separation.
pub struct BoxAxis<F: Num> {
    /// Cosines between the axes: `cosines[i][j]` = aᵢ · bⱼ.
    pub cosines: Mat3<F>,
    /// Centre of B in the axes of A, and in its own.
    pub center: [Vec3<F>; 2],
    /// The best face axis is one of B.
    pub of_b: F::Mask,
    /// Its index among the axes of that box.
    pub index: F,
    /// An edge axis is better.
    pub edge: F::Mask,
    /// The axes of A and B that the edge axis is across.
    pub pair: [F; 2],
    /// Its unit vector towards B, in the axes of A.
    pub product: Vec3<F>,
    /// One over the length of its cross product.
    pub inverse: F,
}

/// Sum of the half extents, which tolerances are relative to [m].
#[inline(always)]
fn size<F: Num>(a: Vec3<F>, b: Vec3<F>) -> F {
    (a[0] + a[1] + a[2]) + (b[0] + b[1] + b[2])
}

/// Two boxes: up to eight points of two faces, or one point of two edges.
#[inline(always)]
pub fn box_box<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (half_a, half_b, margin) = (pair.a.half_extents(), pair.b.half_extents(), pair.margin);
    let faces = FaceAxis::find(pair);
    // boxes apart along a face axis end here, before the nine edge axes
    when!(cx, !margin.lt(faces.separation), {
        let edge = EdgeAxis::find(&faces, half_a, half_b);
        // separation × √square against the margin, both squared
        let far = (margin * margin * edge.square).lt(edge.score);
        when!(cx, !far, {
            // faces make up to eight points, edges one; worlds of a block may need either
            let best = best_axis(&faces, &edge, half_a, half_b);
            when!(cx, !best.edge, {
                let faces = FacePair::from_axis(pair, &best);
                faces.add_clipped(cx, margin, pair.ordered_corners, out);
            });
            when!(cx, best.edge, {
                add_edge_contact(cx, pair, &best, out);
            });
        });
    });
}

/// The face axis of largest separation.
struct FaceAxis<F> {
    cosines: Mat3<F>,
    /// Absolute values of the cosines.
    widths: Mat3<F>,
    /// Centre of B in the axes of A, and in its own.
    center: [Vec3<F>; 2],
    separation: F,
    /// Its index: the axes of A, then those of B.
    code: F,
}

impl<F: Num> FaceAxis<F> {
    /// Finds it: the first of A's, unless one of B's is larger by more than rounding.
    #[inline(always)]
    fn find<C: Cx<F = F>>(pair: &ShapePair<'_, C>) -> FaceAxis<F> {
        let c = F::c;
        let (axes_a, b) = (pair.axes_a, pair.pose_b);
        let (half_a, half_b) = (pair.a.half_extents(), pair.b.half_extents());
        // aᵢ · bⱼ and |aᵢ · bⱼ|
        let mut cosines = Mat3::zero();
        let mut widths = cosines;
        for i in 0..3 {
            for j in 0..3 {
                cosines[i][j] = axes_a[i].dot(b.axes[j]);
                widths[i][j] = cosines[i][j].abs();
            }
        }
        // c in the axes of both boxes
        let in_a = axes_a.transpose_mul(b.center);
        let in_b = b.axes.transpose_mul(b.center);
        // faces of A: |c · aᵢ| - hₐᵢ - Σ h_b |aᵢ · bⱼ|; of equals the first is kept
        let (mut first, mut code) = (c(-1e9), c(0.0));
        for i in 0..3 {
            let x = in_a[i].abs() - half_a[i] - half_b.dot(widths[i]);
            let better = first.lt(x);
            first = F::select(better, x, first);
            code = F::select(better, c(i as f64), code);
        }
        // faces of B: |c · bⱼ| - h_bⱼ - Σ hₐ |aᵢ · bⱼ|
        let (mut second, mut code_b) = (c(-1e9), c(0.0));
        for j in 0..3 {
            let x = in_b[j].abs()
                - half_b[j]
                - half_a.dot(Vec3([widths[0][j], widths[1][j], widths[2][j]]));
            let better = second.lt(x);
            second = F::select(better, x, second);
            code_b = F::select(better, c(3.0 + j as f64), code_b);
        }
        // of parallel faces rounding would choose, so B must win by more than that
        let noise = size(half_a, half_b) * c(PREFER_FIRST * F::Real::EPSILON);
        let better = (first + noise).lt(second);
        FaceAxis {
            cosines,
            widths,
            center: [in_a, in_b],
            separation: F::select(better, second, first),
            code: F::select(better, code_b, code),
        }
    }
}

/// The edge axis of largest separation, if it exceeds that of the faces.
struct EdgeAxis<F> {
    /// Index 3 i + j of aᵢ × bⱼ, or -1.
    code: F,
    /// x|x| where x is the separation times the length of the axis.
    score: F,
    /// The axis' squared length.
    square: F,
}

impl<F: Num> EdgeAxis<F> {
    /// Finds it.
    #[inline(always)]
    fn find(faces: &FaceAxis<F>, half_a: Vec3<F>, half_b: Vec3<F>) -> EdgeAxis<F> {
        let c = F::c;
        let (cosines, widths, in_a) = (&faces.cosines, &faces.widths, faces.center[0]);
        // separation x over length √l is compared by x|x| l' > x'|x'| l
        let mut score = faces.separation * faces.separation.abs();
        let (mut square, mut code) = (c(1.0), c(-1.0));
        let noise = size(half_a, half_b) * c(PREFER_FACES * F::Real::EPSILON);
        let parallel = PARALLEL * F::Real::EPSILON;
        for i in 0..3 {
            let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
            for j in 0..3 {
                let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
                // |aᵢ × bⱼ|² from the other two cosines: 1 - (aᵢ · bⱼ)² would cancel
                let l = cosines[i1][j].fma(cosines[i1][j], cosines[i2][j] * cosines[i2][j]);
                // |c · (aᵢ × bⱼ)| in the axes of A
                let between = in_a[i1]
                    .fnma(cosines[i2][j], in_a[i2] * cosines[i1][j])
                    .abs();
                // half widths of both boxes along it, and noise in favour of faces
                let of_a = half_a[i1].fma(widths[i2][j], half_a[i2].fma(widths[i1][j], noise));
                let of_b = half_b[j1].fma(widths[i][j2], half_b[j2].fma(widths[i][j1], of_a));
                // x|x| keeps the sign, so separations compare without a root; parallel edges have no axis
                let x = between - of_b;
                let here = x * x.abs();
                let better = c(parallel * parallel).lt(l) & (score * l).lt(here * square);
                score = F::select(better, here, score);
                square = F::select(better, l, square);
                code = F::select(better, c((3 * i + j) as f64), code);
            }
        }
        EdgeAxis {
            code,
            score,
            square,
        }
    }
}

/// The better of the best face and edge axes.
#[inline(always)]
fn best_axis<F: Num>(
    faces: &FaceAxis<F>,
    edge: &EdgeAxis<F>,
    half_a: Vec3<F>,
    half_b: Vec3<F>,
) -> BoxAxis<F> {
    let c = F::c;
    let cosines = faces.cosines;
    let columns = transpose(&cosines);
    let inverse = c(1.0).div(edge.square.sqrt());
    // what the search took off for noise is added again
    let root = edge.score.abs().sqrt();
    let less = F::select(edge.score.lt(c(0.0)), -root, root);
    let noise = size(half_a, half_b) * c(PREFER_FACES * F::Real::EPSILON);
    let separation = (less + noise) * inverse;
    // i and j of 3 i + j
    let first = F::select(
        c(5.5).lt(edge.code),
        c(2.0),
        F::select(c(2.5).lt(edge.code), c(1.0), c(0.0)),
    );
    let pair = [first, c(3.0).fnma(first, edge.code)];
    // aᵢ × bⱼ in the axes of A
    let column = column_at(pair[1], columns);
    let product = column_at(
        first,
        Mat3([
            Vec3([c(0.0), -column[2], column[1]]),
            Vec3([column[2], c(0.0), -column[0]]),
            Vec3([-column[1], column[0], c(0.0)]),
        ]),
    );
    // of length 1, towards the centre of B
    let product = product * (inverse * sign(product.dot(faces.center[0])));
    // cosine between edge axis and face axis: bⱼ in the axes of A is a row of cosines
    let of_b = c(2.5).lt(faces.code);
    let index = faces.code - F::select(of_b, c(3.0), c(0.0));
    let facing = column_at(index, columns);
    let along_face = F::select(of_b, product.dot(facing), component_at(index, product));
    // an edge axis that is nearly the face axis must be better by more than a little (MuJoCo 3.17)
    let same = c(SAME_AXIS).lt(along_face.abs());
    let least = faces.separation.abs().fma(c(LITTLE), c(LEAST));
    let little = separation.lt(faces.separation + least);
    let is_edge = c(-0.5).lt(edge.code) & !(same & little);
    BoxAxis {
        cosines,
        center: faces.center,
        of_b,
        index,
        edge: is_edge,
        pair,
        product,
        inverse,
    }
}

/// Adds the contact of the edges of an edge axis: half-way between their closest points (Ericson 2005, section 5.1.9), with
/// the distance and the normal of the axis, also where the lines are closest past an end.
#[inline(always)]
fn add_edge_contact<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    best: &BoxAxis<C::F>,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (axes_a, b) = (pair.axes_a, pair.pose_b);
    let (half_a, half_b) = (pair.a.half_extents(), pair.b.half_extents());
    // the normal in the axes of both boxes
    let q = &best.cosines;
    let normal = best.product;
    let columns = transpose(q);
    let normal_b = columns.transpose_mul(normal);
    // middles of the edges, in the axes of A
    let mut a = [c(0.0); 3];
    let mut other = a;
    for k in 0..3 {
        a[k] = zero_at(best.pair[0], k, sign(normal[k]) * half_a[k]);
        other[k] = zero_at(best.pair[1], k, -(sign(normal_b[k]) * half_b[k]));
    }
    // between these middles, and the distance of the lines along the normal
    let apart = columns.mul_add(Vec3(other), best.center[0]) - Vec3(a);
    let distance = apart.dot(normal);
    // a + x aᵢ and apart + y bⱼ: the shortest way between the lines, clamped to the edges one after the other
    let run = column_at(best.pair[1], columns);
    let along_a = component_at(best.pair[0], apart);
    let along_b = apart.dot(run);
    let cosine = component_at(best.pair[0], run);
    let long_a = component_at(best.pair[0], half_a);
    let long_b = component_at(best.pair[1], half_b);
    let free = cosine.fnma(along_b, along_a) * (best.inverse * best.inverse);
    let x = free.min(long_a).max(-long_a);
    let y = cosine.fma(x, -along_b).min(long_b).max(-long_b);
    let x = cosine.fma(y, along_a).min(long_a).max(-long_a);
    // both closest points from the centre of A, and the middle between them
    let first = column_at(best.pair[0], *axes_a);
    let second = column_at(best.pair[1], b.axes);
    let on_a = first.scale_add(x, axes_a * Vec3(a));
    let on_b = second.scale_add(y, b.axes.mul_add(Vec3(other), b.center));
    let at = (on_a + on_b) * c(0.5);
    let touches = distance.lt(pair.margin);
    out.add(cx, touches, at, distance, axes_a * normal);
}

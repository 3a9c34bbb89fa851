//! Box against box: separating axes (Gottschalk, Lin and Manocha 1996), then one face of each cut against the other.
//!
//!     separation along l = |l·c| - Σ hₐ|l·aᵢ| - Σ h_b|l·bⱼ|,   l ∈ {aᵢ, bⱼ, aᵢ × bⱼ}/|·|;   the largest is kept
//!
//! A face axis: that face is the reference, the most opposite face of the other box is cut to its rectangle. An edge
//! axis: one point, between the edges. Where the boxes are apart and no point attains the separation, their closest
//! features are a vertex and something, since the closest points of two edges lie along an axis of those above.

use super::box_faces::{cut, view};
use super::choose::{clamped, one_of, one_of_numbers, select, sign, transposed, unless};
use super::points::{Placed, Points};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::{times, when};

/// How much the separation along a face of B must exceed that along the faces of A, in roundings of the boxes' size, so
/// that parallel faces do not change places.
const PREFER_FIRST: f64 = 4.0;
/// The same for edges against faces, of the boxes' size, before the length of the axis is divided by: noise grows as edges
/// become parallel.
const PREFER_FACES: f64 = 4e-7;
/// Squared sine below which edges are parallel.
const PARALLEL: f64 = 1e-8;
/// Where faces are flat on each other to this (1 - cosine), the edge axis too, it must exceed by this part of the
/// separation: as MuJoCo, which keeps the face whatever the angle. One point in place of a face would let it rock.
const FLAT: f64 = 2e-4;
const FLAT_GAIN: f64 = 0.05;
/// Faces further apart than this, of the boxes' size, do not touch soon: there the nearest points are the exact ones.
const FLAT_APART: f64 = 0.02;

/// The axis of largest separation.
pub struct Axis<F: Num> {
    /// Axes of B by axes of A: `turn[i][j]` = aᵢ · bⱼ.
    pub turn: Mat3<F>,
    /// Centre of B in the axes of A, and in its own.
    pub center: [Vec3<F>; 2],
    /// The best face axis is one of B.
    pub of_b: F::Mask,
    /// Its number among the axes of that box.
    pub number: F,
    /// An edge axis is better.
    pub edge: F::Mask,
    /// Of which axes of A and B it is the product.
    pub pair: [F; 2],
    /// Its unit vector towards B, in the axes of A.
    pub product: Vec3<F>,
    /// Separation along the better of both [m]; 0 where flat faces are kept though an edge is better.
    pub separation: F,
    /// One over the length of the product of an edge axis, else 1.
    pub inverse: F,
}

/// Sum of the half extents: the size that tolerances refer to.
#[inline(always)]
fn size<F: Num>(a: Vec3<F>, b: Vec3<F>) -> F {
    (a[0] + a[1] + a[2]) + (b[0] + b[1] + b[2])
}

/// Contact points of two boxes.
#[inline(always)]
pub fn box_box<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    half_a: Vec3<C::F>,
    b: &Placed<C::F>,
    half_b: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let faces = faces(axes_a, half_a, b, half_b);
    when!(cx, !margin.lt(faces.separation), {
        let edge = edge(&faces, half_a, half_b);
        // separation over √square against the margin
        let far = (margin * margin * edge.square).lt(edge.score);
        when!(cx, !far, {
            let best = best(&faces, &edge, half_a, half_b);
            let mut least = cx.var(c(1e9));
            when!(cx, !best.edge, {
                let view = view(&best, axes_a, half_a, b, half_b);
                let nearest = cut(cx, &view, margin, out);
                cx.set(&mut least, nearest);
            });
            when!(cx, best.edge, {
                let nearest = edges(cx, &best, axes_a, half_a, b, half_b, margin, out);
                cx.set(&mut least, nearest);
            });
            // what rounding may leave between the separation and the point that attains it
            let noise = c(16.0 * <C::F as Num>::Real::EPSILON) * size(half_a, half_b);
            let reach = noise.fma(best.inverse, best.separation);
            let apart = c(0.0).lt(best.separation) & reach.lt(cx.get(&least));
            when!(cx, apart, {
                let nearest = cx.get(&least).min(margin);
                vertices(cx, axes_a, half_a, b, half_b, &best, nearest, out);
            });
        });
    });
}

/// The face axis of largest separation.
struct Faces<F> {
    turn: Mat3<F>,
    /// Absolute values of `turn`.
    width: Mat3<F>,
    center: [Vec3<F>; 2],
    separation: F,
    /// Its number: of A, then of B.
    code: F,
}

#[inline(always)]
fn faces<F: Num>(axes_a: &Mat3<F>, half_a: Vec3<F>, b: &Placed<F>, half_b: Vec3<F>) -> Faces<F> {
    let c = F::c;
    let mut turn = Mat3::zero();
    let mut width = turn;
    for i in 0..3 {
        for j in 0..3 {
            turn[i][j] = axes_a[i].dot(b.axes[j]);
            width[i][j] = turn[i][j].abs();
        }
    }
    let in_a = axes_a.transpose_mul(b.center);
    let in_b = b.axes.transpose_mul(b.center);
    let (mut first, mut code) = (c(-1e9), c(0.0));
    for i in 0..3 {
        let x = in_a[i].abs() - half_a[i] - half_b.dot(Vec3(width[i].0));
        let better = first.lt(x);
        first = F::select(better, x, first);
        code = F::select(better, c(i as f64), code);
    }
    let (mut second, mut code_b) = (c(-1e9), c(0.0));
    for j in 0..3 {
        let x =
            in_b[j].abs() - half_b[j] - half_a.dot(Vec3([width[0][j], width[1][j], width[2][j]]));
        let better = second.lt(x);
        second = F::select(better, x, second);
        code_b = F::select(better, c(3.0 + j as f64), code_b);
    }
    let noise = size(half_a, half_b) * c(PREFER_FIRST * F::Real::EPSILON);
    let better = (first + noise).lt(second);
    Faces {
        turn,
        width,
        center: [in_a, in_b],
        separation: F::select(better, second, first),
        code: F::select(better, code_b, code),
    }
}

/// The edge axis of largest separation, if it exceeds that of the faces.
struct Edge<F> {
    /// Number 3 i + j of aᵢ × bⱼ, or -1.
    code: F,
    /// x|x| where x is the separation times the length of the axis.
    score: F,
    /// The axis' squared length.
    square: F,
}

#[inline(always)]
fn edge<F: Num>(faces: &Faces<F>, half_a: Vec3<F>, half_b: Vec3<F>) -> Edge<F> {
    let c = F::c;
    let (turn, width, in_a) = (&faces.turn, &faces.width, faces.center[0]);
    // separation x over length √l is compared by x|x| l' > x'|x'| l
    let mut score = faces.separation * faces.separation.abs();
    let (mut square, mut code) = (c(1.0), c(-1.0));
    let noise = size(half_a, half_b) * c(PREFER_FACES);
    for i in 0..3 {
        let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
            let l = turn[i1][j].fma(turn[i1][j], turn[i2][j] * turn[i2][j]);
            let between = in_a[i1].fnma(turn[i2][j], in_a[i2] * turn[i1][j]).abs();
            let of_a = half_a[i1].fma(width[i2][j], half_a[i2].fma(width[i1][j], noise));
            let of_b = half_b[j1].fma(width[i][j2], half_b[j2].fma(width[i][j1], of_a));
            let x = between - of_b;
            let here = x * x.abs();
            let better = c(PARALLEL).lt(l) & (score * l).lt(here * square);
            score = F::select(better, here, score);
            square = F::select(better, l, square);
            code = F::select(better, c((3 * i + j) as f64), code);
        }
    }
    Edge {
        code,
        score,
        square,
    }
}

/// The better of the best face and edge axes.
#[inline(always)]
fn best<F: Num>(faces: &Faces<F>, edge: &Edge<F>, half_a: Vec3<F>, half_b: Vec3<F>) -> Axis<F> {
    let c = F::c;
    let turn = faces.turn;
    let columns = transposed(&turn);
    let inverse = c(1.0).div(edge.square.sqrt());
    // what was taken off for noise is added again
    let root = edge.score.abs().sqrt();
    let less = F::select(edge.score.lt(c(0.0)), -root, root);
    let separation = size(half_a, half_b).fma(c(PREFER_FACES), less) * inverse;
    let first = F::select(
        c(5.5).lt(edge.code),
        c(2.0),
        F::select(c(2.5).lt(edge.code), c(1.0), c(0.0)),
    );
    let pair = [first, c(3.0).fnma(first, edge.code)];
    // aᵢ × bⱼ in the axes of A
    let column = one_of(pair[1], columns);
    let product = one_of(
        first,
        Mat3([
            Vec3([c(0.0), -column[2], column[1]]),
            Vec3([column[2], c(0.0), -column[0]]),
            Vec3([-column[1], column[0], c(0.0)]),
        ]),
    );
    let product = product * (inverse * sign(product.dot(faces.center[0])));
    let of_b = c(2.5).lt(faces.code);
    let number = faces.code - F::select(of_b, c(3.0), c(0.0));
    let facing = one_of(number, columns);
    let along_face = F::select(of_b, product.dot(facing), one_of_numbers(number, product));
    // the other box's axes along the face axis
    let theirs = select(of_b, facing, one_of(number, turn));
    let parallel = theirs[0].abs().max(theirs[1].abs()).max(theirs[2].abs());
    let flat = c(1.0 - FLAT).lt(parallel.min(along_face.abs()));
    let little = (separation - faces.separation).lt(faces.separation.abs() * c(FLAT_GAIN));
    let close = faces.separation.lt(size(half_a, half_b) * c(FLAT_APART));
    let found = c(-0.5).lt(edge.code);
    let is_flat = found & close & (flat & little);
    let is_edge = found & !is_flat;
    // faces that are kept so are not taken for apart: their points stand
    let face = F::select(is_flat, c(0.0), faces.separation);
    Axis {
        turn,
        center: faces.center,
        of_b,
        number,
        edge: is_edge,
        pair,
        product,
        separation: F::select(is_edge, separation, face),
        inverse: F::select(is_edge, inverse, c(1.0)),
    }
}

/// The edges of an edge axis: their closest points. Returns the distance.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // two boxes, what is known of them, and where points go
fn edges<C: Cx>(
    cx: &mut C,
    best: &Axis<C::F>,
    axes_a: &Mat3<C::F>,
    half_a: Vec3<C::F>,
    b: &Placed<C::F>,
    half_b: Vec3<C::F>,
    margin: C::F,
    out: &mut Points<C>,
) -> C::F {
    let c = C::F::c;
    let q = &best.turn;
    let normal = best.product;
    let columns = transposed(q);
    let normal_b = columns.transpose_mul(normal);
    // middles of the edges, in the axes of A
    let mut a = [c(0.0); 3];
    let mut other = a;
    for k in 0..3 {
        a[k] = unless(best.pair[0], k, sign(normal[k]) * half_a[k]);
        other[k] = unless(best.pair[1], k, -(sign(normal_b[k]) * half_b[k]));
    }
    let apart = columns.mul_add(Vec3(other), best.center[0]) - Vec3(a);
    let distance = apart.dot(normal);
    // a + x aᵢ and apart + y bⱼ: the shortest way between the lines
    let run = one_of(best.pair[1], columns);
    let along_a = one_of_numbers(best.pair[0], apart);
    let along_b = apart.dot(run);
    let cosine = one_of_numbers(best.pair[0], run);
    let factor = best.inverse * best.inverse;
    let x = cosine.fnma(along_b, along_a) * factor;
    let y = cosine.fma(along_a, -along_b) * factor;
    let long_a = one_of_numbers(best.pair[0], half_a);
    let long_b = one_of_numbers(best.pair[1], half_b);
    let over = long_a.lt(x.abs()) | long_b.lt(y.abs());
    let (x, y) = (x.min(long_a).max(-long_a), y.min(long_b).max(-long_b));
    let first = one_of(best.pair[0], *axes_a);
    let second = one_of(best.pair[1], b.axes);
    let on_a = first.scale_add(x, axes_a * Vec3(a));
    let on_b = second.scale_add(y, b.axes.mul_add(Vec3(other), b.center));
    let at = (on_a + on_b) * c(0.5);
    // past an end the lines do not meet: then something else is nearest, unless the boxes overlap
    let found = distance.lt(margin) & !(over & c(0.0).lt(distance));
    out.add(cx, found, at, distance, axes_a * normal);
    C::F::select(found, distance, c(1e9))
}

/// The vertex of either box that is nearest to the other box, if it is nearer than `nearest`.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // two boxes, what is known of them, and where points go
fn vertices<C: Cx>(
    cx: &mut C,
    axes_a: &Mat3<C::F>,
    half_a: Vec3<C::F>,
    b: &Placed<C::F>,
    half_b: Vec3<C::F>,
    best: &Axis<C::F>,
    nearest: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let [in_a, in_b] = best.center;
    let q = best.turn;
    let into_b = q;
    let into_a = transposed(&q);
    let mut square = cx.var(nearest * nearest);
    let mut middles = [cx.var(c(0.0)), cx.var(c(0.0)), cx.var(c(0.0))];
    let mut between = [cx.var(c(0.0)), cx.var(c(0.0)), cx.var(c(0.0))];
    times!(cx, i in 8, {
        let i = cx.number(i);
        let (high, i) = bit(i, 4.0);
        let (middle, i) = bit(i, 2.0);
        let (low, _) = bit(i, 1.0);
        let corner = [low, middle, high];
        for of_b in [true, false] {
            let (half, box_half) = if of_b { (half_b, half_a) } else { (half_a, half_b) };
            let local = [corner[0] * half[0], corner[1] * half[1], corner[2] * half[2]];
            let vertex = match of_b {
                true => into_a.mul_add(Vec3(local), in_a),
                false => (into_b * Vec3(local)) - in_b,
            };
            let clamped = clamped(vertex, box_half);
            let apart = vertex - clamped;
            let middle = apart.scale_add(c(0.5), clamped);
            let (middle, apart) = match of_b {
                true => (axes_a * middle, axes_a * apart),
                false => (
                    b.axes.mul_add(middle, b.center),
                    (b.axes * apart) * c(-1.0),
                ),
            };
            let new = apart.dot(apart);
            let better = new.lt(cx.get(&square));
            let kept = C::F::select(better, new, cx.get(&square));
            cx.put(&mut square, kept);
            for k in 0..3 {
                let kept = C::F::select(better, middle[k], cx.get(&middles[k]));
                cx.put(&mut middles[k], kept);
                let kept = C::F::select(better, apart[k], cx.get(&between[k]));
                cx.put(&mut between[k], kept);
            }
        }
    });
    let mut at = Vec3::zero();
    let mut apart = at;
    for k in 0..3 {
        at[k] = cx.get(&middles[k]);
        apart[k] = cx.get(&between[k]);
    }
    let distance = apart.dot(apart).sqrt();
    let normal = apart * c(1.0).div(distance);
    out.add(cx, c(0.0).lt(distance), at, distance, normal);
}

/// The sign of a binary digit of a number, and what is left of the number.
#[inline(always)]
fn bit<F: Num>(number: F, value: f64) -> (F, F) {
    let set = F::c(value - 0.5).lt(number);
    let sign = F::select(set, F::c(1.0), F::c(-1.0));
    (sign, F::select(set, number - F::c(value), number))
}

//! Contact points of two shapes whose normal is known: their faces along it, cut against each other.
//!
//! Both faces are seen along the normal n, as polygons in the plane across it, each with its height along n. The corners
//! of the polygons' intersection are the candidates, the difference of the heights is their distance: never less than that
//! of the shapes along n, so whatever is found is sound, and where the least is not among them, the pair's closest point is
//! added. Of more than four, the deepest and the three that span most are kept.

use super::choose::select;
use super::points::Points;
use super::spread::Spread;
use super::support::{across, get3, rounding, set3, var3};
use crate::constants::clip::Cut;
use crate::constants::hull::CORNERS_MAX;
use crate::lane::{Cx, MaskOf, Num, Table};
use crate::math::vec3::{Mat3, Vec3};
use crate::{break_if, times, when};

/// Faces that are turned to the normal less than this touch face on [–]: 1.8°.
const ALIGNED: f64 = 0.9995;
/// Sides that are steeper than this are not cut [–]: their heights would be errors of a cut many times over.
const FACING: f64 = 0.2;
/// The distance of what is no candidate [m].
const NONE: f64 = 1e9;

/// The side of a shape that is nearest along the normal: a flat polygon, or a segment as one with two corners.
pub(super) trait Side<C: Cx> {
    /// A vector across it, outward, of any length.
    fn normal(&self) -> Vec3<C::F>;
    /// How many corners.
    fn count(&self) -> C::F;
    /// Corner `i`, counter-clockwise from outside; corner 0 past the last.
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F>;
}

/// Where two shapes are nearest.
#[derive(Clone, Copy)]
pub(super) struct Near<F> {
    /// Unit normal from the pair's first shape to the second.
    pub normal: Vec3<F>,
    /// Their distance along it.
    pub distance: F,
    /// The middle of their closest points.
    pub point: Vec3<F>,
}

/// The plane of a side: height = base + x slope\[0\] + y slope\[1\].
struct Plane<F> {
    slope: [F; 2],
    base: F,
    /// Which way round its corners run, seen against the normal: 1 counter-clockwise, -1 clockwise.
    turn: F,
    /// How well it faces along the normal, 1 at best.
    facing: F,
}

/// Whether a side with this outward normal is flat on the other shape.
#[inline(always)]
pub(super) fn aligned<F: Num>(outward: Vec3<F>, normal: Vec3<F>) -> F::Mask {
    F::c(ALIGNED).lt(outward.dot(normal).abs())
}

/// Adds the contact points of a pair.
///
/// `first` is cut by `second`; `side` is 1 where `first` is the pair's first shape, -1 where it is the second. `flat`
/// says in which worlds the sides may touch in more than a point. `size` is the smaller shape's radius; `frame` and
/// `center` lead from the frame of all this to that of the points.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn add_points<C: Cx>(
    cx: &mut C,
    near: &Near<C::F>,
    flat: MaskOf<C>,
    first: &impl Side<C>,
    second: &impl Side<C>,
    side: C::F,
    size: C::F,
    margin: C::F,
    frame: &Mat3<C::F>,
    center: Vec3<C::F>,
    cut: Cut,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let n = near.normal;
    let u = across(n);
    let v = n.cross(u);
    let basis = Mat3([u, v, n]);
    // the deepest point; the closest one where no candidate is as deep
    let mut spot = [
        var3(cx, Vec3([zero, zero, near.distance])),
        var3(cx, Vec3([zero; 3])),
        var3(cx, Vec3([zero; 3])),
        var3(cx, Vec3([zero; 3])),
    ];
    let mut found = [cx.var(zero), cx.var(zero), cx.var(zero)];
    let mut plane = var3(cx, Vec3([zero; 3]));
    let mut closest = cx.var(one);
    when!(cx, flat, {
        let counts = [first.count(), second.count()];
        let most = counts[0].max(counts[1]);
        times!(cx, i in CORNERS_MAX + 1, {
            let p = first.corner(cx, i);
            let q = second.corner(cx, i);
            let p = basis.transpose_mul(p - near.point);
            let q = basis.transpose_mul(q - near.point);
            for k in 0..3 {
                cx.fill(cut.corners, i, k, p[k]);
                cx.fill(cut.corners, i, 3 + k, q[k]);
            }
            let done = (most - c(0.5)).lt(cx.number(i));
            break_if!(cx, done);
            for k in 0..3 {
                cx.fill(cut.candidates, i, 3 * k + 2, c(NONE));
            }
        });
        let zeroth = cx.at(0);
        let p = plane_of(cx, cut, zeroth, 0, basis.transpose_mul(first.normal()));
        let q = plane_of(cx, cut, zeroth, 3, basis.transpose_mul(second.normal()));
        set3(cx, &mut plane, Vec3([p.slope[0], p.slope[1], p.base]));
        half_planes(cx, cut, counts[1], q.turn);
        let steep = p.facing.lt(c(FACING)) | q.facing.lt(c(FACING));
        when!(cx, !steep, {
            cut_edges(cx, cut, counts, &q, side, size, margin);
            add_corners(cx, cut, counts, &p, side, size, margin);
        });

        let least = rounding::<C::F>() * size;
        deepest(
            cx,
            cut,
            most,
            least,
            &mut spot[0],
            &mut closest,
            near.distance,
        );
        for stage in 0..3 {
            farthest(
                cx,
                cut,
                most,
                stage,
                c(1e-3) * size,
                &mut spot,
                &mut found[stage],
            );
        }
    });
    let normal = frame * n;
    let slope = get3(cx, &plane);
    for k in 0..4 {
        let Vec3([x, y, distance]) = get3(cx, &spot[k]);
        let distance = distance.max(near.distance);
        let height = slope[0].fma(x, slope[1].fma(y, slope[2])) + distance * side * c(0.5);
        let height = match k {
            0 => C::F::select(c(0.5).lt(cx.get(&closest)), zero, height),
            _ => height,
        };
        let point = u.scale_add(x, v.scale_add(y, n.scale_add(height, near.point)));
        let point = frame.mul_add(point, center);
        let is = match k {
            0 => distance.lt(margin),
            _ => c(0.5).lt(cx.get(&found[k - 1])),
        };
        out.add(cx, is, point, distance, normal);
    }
}

/// The plane through corner 0 of a side across its outward normal `m`, both in the basis.
#[inline(always)]
fn plane_of<C: Cx>(cx: &mut C, cut: Cut, zeroth: C::I, k: usize, m: Vec3<C::F>) -> Plane<C::F> {
    let c = C::F::c;
    let (x, y, h) = (
        cx.load(cut.corners, zeroth, k),
        cx.load(cut.corners, zeroth, k + 1),
        cx.load(cut.corners, zeroth, k + 2),
    );
    let facing = m[2].abs();
    let length = m.dot(m).sqrt().max(c(1e-18));
    let back = m[2].lt(c(0.0));
    let size = facing.max(c(0.01) * length);
    let k = c(-1.0).div(C::F::select(back, -size, size));
    let slope = [m[0] * k, m[1] * k];
    Plane {
        slope,
        base: slope[0].fnma(x, slope[1].fnma(y, h)),
        turn: C::F::select(back, c(-1.0), c(1.0)),
        facing: facing.div(length),
    }
}

/// The edges of the second side as half-planes a x + b y < d; of a segment, what is across its ends.
#[inline(always)]
fn half_planes<C: Cx>(cx: &mut C, cut: Cut, count: C::F, turn: C::F) {
    let c = C::F::c;
    let segment = count.lt(c(2.5));
    times!(cx, i in CORNERS_MAX, {
        let (x0, y0) = (cx.load(cut.corners, i, 3), cx.load(cut.corners, i, 4));
        let (x1, y1) = (following(cx, cut, i, 3), following(cx, cut, i, 4));
        let (dx, dy) = (x1 - x0, y1 - y0);
        let unit = c(1.0).div(dx.fma(dx, dy * dy).max(c(1e-24)).sqrt());
        let a = C::F::select(segment, dx * unit, dy * (unit * turn));
        let b = C::F::select(segment, dy * unit, -(dx * (unit * turn)));
        cx.fill(cut.corners, i, 6, a);
        cx.fill(cut.corners, i, 7, b);
        cx.fill(cut.corners, i, 8, a.fma(x1, b * y1));
        let done = (count - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
}

/// Number `k` of the next row of the corners.
#[inline(always)]
fn following<C: Cx>(cx: &mut C, cut: Cut, i: C::I, k: usize) -> C::F {
    let t = cut.corners;
    let shifted = Table {
        base: t.base + t.stride,
        rows: t.rows - 1,
        ..t
    };
    cx.load(shifted, i, k)
}

/// Each edge of the first side, cut to the second: its start, and its end if that is a cut.
#[inline(always)]
fn cut_edges<C: Cx>(
    cx: &mut C,
    cut: Cut,
    counts: [C::F; 2],
    q: &Plane<C::F>,
    side: C::F,
    size: C::F,
    margin: C::F,
) {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let inclusive = c(1e-5) * size;
    times!(cx, i in CORNERS_MAX, {
        let start: Vec3<C::F> = load3(cx, cut.corners, i, 0);
        let end = Vec3([following(cx, cut, i, 0), following(cx, cut, i, 1), following(cx, cut, i, 2)]);
        let way = end - start;
        let mut low = cx.var(zero);
        let mut high = cx.var(one);
        times!(cx, j in CORNERS_MAX, {
            let (a, b, d) = (
                cx.load(cut.corners, j, 6),
                cx.load(cut.corners, j, 7),
                cx.load(cut.corners, j, 8),
            );
            let before = a.fma(start[0], b * start[1]) - d - inclusive;
            let after = a.fma(end[0], b * end[1]) - d - inclusive;
            let fall = before - after;
            let level = fall.abs().lt(c(1e-18));
            let t = before.div(C::F::select(level, one, fall));
            let (outside, leaves) = (zero.lt(before), zero.lt(after));
            let (l, h) = (cx.get(&low), cx.get(&high));
            let entry = C::F::select(leaves, c(2.0), l.max(t));
            cx.set(&mut low, C::F::select(outside, entry, l));
            cx.set(&mut high, C::F::select(leaves & !outside, h.min(t), h));
            let done = (counts[1] - c(1.5)).lt(cx.number(j));
            break_if!(cx, done);
        });
        let (l, h) = (cx.get(&low), cx.get(&high));
        let some = l.lt(h);
        for (slot, t, is) in [(0, l, some), (1, h, some & h.lt(one))] {
            let Vec3([x, y, height]) = way.scale_add(t, start);
            let other = q.slope[0].fma(x, q.slope[1].fma(y, q.base));
            keep(cx, cut.candidates, i, slot, Vec3([x, y, (other - height) * side]), is, margin);
        }
        let done = (counts[0] - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
}

/// The corners of the second side inside the first.
#[inline(always)]
fn add_corners<C: Cx>(
    cx: &mut C,
    cut: Cut,
    counts: [C::F; 2],
    p: &Plane<C::F>,
    side: C::F,
    size: C::F,
    margin: C::F,
) {
    let c = C::F::c;
    let inside = c(-1e-6) * size;
    times!(cx, i in CORNERS_MAX, {
        let Vec3([x, y, height]) = load3(cx, cut.corners, i, 3);
        let mut outside = cx.var(c(-1e18));
        times!(cx, j in CORNERS_MAX, {
            let (x0, y0) = (cx.load(cut.corners, j, 0), cx.load(cut.corners, j, 1));
            let (x1, y1) = (following(cx, cut, j, 0), following(cx, cut, j, 1));
            let (dx, dy) = (x1 - x0, y1 - y0);
            let square = dx.fma(dx, dy * dy);
            let unit = p.turn.div(square.max(c(1e-24)).sqrt());
            // an edge without length bounds nothing
            let far = (dy * (x - x0) - dx * (y - y0)) * unit;
            let old = cx.get(&outside);
            cx.set(&mut outside, C::F::select(c(1e-20).lt(square), old.max(far), old));
            let done = (counts[0] - c(1.5)).lt(cx.number(j));
            break_if!(cx, done);
        });
        let within = cx.get(&outside).lt(inside) & c(2.5).lt(counts[0]);
        let within = within & c(2.5).lt(counts[1]);
        let other = p.slope[0].fma(x, p.slope[1].fma(y, p.base));
        keep(cx, cut.candidates, i, 2, Vec3([x, y, (height - other) * side]), within, margin);
        let done = (counts[1] - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
}

#[inline(always)]
fn load3<C: Cx>(cx: &mut C, t: Table, i: C::I, k: usize) -> Vec3<C::F> {
    Vec3([cx.load(t, i, k), cx.load(t, i, k + 1), cx.load(t, i, k + 2)])
}

/// Writes a candidate; `is` and nearer than the margin, or else none.
#[inline(always)]
fn keep<C: Cx>(
    cx: &mut C,
    t: Table,
    i: C::I,
    slot: usize,
    Vec3([x, y, distance]): Vec3<C::F>,
    is: MaskOf<C>,
    margin: C::F,
) {
    let is = is & distance.lt(margin);
    cx.store(t, i, 3 * slot, x);
    cx.store(t, i, 3 * slot + 1, y);
    cx.store(
        t,
        i,
        3 * slot + 2,
        C::F::select(is, distance, C::F::c(NONE)),
    );
}

/// The deepest candidate, if it is as deep as the shapes are.
#[inline(always)]
fn deepest<C: Cx>(
    cx: &mut C,
    cut: Cut,
    most: C::F,
    least: C::F,
    spot: &mut [C::V; 3],
    closest: &mut C::V,
    distance: C::F,
) {
    let c = C::F::c;
    let mut best = [cx.var(c(0.0)), cx.var(c(0.0)), cx.var(c(0.5 * NONE))];
    times!(cx, i in CORNERS_MAX, {
        for slot in 0..3 {
            let x: Vec3<C::F> = load3(cx, cut.candidates, i, 3 * slot);
            let old: Vec3<C::F> = get3(cx, &best);
            // of points as deep up to rounding the first stays, so that resting contacts keep theirs
            let deeper = (x[2] + least).lt(old[2]);
            set3(cx, &mut best, select(deeper, x, old));
        }
        let done = (most - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
    let (x, old) = (get3(cx, &best), get3(cx, spot));
    let deep = x[2].lt(distance + least + least);
    set3(cx, spot, select(deep, x, old));
    cx.set(closest, C::F::select(deep, c(0.0), c(1.0)));
}

/// The candidate that spans most with those chosen: farthest from the first, from the line through two, outside the
/// triangle of three.
#[inline(always)]
fn farthest<C: Cx>(
    cx: &mut C,
    cut: Cut,
    most: C::F,
    stage: usize,
    least: C::F,
    spot: &mut [[C::V; 3]; 4],
    found: &mut C::V,
) {
    let c = C::F::c;
    let chosen: [Vec3<C::F>; 3] = [get3(cx, &spot[0]), get3(cx, &spot[1]), get3(cx, &spot[2])];
    let span = Spread::of(stage, chosen);
    let mut best = cx.var(span.threshold(least));
    // where none is found the first stands in, and nothing is found after it
    let mut place = var3(cx, chosen[0]);
    let mut is = cx.var(c(0.0));
    times!(cx, i in CORNERS_MAX, {
        for slot in 0..3 {
            let x: Vec3<C::F> = load3(cx, cut.candidates, i, 3 * slot);
            let score = span.score(x[0], x[1]);
            let old = cx.get(&best);
            let farther = old.lt(score) & x[2].lt(c(0.5 * NONE));
            cx.set(&mut best, C::F::select(farther, score, old));
            let kept = get3(cx, &place);
            set3(cx, &mut place, select(farther, x, kept));
            let had = cx.get(&is);
            cx.set(&mut is, C::F::select(farther, c(1.0), had));
        }
        let done = (most - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
    let (x, is) = (get3(cx, &place), cx.get(&is));
    set3(cx, &mut spot[stage + 1], x);
    cx.set(found, is);
}

//! Clipping of a convex polygon by another in the plane across a normal, and the choice among its corners.
//!
//! Corners and candidates lie in scratch tables ([`Cut`]): rows of the clipped polygon, rows of the clipping one, half-planes
//! of the latter's edges, and three candidates per edge. Both ends of a loop over corners depend on the world, so that a
//! world leaves it once its own corners are done.

use super::reduction::ReductionScore;
use crate::constants::clip::Cut;
use crate::constants::hull::CORNERS_MAX;
use crate::lane::{Cx, MaskOf, Num, Table};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::variables::{get3, load_each3, set3, var3};
use crate::{break_if, times};

/// The distance that stands for no candidate [m].
pub(in crate::step::collide) const NO_CANDIDATE: f64 = 1e9;

/// Two polygons to be clipped.
pub(in crate::step::collide) struct Clip<F> {
    pub tables: Cut,
    /// Corners of the clipped polygon and of the clipping one.
    pub counts: [F; 2],
    /// 1 where the clipped polygon is of the pair's first shape, else -1.
    pub side: F,
    /// Radius of the smaller shape, for tolerances [m].
    pub size: F,
    /// Distance below which a candidate counts [m].
    pub margin: F,
}

/// The plane of a polygon: height = base + x slope\[0\] + y slope\[1\].
pub(in crate::step::collide) struct ClipPlane<F> {
    pub slope: [F; 2],
    pub base: F,
    /// Orientation of its corners, seen against the normal: 1 counter-clockwise, -1 clockwise.
    pub turn: F,
    /// Cosine to the normal.
    pub facing: F,
}

impl<F: Num> ClipPlane<F> {
    /// The plane across `m` through the first corner of a polygon; both are as seen along the normal.
    #[inline(always)]
    pub fn through<C: Cx<F = F>>(
        cx: &mut C,
        tables: Cut,
        first: C::I,
        k: usize,
        m: Vec3<F>,
    ) -> ClipPlane<F> {
        let c = F::c;
        // the first corner, a point of the plane
        let (x, y, h) = (
            cx.load(tables.corners, first, k),
            cx.load(tables.corners, first, k + 1),
            cx.load(tables.corners, first, k + 2),
        );
        // |m₂| = |m| times the cosine to the viewing normal
        let facing = m[2].abs();
        let length = m.dot(m).sqrt().max(c(1e-18));
        let back = m[2].lt(c(0.0));
        // a plane along the normal keeps finite slopes; it is too steep to be clipped
        let size = facing.max(c(0.01) * length);
        // m · (x, y, h) is constant on the plane: slopes are -m₀/m₂ and -m₁/m₂
        let k = c(-1.0).div(F::select(back, -size, size));
        let slope = [m[0] * k, m[1] * k];
        ClipPlane {
            slope,
            base: slope[0].fnma(x, slope[1].fnma(y, h)),
            turn: F::select(back, c(-1.0), c(1.0)),
            facing: facing.div(length),
        }
    }

    /// Its height at a point.
    #[inline(always)]
    fn height(&self, x: F, y: F) -> F {
        self.slope[0].fma(x, self.slope[1].fma(y, self.base))
    }
}

/// Scalar `k` of the next row of the corners.
#[inline(always)]
fn next_corner<C: Cx>(cx: &mut C, tables: Cut, i: C::I, k: usize) -> C::F {
    let t = tables.corners;
    // the same table from its second row on; the row past the last corner holds the first again
    let shifted = Table {
        base: t.base + t.stride,
        rows: t.rows - 1,
        ..t
    };
    cx.load(shifted, i, k)
}

impl<F: Num> Clip<F> {
    /// Writes the edges of the clipping polygon as half-planes a x + b y < d; of a segment, the lines across its ends.
    #[inline(always)]
    pub fn half_planes<C: Cx<F = F>>(&self, cx: &mut C, turn: F) {
        let (c, tables, count) = (F::c, self.tables, self.counts[1]);
        // a polygon of two corners is a segment
        let segment = count.lt(c(2.5));
        times!(cx, i in CORNERS_MAX, {
            // the edge from corner i to the next, and 1 over its length; corners that coincide stay finite
            let (x0, y0) = (cx.load(tables.corners, i, 3), cx.load(tables.corners, i, 4));
            let (x1, y1) = (next_corner(cx, tables, i, 3), next_corner(cx, tables, i, 4));
            let (dx, dy) = (x1 - x0, y1 - y0);
            let unit = c(1.0).div(dx.fma(dx, dy * dy).max(c(1e-24)).sqrt());
            // outward normal (dy, -dx)/|d| of counter-clockwise corners; of a segment its own direction
            let a = F::select(segment, dx * unit, dy * (unit * turn));
            let b = F::select(segment, dy * unit, -(dx * (unit * turn)));
            // d at the edge's end: for a segment, the line through that end
            cx.fill(tables.corners, i, 6, a);
            cx.fill(tables.corners, i, 7, b);
            cx.fill(tables.corners, i, 8, a.fma(x1, b * y1));
            // the last edge is i = count - 1; counts are whole, so half of one decides
            let done = (count - c(1.5)).lt(cx.number(i));
            break_if!(cx, done);
        });
    }

    /// Clips each edge of the clipped polygon (Cyrus and Beck 1978): its start is a candidate, and its end if it is cut.
    #[inline(always)]
    pub fn clip_edges<C: Cx<F = F>>(&self, cx: &mut C, q: &ClipPlane<F>) {
        let (c, tables) = (F::c, self.tables);
        let (zero, one) = (c(0.0), c(1.0));
        // corners on an edge of the other polygon count as inside
        let inclusive = c(1e-5) * self.size;
        times!(cx, i in CORNERS_MAX, {
            // an edge of the clipped polygon: start + t way, 0 ≤ t ≤ 1
            let start: Vec3<F> = load_each3(cx, tables.corners, i, 0);
            let end = Vec3([
                next_corner(cx, tables, i, 0),
                next_corner(cx, tables, i, 1),
                next_corner(cx, tables, i, 2),
            ]);
            let way = end - start;
            // the part of it inside all half-planes so far: low < t < high
            let mut low = cx.var(zero);
            let mut high = cx.var(one);
            times!(cx, j in CORNERS_MAX, {
                let (a, b, d) = (
                    cx.load(tables.corners, j, 6),
                    cx.load(tables.corners, j, 7),
                    cx.load(tables.corners, j, 8),
                );
                // a x + b y - d at both ends: positive is outside
                let before = a.fma(start[0], b * start[1]) - d - inclusive;
                let after = a.fma(end[0], b * end[1]) - d - inclusive;
                // the line is crossed at t = before/fall; where both ends are as far, the divisor 1 keeps t finite
                let fall = before - after;
                let level = fall.abs().lt(c(1e-18));
                let t = before.div(F::select(level, one, fall));
                // an edge that comes in raises low, one that goes out lowers high
                let (outside, leaves) = (zero.lt(before), zero.lt(after));
                let (l, h) = (cx.get(&low), cx.get(&high));
                // an edge that is outside at both ends has nothing left: low above high
                let entry = F::select(leaves, c(2.0), l.max(t));
                cx.set(&mut low, F::select(outside, entry, l));
                cx.set(&mut high, F::select(leaves & !outside, h.min(t), h));
                let done = (self.counts[1] - c(1.5)).lt(cx.number(j));
                break_if!(cx, done);
            });
            let (l, h) = (cx.get(&low), cx.get(&high));
            let some = l.lt(h);
            // the end of an edge that is not cut is a candidate as the start of the next edge
            for (slot, t, is) in [(0, l, some), (1, h, some & h.lt(one))] {
                let Vec3([x, y, height]) = way.scale_add(t, start);
                // height of the second shape minus that of the first, along the normal
                let distance = (q.height(x, y) - height) * self.side;
                self.write(cx, i, slot, Vec3([x, y, distance]), is);
            }
            let done = (self.counts[0] - c(1.5)).lt(cx.number(i));
            break_if!(cx, done);
        });
    }

    /// The corners of the clipping polygon that are inside the clipped one are candidates.
    #[inline(always)]
    pub fn add_corners_inside<C: Cx<F = F>>(&self, cx: &mut C, p: &ClipPlane<F>) {
        let (c, tables, counts) = (F::c, self.tables, self.counts);
        // corners on an edge are candidates of that edge already
        let inside = c(-1e-6) * self.size;
        times!(cx, i in CORNERS_MAX, {
            // a corner of the clipping polygon, and the most that it is beyond any edge of the clipped one
            let Vec3([x, y, height]) = load_each3(cx, tables.corners, i, 3);
            let mut outside = cx.var(c(-1e18));
            times!(cx, j in CORNERS_MAX, {
                let (x0, y0) = (cx.load(tables.corners, j, 0), cx.load(tables.corners, j, 1));
                let (x1, y1) = (next_corner(cx, tables, j, 0), next_corner(cx, tables, j, 1));
                // distance beyond the edge: (dy, -dx)/|d| · (x - x0, y - y0), by the orientation of the corners
                let (dx, dy) = (x1 - x0, y1 - y0);
                let square = dx.fma(dx, dy * dy);
                let unit = p.turn.div(square.max(c(1e-24)).sqrt());
                // an edge without length bounds nothing
                let far = (dy * (x - x0) - dx * (y - y0)) * unit;
                let old = cx.get(&outside);
                cx.set(&mut outside, F::select(c(1e-20).lt(square), old.max(far), old));
                let done = (counts[0] - c(1.5)).lt(cx.number(j));
                break_if!(cx, done);
            });
            // segments have no inside
            let within = cx.get(&outside).lt(inside) & c(2.5).lt(counts[0]);
            let within = within & c(2.5).lt(counts[1]);
            // as in `clip_edges`, with the roles of the polygons exchanged
            let distance = (height - p.height(x, y)) * self.side;
            self.write(cx, i, 2, Vec3([x, y, distance]), within);
            let done = (counts[1] - c(1.5)).lt(cx.number(i));
            break_if!(cx, done);
        });
    }

    /// Writes a candidate, or none where the mask does not hold or the distance is past the margin.
    #[inline(always)]
    fn write<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        i: C::I,
        slot: usize,
        Vec3([x, y, distance]): Vec3<F>,
        is: MaskOf<C>,
    ) {
        let t = self.tables.candidates;
        let is = is & distance.lt(self.margin);
        // every world has the same rows: an empty place is marked by its distance
        cx.store(t, i, 3 * slot, x);
        cx.store(t, i, 3 * slot + 1, y);
        cx.store(
            t,
            i,
            3 * slot + 2,
            F::select(is, distance, F::c(NO_CANDIDATE)),
        );
    }
}

/// The deepest candidate, and whether it is as deep as the shapes are.
#[inline(always)]
pub(in crate::step::collide) fn deepest_candidate<C: Cx>(
    cx: &mut C,
    tables: Cut,
    most: C::F,
    least: C::F,
    distance: C::F,
) -> (Vec3<C::F>, MaskOf<C>) {
    let c = C::F::c;
    // an empty place has the distance NO_CANDIDATE: it is never below the start value
    let mut best = [
        cx.var(c(0.0)),
        cx.var(c(0.0)),
        cx.var(c(0.5 * NO_CANDIDATE)),
    ];
    times!(cx, i in CORNERS_MAX, {
        for slot in 0..3 {
            let x: Vec3<C::F> = load_each3(cx, tables.candidates, i, 3 * slot);
            let old: Vec3<C::F> = get3(cx, &best);
            // of points that are equally deep up to rounding the first stays, so that resting contacts keep theirs
            let deeper = (x[2] + least).lt(old[2]);
            set3(cx, &mut best, select(deeper, x, old));
        }
        // candidates have a row per corner of the larger polygon
        let done = (most - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
    // the point kept may be one tolerance above the deepest, and rounding adds another
    let x = get3(cx, &best);
    (x, x[2].lt(distance + least + least))
}

/// The candidate that adds most to the `count` + 1 points chosen, and 1 if there is one, else 0.
#[inline(always)]
pub(in crate::step::collide) fn farthest_candidate<C: Cx>(
    cx: &mut C,
    tables: Cut,
    most: C::F,
    count: usize,
    chosen: [Vec3<C::F>; 3],
    least: C::F,
) -> (Vec3<C::F>, C::F) {
    let c = C::F::c;
    let score = ReductionScore::from_chosen(count, chosen);
    let mut best = cx.var(score.threshold(least));
    // where none is found the first point stands in, and nothing is found after it
    let mut place = var3(cx, chosen[0]);
    let mut is = cx.var(c(0.0));
    times!(cx, i in CORNERS_MAX, {
        for slot in 0..3 {
            let x: Vec3<C::F> = load_each3(cx, tables.candidates, i, 3 * slot);
            // what the candidate adds; empty places add nothing
            let here = score.at(x[0], x[1]);
            let old = cx.get(&best);
            let farther = old.lt(here) & x[2].lt(c(0.5 * NO_CANDIDATE));
            cx.set(&mut best, C::F::select(farther, here, old));
            let kept = get3(cx, &place);
            set3(cx, &mut place, select(farther, x, kept));
            let had = cx.get(&is);
            cx.set(&mut is, C::F::select(farther, c(1.0), had));
        }
        let done = (most - c(1.5)).lt(cx.number(i));
        break_if!(cx, done);
    });
    (get3(cx, &place), cx.get(&is))
}

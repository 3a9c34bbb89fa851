//! A plane against a hull: up to four of the hull's vertices below the margin.
//!
//! - Of models with geoms from MuJoCo, the points of MuJoCo (`mjc_PlaneConvex`, from 3.13 on): the deepest vertex, and up to
//!   three corners of that polygon at it which faces the plane best. The model's tables have these corners of each vertex and
//!   polygon. A corner above the origin of the geom's frame does not count.
//! - Of others, the deepest vertex, and three that span most (see [`crate::step::collide::manifold::reduction`]). A bottom that is a little uneven then
//!   rests on all of it, not on one of its triangles.
//!
//! Only clusters of vertices that reach below the margin are visited, which are few: a hull rests on some of its vertices.

use super::hull::{Hull, Part, vertex_row};
use super::hull_axes::{BoxReach, Reach};
use crate::lane::{Cx, Fixed, Num, Real};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::reduction::ReductionScore;
use crate::step::collide::manifold::select::perpendicular;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::variables::{get3, pick3, set3, var3};
use crate::{span, when};

/// Vertices whose heights differ by less than this part of the hull's radius count as equally deep.
const SAME_DEPTH: f64 = 2e-6;
/// Vertices nearer to those chosen than this part of the hull's radius do not widen a contact.
const SPREAD: f64 = 1e-3;
/// Roundings of a height, up to which vertices are equally deep in MuJoCo's rule: the first one counts [–].
const ROUNDINGS: f64 = 16.0;

/// `each_low_row!(cx, n, limit, hull, row, { … })`: the body for every row of vertices of which one may be lower than `limit` along
/// `n`, in the worlds where it may.
macro_rules! each_low_row {
    ($cx:ident, $n:expr, $limit:expr, $hull:expr, $row:ident, $body:block) => {
        if $hull.tables.clusters.rows == 0 {
            let (first, end) = $hull.span($cx, Part::Vertices);
            span!($cx, $row in first, end, $body);
        } else {
            let (first, end) = $hull.clusters($cx);
            span!($cx, cluster in first, end, {
                let (center, radius) = $hull.cluster($cx, cluster);
                // least height that a vertex in the cluster's ball can have
                let lowest = $n.dot(center) - radius;
                when!($cx, lowest.lt($limit), {
                    let (first, end) = $hull.cluster_rows($cx, cluster);
                    span!($cx, $row in first, end, $body);
                });
            });
        }
    };
}

/// Adds the contacts of a plane with a hull.
#[inline(always)]
pub fn plane_hull<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    // the plane's normal in the frame of the hull, and the height of the hull's centre
    let (hull, b, normal) = (pair.hull_b(), pair.pose_b, pair.axes_a[2]);
    let n = b.axes.transpose_mul(normal);
    let height = normal.dot(b.center);
    // the bounding box rejects hulls above the margin
    let half = hull.half_extents(cx);
    let reach = BoxReach(half).reach(n);
    when!(cx, (height - reach).lt(pair.margin), {
        // a model that has fans takes MuJoCo's points
        if hull.tables.fans.rows > 0 {
            add_polygon(cx, pair, &hull, n, height, out);
        } else {
            add_widest(cx, pair, &hull, n, height, out);
        }
    });
}

/// Adds the deepest vertex and those that span most with it.
///
/// `n` is the plane's normal in the frame of the hull, and `height` that of the hull's centre.
#[inline(always)]
fn add_widest<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    hull: &Hull<'_, C>,
    n: Vec3<C::F>,
    height: C::F,
    out: &mut Points<C>,
) {
    let (b, normal) = (pair.pose_b, pair.axes_a[2]);
    // heights are from the hull's centre, so the limit is the margin less the centre's height
    let u = perpendicular(n);
    let view = View {
        axes: Mat3([u, n.cross(u), n]),
        limit: pair.margin - height,
        size: hull.radius(cx),
    };
    // far above the limit if no vertex is below it
    let deepest = view.deepest(cx, hull);
    when!(cx, deepest[2].lt(view.limit), {
        let (spots, exists) = view.choose(cx, hull, deepest);
        for k in 0..4 {
            let x = get3(cx, &spots[k]);
            let distance = x[2] + height;
            // half-way between vertex and plane
            let on_hull = view.axes[0].scale_add(
                x[0],
                view.axes[1].scale_add(x[1], n * (x[2] - C::F::c(0.5) * distance)),
            );
            let is = C::F::c(0.5).lt(cx.get(&exists[k]));
            let point = b.axes.mul_add(on_hull, b.center);
            out.add(cx, is, point, distance, normal);
        }
    });
}

/// Adds the deepest vertex, and corners of the polygon at it that faces the plane best, where they are below the margin; `n` and
/// `height` as in [`add_widest`].
#[inline(always)]
fn add_polygon<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    hull: &Hull<'_, C>,
    n: Vec3<C::F>,
    height: C::F,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (b, normal, tables) = (pair.pose_b, pair.axes_a[2], hull.tables);
    // heights that differ by less than this are equal
    let same = hull.radius(cx) * c(ROUNDINGS * <C::F as Num>::Real::EPSILON);
    let limit = pair.margin - height;
    let (lowest, deepest) = deepest_vertex(cx, hull, n, limit, same);
    when!(cx, lowest.lt(limit), {
        // rows of the deepest vertex's fan: one per polygon beside it
        let first = cx.pick(tables.fan_spans, deepest, 0);
        let count = cx.pick(tables.fan_spans, deepest, 1) - c(0.5);
        // MuJoCo begins with a polygon that faces away from the plane
        let mut best = cx.var(c(1.0));
        let mut corners = var3(cx, Vec3([deepest; 3]));
        let start = cx.at(0);
        let most = cx.index(tables.fan_sizes, hull.row, 0, tables.fans.rows + 1);
        // the loop has the length of the largest fan of the hull; a world selects among its own rows alone
        span!(cx, k in start, most, {
            let k = cx.number(k);
            let facing = pick3(cx, tables.fans, first + k, 0).dot(n);
            let places = pick3(cx, tables.fans, first + k, 3);
            let (least, old) = (cx.get(&best), get3(cx, &corners));
            // the outward normal most against n faces the plane best
            let better = k.lt(count) & facing.lt(least);
            cx.set(&mut best, C::F::select(better, facing, least));
            set3(cx, &mut corners, select(better, places, old));
        });
        // the same table with one vertex a row
        let single = Fixed {
            stride: 3,
            rows: 4 * tables.vertices.rows,
            ..tables.vertices
        };
        let origin = Vec3(cx.constants(tables.origins, hull.row, 0));
        let corners = get3(cx, &corners);
        // the deepest vertex, then the corners that the fan has for its polygon
        for (k, place) in [deepest, corners[0], corners[1], corners[2]]
            .into_iter()
            .enumerate()
        {
            let x = pick3(cx, single, place, 0);
            let distance = n.dot(x) + height;
            let mut is = distance.lt(pair.margin);
            if k > 0 {
                // where a polygon has fewer corners the vertex stands in
                let is_other = c(0.5).lt((place - deepest).abs());
                // a corner above the origin of the geom's frame by more than a rounding does not count
                is = is & is_other & !same.lt(n.dot(x - origin));
            }
            // half-way between vertex and plane
            let point = b.axes.mul_add(n.scale_add(distance * c(-0.5), x), b.center);
            out.add(cx, is, point, distance, normal);
        }
    });
}

/// Height of the deepest vertex above the hull's centre and its place in the table of vertices; of those that are equally deep
/// up to a rounding, that which the model has first. Far above, where none is below the limit.
#[inline(always)]
fn deepest_vertex<C: Cx>(
    cx: &mut C,
    hull: &Hull<'_, C>,
    n: Vec3<C::F>,
    limit: C::F,
    same: C::F,
) -> (C::F, C::F) {
    let c = C::F::c;
    let mut lowest = cx.var(c(1e18));
    let mut rank = cx.var(c(0.0));
    let mut place = cx.var(c(0.0));
    each_low_row!(cx, n, limit, hull, row, {
        // place of a vertex: four per row
        let number = cx.number(row) * c(4.0);
        let ranks: [C::F; 4] = cx.constants(hull.tables.ranks, row, 0);
        for (k, point) in vertex_row(cx, hull.tables, row).into_iter().enumerate() {
            let at = n.dot(point);
            let (old, first, kept) = (cx.get(&lowest), cx.get(&rank), cx.get(&place));
            // deeper by more than a rounding, or as deep and earlier in the model's order
            let deeper = (at + same).lt(old);
            let earlier = !(old + same).lt(at) & ranks[k].lt(first);
            // whether others are visited depends on clusters
            let is = at.lt(limit) & (deeper | earlier);
            cx.set(&mut lowest, C::F::select(is, at, old));
            cx.set(&mut rank, C::F::select(is, ranks[k], first));
            cx.set(&mut place, C::F::select(is, number + c(k as f64), kept));
        }
    });
    (cx.get(&lowest), cx.get(&place))
}

/// A hull as seen along the normal of a plane.
struct View<F> {
    /// Two directions across the normal, and the normal, in the frame of the hull.
    axes: Mat3<F>,
    /// Height of a point above the hull's centre below which it touches [m].
    limit: F,
    /// Radius of the hull [m].
    size: F,
}

/// Variables of four points and of whether there is one.
type FourPoints<V> = ([[V; 3]; 4], [V; 4]);

impl<F: Num> View<F> {
    /// Chooses four vertices below the limit; the first is the deepest.
    #[inline(always)]
    fn choose<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        hull: &Hull<'_, C>,
        deepest: Vec3<F>,
    ) -> FourPoints<C::V> {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let mut spots = [
            var3(cx, deepest),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
            var3(cx, Vec3::zero()),
        ];
        let mut exists = [cx.var(one), cx.var(zero), cx.var(zero), cx.var(zero)];
        // each vertex adds most to those before it
        for count in 0..3 {
            let chosen: [Vec3<F>; 3] = [
                get3(cx, &spots[0]),
                get3(cx, &spots[1]),
                get3(cx, &spots[2]),
            ];
            let (x, is) = self.farthest(cx, hull, count, chosen);
            set3(cx, &mut spots[count + 1], x);
            cx.set(&mut exists[count + 1], is);
        }
        (spots, exists)
    }

    /// The deepest vertex; of those that are equally deep the first, so that a resting hull keeps its points. Far above, where
    /// none is below the limit.
    #[inline(always)]
    fn deepest<C: Cx<F = F>>(&self, cx: &mut C, hull: &Hull<'_, C>) -> Vec3<F> {
        let c = F::c;
        let mut lowest = var3(cx, Vec3([c(0.0), c(0.0), c(1e18)]));
        each_low_row!(cx, self.axes[2], self.limit, hull, row, {
            for point in vertex_row(cx, hull.tables, row) {
                // place across the normal and height along it
                let x = self.axes.transpose_mul(point);
                let old = get3(cx, &lowest);
                // whether others are visited depends on clusters
                let touches = x[2].lt(self.limit);
                let deeper = (x[2] + c(SAME_DEPTH) * self.size).lt(old[2]) & touches;
                set3(cx, &mut lowest, select(deeper, x, old));
            }
        });
        get3(cx, &lowest)
    }

    /// The vertex below the limit that adds most to the `count` + 1 chosen, and 1 if there is one, else 0.
    #[inline(always)]
    fn farthest<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        hull: &Hull<'_, C>,
        count: usize,
        chosen: [Vec3<F>; 3],
    ) -> (Vec3<F>, F) {
        let c = F::c;
        let score = ReductionScore::from_chosen(count, chosen);
        let mut best = cx.var(score.threshold(c(SPREAD) * self.size));
        // where none is found the first point stands in, and nothing is found after it
        let mut place = var3(cx, chosen[0]);
        let mut is = cx.var(c(0.0));
        each_low_row!(cx, self.axes[2], self.limit, hull, row, {
            for point in vertex_row(cx, hull.tables, row) {
                let x = self.axes.transpose_mul(point);
                // what the vertex adds, if it is below the limit
                let here = score.at(x[0], x[1]);
                let (old, kept, had) = (cx.get(&best), get3(cx, &place), cx.get(&is));
                let farther = old.lt(here) & x[2].lt(self.limit);
                cx.set(&mut best, F::select(farther, here, old));
                set3(cx, &mut place, select(farther, x, kept));
                cx.set(&mut is, F::select(farther, c(1.0), had));
            }
        });
        (get3(cx, &place), cx.get(&is))
    }
}

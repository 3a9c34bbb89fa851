//! A plane against a hull: up to four of the hull's vertices below the margin.
//!
//! The deepest vertex, and three others that span most (see [`super::reduction`]). MuJoCo takes the deepest, and then those
//! along three fixed directions from it (`mjc_PlaneConvex`). Only clusters of vertices that reach below the margin are
//! visited, which are few: a hull rests on some of its vertices.

use super::hull::{Hull, Part, vertex_row};
use super::hull_axes::{BoxReach, Reach};
use super::narrow::ShapePair;
use super::points::Points;
use super::reduction::ReductionScore;
use super::select::{perpendicular, select};
use super::variables::{get3, set3, var3};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::{span, when};

/// Vertices whose heights differ by less than this part of the hull's radius count as equally deep.
const SAME_DEPTH: f64 = 2e-6;
/// Vertices nearer to those chosen than this part of the hull's radius do not widen a contact.
const SPREAD: f64 = 1e-3;

/// `each_low_row!(cx, view, hull, row, { … })`: the body for every row of vertices of which one may be below the margin, in the
/// worlds where it may.
macro_rules! each_low_row {
    ($cx:ident, $view:expr, $hull:expr, $row:ident, $body:block) => {
        if $hull.tables.clusters.rows == 0 {
            let (first, end) = $hull.span($cx, Part::Vertices);
            span!($cx, $row in first, end, $body);
        } else {
            let (first, end) = $hull.clusters($cx);
            span!($cx, cluster in first, end, {
                let (center, radius) = $hull.cluster($cx, cluster);
                let lowest = $view.axes[2].dot(center) - radius;
                when!($cx, lowest.lt($view.limit), {
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
    let (hull, b, normal) = (pair.hull_b(), pair.pose_b, pair.axes_a[2]);
    let n = b.axes.transpose_mul(normal);
    let height = normal.dot(b.center);
    let half = hull.half_extents(cx);
    let reach = BoxReach(half).reach(n);
    when!(cx, (height - reach).lt(pair.margin), {
        let u = perpendicular(n);
        let view = View {
            axes: Mat3([u, n.cross(u), n]),
            limit: pair.margin - height,
            size: hull.radius(cx),
        };
        let deepest = view.deepest(cx, &hull);
        when!(cx, deepest[2].lt(view.limit), {
            let (spots, found) = view.choose(cx, &hull, deepest);
            for k in 0..4 {
                let x = get3(cx, &spots[k]);
                let distance = x[2] + height;
                // half-way between vertex and plane
                let on_hull = view.axes[0].scale_add(
                    x[0],
                    view.axes[1].scale_add(x[1], n * (x[2] - C::F::c(0.5) * distance)),
                );
                let is = C::F::c(0.5).lt(cx.get(&found[k]));
                let point = b.axes.mul_add(on_hull, b.center);
                out.add(cx, is, point, distance, normal);
            }
        });
    });
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
        let mut found = [cx.var(one), cx.var(zero), cx.var(zero), cx.var(zero)];
        for count in 0..3 {
            let chosen: [Vec3<F>; 3] = [
                get3(cx, &spots[0]),
                get3(cx, &spots[1]),
                get3(cx, &spots[2]),
            ];
            let (x, is) = self.farthest(cx, hull, count, chosen);
            set3(cx, &mut spots[count + 1], x);
            cx.set(&mut found[count + 1], is);
        }
        (spots, found)
    }

    /// The deepest vertex; of those that are equally deep the first, so that a resting hull keeps its points. Far above, where
    /// none is below the limit.
    #[inline(always)]
    fn deepest<C: Cx<F = F>>(&self, cx: &mut C, hull: &Hull<'_, C>) -> Vec3<F> {
        let c = F::c;
        let mut lowest = var3(cx, Vec3([c(0.0), c(0.0), c(1e18)]));
        each_low_row!(cx, self, hull, row, {
            for point in vertex_row(cx, hull.tables, row) {
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
        let score = ReductionScore::of(count, chosen);
        let mut best = cx.var(score.threshold(c(SPREAD) * self.size));
        // where none is found the first point stands in, and nothing is found after it
        let mut place = var3(cx, chosen[0]);
        let mut is = cx.var(c(0.0));
        each_low_row!(cx, self, hull, row, {
            for point in vertex_row(cx, hull.tables, row) {
                let x = self.axes.transpose_mul(point);
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

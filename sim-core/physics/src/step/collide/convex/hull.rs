//! Convex hulls as rows of the model's tables, and their support functions.
//!
//! A support function visits every cluster of vertices that may hold the farthest one. Hill climbing over neighbours (as in
//! MuJoCo's `engine_collision_convex.c`) would take another path in each world of a block.

use super::support::Support;
use crate::constants::hull::HullTables;
use crate::lane::{Cx, Fixed, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::variables::pick3;
use crate::{span, when};

/// `each_far_row!(cx, hull, d, best, row, { … })`: the body for every row of vertices of which one may be farther along `d` than
/// `best`, which the body raises, in the worlds where it may. A direction that is not a number meets every row.
macro_rules! each_far_row {
    ($cx:ident, $hull:expr, $d:ident, $best:ident, $row:ident, $body:block) => {
        // a recorded program has no room for another loop inside those of GJK
        if $hull.tables.clusters.rows == 0 || !C::LOCKSTEP {
            let (first, end) = $hull.span($cx, Part::Vertices);
            span!($cx, $row in first, end, $body);
        } else {
            // not less than the length of d, whose square may be too small for a number
            let length = $d[0].abs() + ($d[1].abs() + $d[2].abs());
            let (first, end) = $hull.clusters($cx);
            span!($cx, cluster in first, end, {
                let (center, radius) = $hull.cluster($cx, cluster);
                // bound of the cluster's vertices along d: d · center + radius |d|
                let bound = radius.fma(length, center.dot($d));
                when!($cx, !bound.lt($cx.get(&$best)), {
                    let (first, end) = $hull.cluster_rows($cx, cluster);
                    span!($cx, $row in first, end, $body);
                });
            });
        }
    };
}

/// A hull in its own frame.
pub(in crate::step::collide) struct Hull<'a, C: Cx> {
    pub tables: &'a HullTables,
    /// Its row in the tables.
    pub row: C::I,
}

impl<C: Cx> Clone for Hull<'_, C> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<C: Cx> Copy for Hull<'_, C> {}

/// A hull in another frame.
pub(in crate::step::collide) struct PosedHull<'a, C: Cx> {
    pub hull: Hull<'a, C>,
    pub axes: Mat3<C::F>,
    pub center: Vec3<C::F>,
}

/// Rows of a hull in the tables.
#[derive(Clone, Copy)]
pub(in crate::step::collide) enum Part {
    Vertices,
    Faces,
    Edges,
}

impl<C: Cx> Hull<'_, C> {
    /// First and end of its rows of a kind.
    #[inline(always)]
    pub fn span(&self, cx: &mut C, part: Part) -> (C::I, C::I) {
        // first and end are columns 2 k and 2 k + 1 of the hull's row of spans
        let part = part as usize;
        let rows = [self.tables.vertices, self.tables.faces, self.tables.edges][part].rows;
        let first = cx.index(self.tables.spans, self.row, 2 * part, rows + 1);
        let end = cx.index(self.tables.spans, self.row, 2 * part + 1, rows + 1);
        (first, end)
    }

    /// First and end of its clusters.
    #[inline(always)]
    pub fn clusters(&self, cx: &mut C) -> (C::I, C::I) {
        let (spans, end) = (self.tables.cluster_spans, self.tables.clusters.rows + 1);
        let first = cx.index(spans, self.row, 0, end);
        (first, cx.index(spans, self.row, 1, end))
    }

    /// Centre and radius of a cluster [m].
    #[inline(always)]
    pub fn cluster(&self, cx: &mut C, cluster: C::I) -> (Vec3<C::F>, C::F) {
        let [x, y, z, radius] = cx.constants(self.tables.clusters, cluster, 0);
        (Vec3([x, y, z]), radius)
    }

    /// First and end of the rows of a cluster's vertices.
    #[inline(always)]
    pub fn cluster_rows(&self, cx: &mut C, cluster: C::I) -> (C::I, C::I) {
        let (rows, end) = (self.tables.cluster_rows, self.tables.vertices.rows + 1);
        let first = cx.index(rows, cluster, 0, end);
        (first, cx.index(rows, cluster, 1, end))
    }

    /// Half extents of its bounding box [m].
    #[inline(always)]
    pub fn half_extents(&self, cx: &mut C) -> Vec3<C::F> {
        Vec3(cx.constants(self.tables.sizes, self.row, 0))
    }

    /// Radius about its centre [m].
    #[inline(always)]
    pub fn radius(&self, cx: &mut C) -> C::F {
        cx.constant(self.tables.sizes, self.row, 3)
    }

    /// How far it reaches along `d`: the largest d · vertex.
    #[inline(always)]
    pub fn reach(&self, cx: &mut C, d: Vec3<C::F>) -> C::F {
        // the largest d · x, four vertices a row
        let mut best = cx.var(C::F::c(-1e18));
        each_far_row!(cx, self, d, best, row, {
            let mut reach = cx.get(&best);
            for point in vertex_row(cx, self.tables, row) {
                reach = reach.max(point.dot(d));
            }
            cx.set(&mut best, reach);
        });
        cx.get(&best)
    }
}

impl<C: Cx> Support<C> for Hull<'_, C> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let mut best = cx.var(C::F::c(-1e18));
        // row of the vertex, and its quarter of the row
        let mut at = cx.var(C::F::c(0.0));
        each_far_row!(cx, self, d, best, row, {
            // a place is row + k/4 for vertex k of a row; of equally far vertices the first visited stays
            let number = cx.number(row);
            let (mut reach, mut place) = (cx.get(&best), cx.get(&at));
            for (k, point) in vertex_row(cx, self.tables, row).into_iter().enumerate() {
                let x = point.dot(d);
                let farther = reach.lt(x);
                reach = reach.max(x);
                place = C::F::select(farther, number + C::F::c(0.25 * k as f64), place);
            }
            cx.set(&mut best, reach);
            cx.set(&mut at, place);
        });
        // the same table with one vertex a row
        let single = Fixed {
            stride: 3,
            rows: 4 * self.tables.vertices.rows,
            ..self.tables.vertices
        };
        let place = cx.get(&at) * C::F::c(4.0);
        pick3(cx, single, place, 0)
    }
}

impl<C: Cx> Support<C> for PosedHull<'_, C> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // the direction in the hull's axes, and the point back from them
        let point = self.hull.farthest(cx, self.axes.transpose_mul(d));
        self.axes.mul_add(point, self.center)
    }
}

/// The four vertices of a row of the tables.
#[inline(always)]
pub(in crate::step::collide) fn vertex_row<C: Cx>(
    cx: &mut C,
    tables: &HullTables,
    row: C::I,
) -> [Vec3<C::F>; 4] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = cx.constants(tables.vertices, row, 0);
    [
        Vec3([a, b, c]),
        Vec3([d, e, f]),
        Vec3([g, h, i]),
        Vec3([j, k, l]),
    ]
}

//! The axis of least depth of two hulls that penetrate: that of the nearest face of their Minkowski difference.
//!
//! A face of the difference comes from a face of either hull, or from two edges whose arcs of normals cross on the sphere
//! (Gregorius, GDC 2013). There are too many pairs of edges to try them all, so most edges of the first hull are rejected by
//! a bound: along the arc of an edge with the point a, between the normals n₁ and n₂, and for any point b of the second hull,
//!
//! ```text
//! depth ≥ min((a - b) · n₁, (a - b) · n₂)        where both are positive
//! ```
//!
//! With b the farthest point against n₁ + n₂ few edges are left to be tried with all edges of the second hull.

use super::hull::{Hull, Part, PosedHull};
use super::hull_axes::SeparatingAxis;
use super::restart::Restart;
use super::support::Support;
use crate::lane::{Cx, Num, Table};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::variables::{get3, pick3, set3, var3};
use crate::{each, push, span, when};

/// Two hulls in the frame of the second, as a restart of GJK from the best of all their axes.
pub(in crate::step::collide) struct MinkowskiFaces<'a, C: Cx> {
    pub first: PosedHull<'a, C>,
    pub second: Hull<'a, C>,
    /// Depth past which all faces of the difference are searched [m].
    pub depth: C::F,
    /// Scratch rows for edges.
    pub edges: Table,
}

/// The best axis so far.
struct BestAxis<C: Cx> {
    depth: C::V,
    axis: [C::V; 3],
}

impl<C: Cx> BestAxis<C> {
    /// Takes an axis that is less deep.
    #[inline(always)]
    fn offer(&mut self, cx: &mut C, depth: C::F, axis: Vec3<C::F>) {
        let (old, kept) = (cx.get(&self.depth), get3(cx, &self.axis));
        let better = depth.lt(old);
        cx.set(&mut self.depth, C::F::select(better, depth, old));
        set3(cx, &mut self.axis, select(better, axis, kept));
    }
}

impl<C: Cx> Restart<C> for MinkowskiFaces<'_, C> {
    const TRIES: usize = 1;
    const BETTER: bool = true;
    #[inline(always)]
    fn depth(&self) -> C::F {
        self.depth
    }

    #[inline(always)]
    fn axis(&self, cx: &mut C, known: SeparatingAxis<C::F>, _: Vec3<C::F>) -> SeparatingAxis<C::F> {
        // another axis must be less deep than the known one
        let mut best = BestAxis {
            depth: cx.var(-known.distance),
            axis: var3(cx, known.normal),
        };
        // the deepest points along the known axis bound the depth of other faces and edges from below
        let on_a = self.first.farthest(cx, known.normal);
        let on_b = self.second.farthest(cx, -known.normal);
        self.faces(cx, on_a, on_b, &mut best);
        // edges are listed before they are tried: the inner loop then runs for few of them
        let mut promising = cx.list(self.edges.rows);
        self.list_edges(cx, on_b, &best, &mut promising);
        self.edge_pairs(cx, &promising, &mut best);
        SeparatingAxis {
            normal: get3(cx, &best.axis),
            distance: -cx.get(&best.depth),
        }
    }
}

impl<C: Cx> MinkowskiFaces<'_, C> {
    /// The faces of both hulls.
    #[inline(always)]
    fn faces(&self, cx: &mut C, on_a: Vec3<C::F>, on_b: Vec3<C::F>, best: &mut BestAxis<C>) {
        let (first, second) = (&self.first, &self.second);
        let faces = second.tables.faces;
        let (start, end) = first.hull.span(cx, Part::Faces);
        span!(cx, face in start, end, {
            // normal n of a face of the first, and max n · A
            let n = first.axes * Vec3(cx.constants(faces, face, 0));
            let height = cx.constant(faces, face, 3) + n.dot(first.center);
            // depth = max n · A - min n · B; with one point of B it is a bound that rejects faces cheaply
            let bound = height - n.dot(on_b);
            when!(cx, bound.lt(cx.get(&best.depth)), {
                let depth = second.reach(cx, -n) + height;
                best.offer(cx, depth, n);
            });
        });
        // faces of the second: axes point from the first to the second, so against their normals
        let (start, end) = second.span(cx, Part::Faces);
        span!(cx, face in start, end, {
            let n = -Vec3(cx.constants(faces, face, 0));
            let height = cx.constant(faces, face, 3);
            let bound = height + n.dot(on_a);
            when!(cx, bound.lt(cx.get(&best.depth)), {
                // depth = max n · A + offset, A posed at its centre
                let far = height + n.dot(first.center);
                let depth = first.hull.reach(cx, first.axes.transpose_mul(n)) + far;
                best.offer(cx, depth, n);
            });
        });
    }

    /// Lists the edges of the first hull that may be less deep than the best axis.
    #[inline(always)]
    fn list_edges(
        &self,
        cx: &mut C,
        on_b: Vec3<C::F>,
        best: &BestAxis<C>,
        promising: &mut C::List,
    ) {
        let (first, second) = (&self.first, &self.second);
        let table = second.tables.edges;
        let (start, end) = first.hull.span(cx, Part::Edges);
        span!(cx, edge in start, end, {
            // normals beside an edge of the first, and its point, in the frame of the second
            let n1 = first.axes * Vec3(cx.constants(table, edge, 6));
            let n2 = first.axes * Vec3(cx.constants(table, edge, 9));
            let point = cx.constants(table, edge, 0);
            let point = first.axes.mul_add(Vec3(point), first.center);
            // the bound of this file's head with b = `on_b`, then with the farthest point against n₁ + n₂
            let way = point - on_b;
            let bound = way.dot(n1).min(way.dot(n2));
            when!(cx, bound.lt(cx.get(&best.depth)), {
                let vertex = second.farthest(cx, -(n1 + n2));
                let way = point - vertex;
                let bound = way.dot(n1).min(way.dot(n2));
                // edges past the capacity of the list are left out
                push!(cx, *promising, bound.lt(cx.get(&best.depth)), row, {
                    let number = cx.number(edge);
                    cx.init(self.edges, row, 0, number);
                });
            });
        });
    }

    /// The edges of the list with those of the second hull.
    #[inline(always)]
    fn edge_pairs(&self, cx: &mut C, promising: &C::List, best: &mut BestAxis<C>) {
        let c = C::F::c;
        let (first, second) = (&self.first, &self.second);
        let table = second.tables.edges;
        each!(cx, row in *promising, {
            let edge = cx.load(self.edges, row, 0);
            // the edge in the frame of the second: point, direction, normals beside it
            let point = pick3(cx, table, edge, 0);
            let point = first.axes.mul_add(point, first.center);
            let d = first.axes * pick3(cx, table, edge, 3);
            let n1 = first.axes * pick3(cx, table, edge, 6);
            let n2 = first.axes * pick3(cx, table, edge, 9);
            let outward = n1 + n2;
            // each edge of the second, with direction q and normals n₃, n₄
            let (start, end) = second.span(cx, Part::Edges);
            span!(cx, other in start, end, {
                let q = Vec3(cx.constants(table, other, 3));
                let n3 = Vec3(cx.constants(table, other, 6));
                let n4 = Vec3(cx.constants(table, other, 9));
                // d is across n₁ and n₂, q across n₃ and n₄: each arc crosses the other's plane, on the same side
                let crosses = (d.dot(n3) * d.dot(n4)).lt(c(0.0)) & (q.dot(n1) * q.dot(n2)).lt(c(0.0));
                when!(cx, crosses, {
                    // n = d × q; `same` where the normals of the second's edge are on its other side
                    let axis = d.cross(q);
                    let square = axis.dot(axis);
                    let side = axis.dot(outward);
                    let same = (side * axis.dot(n3 + n4)).lt(c(0.0));
                    // outward of the first, of unit length; depth = n · (a - b)
                    let unit = c(1.0).div(square.max(c(1e-8)).sqrt());
                    let axis = axis * with_sign(unit, side);
                    let point_b = cx.constants(table, other, 0);
                    let depth = axis.dot(point - Vec3(point_b));
                    // of nearly parallel edges the normal is a face's
                    let is = same & c(1e-8).lt(square);
                    best.offer(cx, C::F::select(is, depth, c(1e18)), axis);
                });
            });
        });
    }
}

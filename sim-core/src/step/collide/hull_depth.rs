//! The axis of least depth of two hulls that penetrate: that of the nearest face of their Minkowski difference.
//!
//! A face of the difference comes from a face of either hull, or from two edges whose arcs of normals cross on the sphere
//! (Gregorius, GDC 2013). Pairs of edges are too many to try. Along the arc of an edge with the point a, between n₁ and
//! n₂, the depth is at least the lesser of (a - b) · n₁ and (a - b) · n₂ if both are positive, for any b of the second
//! hull; so with b its farthest point against n₁ + n₂ few edges are left to be tried with all of the second hull.

use super::gjk::Restart;
use super::hull_axes::Axis;
use super::support::{Polyhedron, Support, Turned, constant3, get3, negated, select3, set3, signed, var3};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Vec3, add, cross, dot, scale, sub, transform, transform_add, transform_back};
use crate::{span, when};

/// Two hulls, in the frame of the second.
pub(super) struct LeastDepth<'a, 'b, C: Cx> {
    pub first: &'a Turned<'b, C>,
    pub second: &'a Polyhedron<'b, C>,
}

/// The best axis so far.
struct Best<C: Cx> {
    depth: C::V,
    axis: [C::V; 3],
}

impl<C: Cx> Best<C> {
    /// Takes an axis that is better, in the worlds of the mask.
    #[inline(always)]
    fn offer(&mut self, cx: &mut C, is: <C::F as Num>::Mask, depth: C::F, axis: Vec3<C::F>) {
        let (old, kept) = (cx.get(&self.depth), get3(cx, &self.axis));
        let better = C::F::and(is, depth.lt(old));
        cx.set(&mut self.depth, C::F::select(better, depth, old));
        set3(cx, &mut self.axis, select3(better, axis, kept));
    }
}

impl<C: Cx> Restart<C> for LeastDepth<'_, '_, C> {
    const SOME: bool = true;
    #[inline(always)]
    fn axis(&self, cx: &mut C, known: Axis<C::F>) -> Axis<C::F> {
        let c = C::F::c;
        let (first, second) = (self.first, self.second);
        let tables = second.tables;
        let all = c(0.0).lt(c(1.0));
        let mut best = Best {
            depth: cx.var(-known.distance),
            axis: var3(cx, known.normal),
        };
        let (start, end) = first.own.span(cx, 1);
        span!(cx, face in start, end, {
            let n = transform(&first.axes, constant3(cx, tables.faces, face, 0));
            let near = cx.constant(tables.faces, face, 3) + dot(n, first.center);
            let depth = second.reach(cx, negated(n)) + near;
            best.offer(cx, all, depth, n);
        });
        let (start, end) = second.span(cx, 1);
        span!(cx, face in start, end, {
            let n = negated(constant3(cx, tables.faces, face, 0));
            let far = cx.constant(tables.faces, face, 3) + dot(n, first.center);
            let depth = first.own.reach(cx, transform_back(&first.axes, n)) + far;
            best.offer(cx, all, depth, n);
        });
        let (start, end) = first.own.span(cx, 2);
        span!(cx, edge in start, end, {
            let n1 = transform(&first.axes, constant3(cx, tables.edges, edge, 6));
            let n2 = transform(&first.axes, constant3(cx, tables.edges, edge, 9));
            let point = constant3(cx, tables.edges, edge, 0);
            let point = transform_add(&first.axes, point, first.center);
            let outward = add(n1, n2);
            let vertex = second.farthest(cx, negated(outward));
            let way = sub(point, vertex);
            let bound = dot(way, n1).min(dot(way, n2));
            let promising = bound.lt(cx.get(&best.depth));
            when!(cx, promising, {
                let d = transform(&first.axes, constant3(cx, tables.edges, edge, 3));
                let (start, end) = second.span(cx, 2);
                span!(cx, other in start, end, {
                    let q = constant3(cx, tables.edges, other, 3);
                    let n3 = negated(constant3(cx, tables.edges, other, 6));
                    let n4 = negated(constant3(cx, tables.edges, other, 9));
                    // d is across n₁ and n₂, q across n₃ and n₄: each arc crosses the other's plane, on the same side
                    let (d3, d4) = (dot(d, n3), dot(d, n4));
                    let (q1, q2) = (dot(q, n1), dot(q, n2));
                    let cross_planes = C::F::and((d3 * d4).lt(c(0.0)), (q1 * q2).lt(c(0.0)));
                    let axis = cross(d, q);
                    let side = dot(axis, outward);
                    let same = c(0.0).lt(side * dot(axis, add(n3, n4)));
                    let square = dot(axis, axis);
                    let unit = c(1.0).div(square.max(c(1e-9)).sqrt());
                    let axis = scale(axis, signed(unit, side));
                    let point_b = constant3(cx, tables.edges, other, 0);
                    let depth = dot(axis, sub(point, point_b));
                    let is = C::F::and(C::F::and(cross_planes, same), c(1e-8).lt(square));
                    best.offer(cx, is, depth, axis);
                });
            });
        });
        Axis {
            normal: get3(cx, &best.axis),
            distance: -cx.get(&best.depth),
        }
    }
}

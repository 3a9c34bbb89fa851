//! Farthest points of shapes, and vectors of machine variables.

use super::choose::select;
use crate::constants::hull::HullTables;
use crate::lane::{Cx, Fixed, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::span;

/// Rounding errors of a few operations, relative to the largest number in them.
#[inline(always)]
pub(super) fn rounding<F: Num>() -> F {
    F::c(16.0 * F::Real::EPSILON)
}

/// New variables.
#[inline(always)]
pub(super) fn var3<C: Cx>(cx: &mut C, x: Vec3<C::F>) -> [C::V; 3] {
    [cx.var(x[0]), cx.var(x[1]), cx.var(x[2])]
}

/// Their values.
#[inline(always)]
pub(super) fn get3<C: Cx>(cx: &C, v: &[C::V; 3]) -> Vec3<C::F> {
    Vec3([cx.get(&v[0]), cx.get(&v[1]), cx.get(&v[2])])
}

/// Assigns in the active worlds.
#[inline(always)]
pub(super) fn set3<C: Cx>(cx: &mut C, v: &mut [C::V; 3], x: Vec3<C::F>) {
    for i in 0..3 {
        cx.set(&mut v[i], x[i]);
    }
}

/// Assigns unmasked; see [`Cx::put`].
#[inline(always)]
pub(super) fn put3<C: Cx>(cx: &mut C, v: &mut [C::V; 3], x: Vec3<C::F>) {
    for i in 0..3 {
        cx.put(&mut v[i], x[i]);
    }
}

/// Three numbers of a row of the model, another in each world.
#[inline(always)]
pub(super) fn pick3<C: Cx>(cx: &mut C, t: Fixed, row: C::F, k: usize) -> Vec3<C::F> {
    Vec3([
        cx.pick(t, row, k),
        cx.pick(t, row, k + 1),
        cx.pick(t, row, k + 2),
    ])
}

/// -a
#[inline(always)]
pub(super) fn negated<F: Num>(a: Vec3<F>) -> Vec3<F> {
    Vec3([-a[0], -a[1], -a[2]])
}

/// `size` with the sign of `x`.
#[inline(always)]
pub(super) fn signed<F: Num>(size: F, x: F) -> F {
    F::select(x.lt(F::c(0.0)), -size, size)
}

/// A unit vector across `a`, which is one too.
#[inline(always)]
pub(super) fn across<F: Num>(a: Vec3<F>) -> Vec3<F> {
    // without its largest or middle component at least a third of its square is left
    let flat = F::c(0.6).lt(a[0].abs());
    let zero = F::c(0.0);
    let b = select(flat, Vec3([-a[1], a[0], zero]), Vec3([zero, -a[2], a[1]]));
    b * F::c(1.0).div(b.dot(b).sqrt())
}

/// What the closest points of two convex shapes are found by.
pub(super) trait Support<C: Cx> {
    /// The point of the shape that is farthest along `d`, a vector of any length but 0.
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F>;
}

/// A point, the core of a sphere.
pub(super) struct Point<F>(pub Vec3<F>);

/// A segment from `center - half` to `center + half`, the core of a capsule.
pub(super) struct Segment<F> {
    pub center: Vec3<F>,
    pub half: Vec3<F>,
}

/// A box.
pub(super) struct Block<F> {
    pub center: Vec3<F>,
    /// From the centre to the middle of three faces.
    pub half: Mat3<F>,
}

/// A cylinder along the z axis of its frame.
pub(super) struct Cylinder<F> {
    pub axes: Mat3<F>,
    pub center: Vec3<F>,
    pub radius: F,
    pub half_height: F,
}

/// A cylinder at the origin along z.
pub(super) struct Upright<F> {
    pub radius: F,
    pub half_height: F,
}

/// A hull in its own frame.
pub(super) struct Polyhedron<'a, C: Cx> {
    pub tables: &'a HullTables,
    pub hull: C::I,
}

/// A hull in another frame.
pub(super) struct Turned<'a, C: Cx> {
    pub own: Polyhedron<'a, C>,
    pub axes: Mat3<C::F>,
    pub center: Vec3<C::F>,
}

impl<C: Cx> Support<C> for Point<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, _: Vec3<C::F>) -> Vec3<C::F> {
        self.0
    }
}

impl<C: Cx> Support<C> for Segment<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let side = signed(C::F::c(1.0), self.half.dot(d));
        self.half.scale_add(side, self.center)
    }
}

impl<C: Cx> Support<C> for Block<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let (one, x) = (C::F::c(1.0), self.half.transpose_mul(d));
        let side = [signed(one, x[0]), signed(one, x[1]), signed(one, x[2])];
        self.half.mul_add(Vec3(side), self.center)
    }
}

impl<C: Cx> Support<C> for Upright<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // along the axis any point of the cap is farthest
        let width = d[0].fma(d[0], d[1] * d[1]).sqrt().max(C::F::c(1e-18));
        let rim = self.radius.div(width);
        Vec3([d[0] * rim, d[1] * rim, signed(self.half_height, d[2])])
    }
}

impl<C: Cx> Support<C> for Cylinder<C::F> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let own = Upright {
            radius: self.radius,
            half_height: self.half_height,
        };
        let point = own.farthest(cx, self.axes.transpose_mul(d));
        self.axes.mul_add(point, self.center)
    }
}

impl<C: Cx> Polyhedron<'_, C> {
    /// First and end of its rows of vertices, faces, edges: `part` 0, 1, 2.
    #[inline(always)]
    pub fn span(&self, cx: &mut C, part: usize) -> (C::I, C::I) {
        let rows = [self.tables.vertices, self.tables.faces, self.tables.edges][part].rows;
        let first = cx.index(self.tables.spans, self.hull, 2 * part, rows + 1);
        let end = cx.index(self.tables.spans, self.hull, 2 * part + 1, rows + 1);
        (first, end)
    }

    /// Half extents of its bounding box.
    #[inline(always)]
    pub fn half_extents(&self, cx: &mut C) -> Vec3<C::F> {
        Vec3(cx.constants(self.tables.sizes, self.hull, 0))
    }

    /// Radius about its centre.
    #[inline(always)]
    pub fn radius(&self, cx: &mut C) -> C::F {
        cx.constant(self.tables.sizes, self.hull, 3)
    }

    /// How far it reaches along `d`: the largest d · vertex.
    #[inline(always)]
    pub fn reach(&self, cx: &mut C, d: Vec3<C::F>) -> C::F {
        let (first, end) = self.span(cx, 0);
        let mut best = cx.var(C::F::c(-1e18));
        span!(cx, row in first, end, {
            let mut reach = cx.get(&best);
            for point in four(cx, self.tables, row) {
                reach = reach.max(point.dot(d));
            }
            cx.put(&mut best, reach);
        });
        cx.get(&best)
    }
}

impl<C: Cx> Support<C> for Polyhedron<'_, C> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let (first, end) = self.span(cx, 0);
        let mut best = cx.var(C::F::c(-1e18));
        let mut at = cx.var(C::F::c(0.0));
        span!(cx, row in first, end, {
            let number = cx.number(row);
            let (mut reach, mut place) = (cx.get(&best), cx.get(&at));
            for (k, point) in four(cx, self.tables, row).into_iter().enumerate() {
                let x = point.dot(d);
                let farther = reach.lt(x);
                reach = reach.max(x);
                place = C::F::select(farther, number + C::F::c(0.25 * k as f64), place);
            }
            cx.put(&mut best, reach);
            cx.put(&mut at, place);
        });
        let single = Fixed {
            stride: 3,
            rows: 4 * self.tables.vertices.rows,
            ..self.tables.vertices
        };
        let place = cx.get(&at) * C::F::c(4.0);
        pick3(cx, single, place, 0)
    }
}

/// The vertices of a row of a hull's table.
#[inline(always)]
pub(super) fn four<C: Cx>(cx: &mut C, tables: &HullTables, row: C::I) -> [Vec3<C::F>; 4] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = cx.constants(tables.vertices, row, 0);
    [
        Vec3([a, b, c]),
        Vec3([d, e, f]),
        Vec3([g, h, i]),
        Vec3([j, k, l]),
    ]
}

impl<C: Cx> Support<C> for Turned<'_, C> {
    #[inline(always)]
    fn farthest(&self, cx: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let point = self.own.farthest(cx, self.axes.transpose_mul(d));
        self.axes.mul_add(point, self.center)
    }
}

/// b - a of the farthest points: that of the shapes' difference which is least along `d`.
#[inline(always)]
pub(super) fn difference<C: Cx>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    d: Vec3<C::F>,
) -> (Vec3<C::F>, Vec3<C::F>) {
    let on_a = a.farthest(cx, d);
    let on_b = b.farthest(cx, negated(d));
    (on_a, on_b - on_a)
}

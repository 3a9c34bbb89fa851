//! The way of a tendon around a sphere or a cylinder (MuJoCo: `mju_wrap`).
//!
//! It is found in the plane of a great circle of the sphere, or across the cylinder. Along the axis of a cylinder the tendon
//! rises evenly over the unrolled way.

use super::flat::{Arc, Flat, TINY, norm, sub};
use super::inner::inner;
use super::outer::outer;
use crate::constants::tendons::{Inner, Wrap};
use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::{Vec3, select};

/// What a tendon does at a shape.
pub(super) struct Bent<C: Cx> {
    /// Where it touches.
    pub touches: MaskOf<C>,
    /// How long it is on the surface [m].
    pub arc: C::F,
    /// Where it meets the surface, in the frame of the shape [m].
    pub meets: Vec3<C::F>,
    /// Where it leaves it [m].
    pub leaves: Vec3<C::F>,
}

/// The way around a shape from one end to another, and past a side site, all in the frame of the shape.
#[inline(always)]
pub(super) fn bend<C: Cx>(
    cx: &mut C,
    around: &Wrap<<C::F as Num>::Real>,
    [first, last]: [Vec3<C::F>; 2],
    side: Option<Vec3<C::F>>,
) -> Bent<C> {
    // one call of each way for both kinds of shapes: the code of a way is long
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let [x, y] = match around.is_cylinder {
        true => [Vec3([one, zero, zero]), Vec3([zero, one, zero])],
        false => plane(first, last),
    };
    let ends = [flat(first, x, y), flat(last, x, y)];
    let radius = C::F::k(around.radius);
    // where the side site is inside of the shape
    let is_inner = match side {
        Some(side) => side.dot(side).sqrt().lt(radius),
        None => zero.lt(zero),
    };
    let within = match around.inner {
        Inner::Never => None,
        Inner::Always => Some(inner(cx, ends, radius, zero.lt(one))),
        Inner::Sometimes => Some(inner(cx, ends, radius, is_inner)),
    };
    let flat_side = side.map(|side| flat(side, x, y));
    let without = match around.inner {
        Inner::Always => None,
        Inner::Never | Inner::Sometimes => Some(outer(ends, flat_side, radius)),
    };
    let arc = match (within, without) {
        (Some(within), Some(without)) => Arc::select(is_inner, &within, &without),
        (Some(arc), None) | (None, Some(arc)) => arc,
        (None, None) => unreachable!("a tendon is on one side of a surface"),
    };
    if around.is_cylinder {
        return unrolled(&arc, ends, [first[2], last[2]]);
    }
    Bent {
        touches: arc.touches,
        arc: arc.length,
        meets: x.scale_add(arc.meets[0], y * arc.meets[1]),
        leaves: x.scale_add(arc.leaves[0], y * arc.leaves[1]),
    }
}

/// A point in the plane of two axes.
#[inline(always)]
fn flat<F: Num>(point: Vec3<F>, x: Vec3<F>, y: Vec3<F>) -> Flat<F> {
    [point.dot(x), point.dot(y)]
}

/// The way around a cylinder from that across it, and the heights of its ends.
#[inline(always)]
fn unrolled<C: Cx>(
    arc: &Arc<C::F>,
    [first, last]: [Flat<C::F>; 2],
    [bottom, top]: [C::F; 2],
) -> Bent<C> {
    let (before, after) = (norm(sub(first, arc.meets)), norm(sub(last, arc.leaves)));
    let way = before + arc.length + after;
    // a select: points divide by 1
    let is_point = way.lt(C::F::c(TINY));
    let rise = (top - bottom).div(C::F::select(is_point, C::F::c(1.0), way));
    let (low, high) = (
        rise.fma(before, bottom),
        rise.fma(before + arc.length, bottom),
    );
    let climbed = high - low;
    Bent {
        touches: arc.touches,
        arc: arc.length.fma(arc.length, climbed * climbed).sqrt(),
        meets: Vec3([arc.meets[0], arc.meets[1], low]),
        leaves: Vec3([arc.leaves[0], arc.leaves[1], high]),
    }
}

/// Axes of the plane through the centre and both ends, the first one towards the first end.
#[inline(always)]
fn plane<F: Num>(first: Vec3<F>, last: Vec3<F>) -> [Vec3<F>; 2] {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let x = unit(first);
    let normal = first.cross(last);
    // where they are in line with the centre, across the axis of which x has most: as in MuJoCo
    let is_line = normal.dot(normal).sqrt().lt(F::c(TINY));
    let (a, b, c) = (x[0].abs(), x[1].abs(), x[2].abs());
    let is_y = a.lt(b) & c.lt(b);
    let is_z = a.lt(c) & b.lt(c);
    let others = Vec3([
        F::select(is_y | is_z, one, zero),
        F::select(is_y, zero, one),
        F::select(is_z, zero, one),
    ]);
    let normal = unit(select(is_line, x.cross(others), normal));
    [x, unit(normal.cross(x))]
}

#[inline(always)]
fn unit<F: Num>(vector: Vec3<F>) -> Vec3<F> {
    let one = F::c(1.0);
    let size = vector.dot(vector).sqrt();
    vector * one.div(F::select(size.lt(F::c(TINY)), one, size))
}

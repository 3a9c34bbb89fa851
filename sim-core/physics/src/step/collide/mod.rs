//! Collision detection: which pairs of shapes are near each other, and where they touch.
//!
//! Every pair of the model's table is looked at: spheres around the shapes first, then, of those that pass, the shapes
//! themselves. A shape's position is kept relative to the reference point of its tree, that of a pair relative to its
//! first shape, so that `f32` keeps its digits far from the origin.

pub mod box_faces;
pub mod boxes;
pub mod capsules;
pub mod choose;
pub mod cylinders;
mod gjk;
mod hull_axes;
mod hull_depth;
pub mod hulls;
pub mod manifold;
mod narrow;
pub mod planes;
pub mod points;
mod samples;
mod sides;
pub mod spheres;
mod spread;
mod support;

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::Cone;
use crate::constants::contact::{
    COUNT_CONTACTS, COUNT_LEFT_OUT, COUNT_ROWS, Contacts, Kind, MU_MIN, pair,
};
use crate::constants::params::Param;
use crate::lane::{Cx, Num, Real, Table};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::{span, when};
pub use narrow::*;
use points::{Placed, Points, Room};

/// Where the shapes are.
pub struct Place;

impl Stage for Place {
    const READS: &'static [A] = &[A::Params, A::Rotation, A::Origin, A::Reference];
    const WRITES: &'static [A] = &[A::ShapePoses, A::ContactPoints];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.contacts.groups.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        place(cx, m, b);
    }
}

/// Poses of all shapes, and the reference points that they are relative to; no contacts yet.
#[inline(always)]
fn place<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>) {
    let (w, memory) = (&b.work, &m.contacts.memory);
    for count in 0..memory.counts.rows {
        let (row, zero) = (cx.at(count), C::F::c(0.0));
        cx.fill(memory.counts, row, 0, zero);
    }
    for (k, solid) in m.contacts.solids.iter().enumerate() {
        let mut axes = Mat3::constant(solid.axes);
        let mut center = Vec3::constant(solid.center);
        if let Some(body) = solid.body {
            let r = &w.rotation[body];
            if solid.is_upright {
                axes = *r;
            } else {
                axes = Mat3([r * axes[0], r * axes[1], r * axes[2]]);
            }
            center = r.mul_add(center, w.origin[body]);
        }
        let row = cx.at(k);
        cx.fill_all(memory.poses, row, 0, axes[0].0);
        cx.fill_all(memory.poses, row, 3, axes[1].0);
        cx.fill_all(memory.poses, row, 6, axes[2].0);
        cx.fill_all(memory.poses, row, 9, center.0);
        if let Some(first) = m.varying.first(Param::ShapeMu) {
            cx.fill(memory.mu, row, 0, b.params[first + solid.shape]);
        }
    }
    for (t, reference) in w.reference.iter().enumerate() {
        let row = cx.at(t);
        cx.fill_all(memory.origins, row, 0, reference.0);
    }
    let world = cx.at(w.reference.len());
    cx.fill_all(memory.origins, world, 0, [C::F::c(0.0); 3]);
}

/// Contacts of all pairs of two kinds.
#[inline(always)]
fn touch<C: Cx, N: Narrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>) {
    if let Some(group) = t.group(N::KINDS) {
        let (first, end) = (cx.at(group.first), cx.at(group.end));
        span!(cx, p in first, end, {
            pair_of::<C, N>(cx, t, p);
        });
    }
}

/// The contacts of a pair.
#[inline(always)]
fn pair_of<C: Cx, N: Narrow>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) {
    let kinds = N::KINDS;
    let (numbers, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
    let (poses, origins) = (t.memory.poses, t.memory.origins);
    let a = cx.index(indices, p, pair::SOLID_A, poses.rows);
    let b = cx.index(indices, p, pair::SOLID_B, poses.rows);
    let origin_a = cx.index(indices, p, pair::ORIGIN_A, origins.rows);
    let origin_b = cx.index(indices, p, pair::ORIGIN_B, origins.rows);
    let center_a = load_vec3(cx, poses, a, 9);
    let origin_a = load_vec3(cx, origins, origin_a, 0);
    let between = load_vec3(cx, origins, origin_b, 0) - origin_a;
    let center = (load_vec3(cx, poses, b, 9) - center_a) + between;
    let radius = cx.constant(numbers, p, pair::RADIUS);
    let near = match kinds.0 {
        Kind::Plane => load_vec3(cx, poses, a, 6).dot(center).lt(radius),
        _ => center.dot(center).lt(radius * radius),
    };
    when!(cx, near, {
        let axes = axes_of(cx, poses, a);
        let first = Shape::read(cx, t, kinds.0, p, pair::SIZE_A, pair::HULL_A);
        // the ball around one against the box around the other: a table's own ball is as wide as the table
        let mut near = near;
        if kinds.0 >= Kind::Box {
            let radius = cx.constant(numbers, p, pair::RADIUS_B);
            near = within(&axes, first.half(kinds.0), center, radius);
        }
        when!(cx, near, {
            let other = Placed {
                axes: axes_of(cx, poses, b),
                center,
            };
            let second = Shape::read(cx, t, kinds.1, p, pair::SIZE_B, pair::HULL_B);
            let smaller = cx.constant(numbers, p, pair::SMALLER);
            let margin = cx.constant(numbers, p, pair::REACH) + contact_slack(smaller);
            let mut near = near;
            if kinds.1 >= Kind::Box && kinds.0 != Kind::Plane {
                let radius = cx.constant(numbers, p, pair::RADIUS_A);
                near = within(&other.axes, second.half(kinds.1), center, radius);
            }
            // the boxes around both, where what comes next takes longer: boxes begin with this themselves
            if kinds.0 >= Kind::Box && kinds.1 > Kind::Box {
                let halves = [first.half(kinds.0), second.half(kinds.1)];
                near = near & overlap(&axes, &other, halves, margin);
            }
            when!(cx, near, {
                let two = Two {
                    axes: &axes,
                    first,
                    other: &other,
                    second,
                    margin,
                };
                let base = (center_a, origin_a);
                let mut points = points_of::<C>(cx, t, p, base);
                N::contacts(cx, t, &two, &mut points);
            });
        });
    });
}

/// What the distances of corners of one face may differ by for rounding, of a shape with this radius [m].
///
/// Contacts begin that much early: of faces that just touch, all corners do, and not those that were rounded down.
#[inline(always)]
pub(super) fn contact_slack<F: Num>(radius: F) -> F {
    radius * F::c(2.0 * <F::Real as Real>::EPSILON)
}

/// Axes of a shape.
#[inline(always)]
fn axes_of<C: Cx>(cx: &mut C, poses: Table, row: C::I) -> Mat3<C::F> {
    Mat3([
        load_vec3(cx, poses, row, 0),
        load_vec3(cx, poses, row, 3),
        load_vec3(cx, poses, row, 6),
    ])
}

/// Is a ball at `center` (from a box, or to it) within a radius of the box?
#[inline(always)]
fn within<F: Num>(axes: &Mat3<F>, half: Vec3<F>, center: Vec3<F>, radius: F) -> F::Mask {
    let mut square = F::c(0.0);
    for (axis, half) in axes.iter().zip(*half) {
        let beyond = ((*axis).dot(center).abs() - half).max(F::c(0.0));
        square = beyond.fma(beyond, square);
    }
    square.lt(radius * radius)
}

/// Does no face of either box have the other beyond it by more than `reach`? The first box's centre is 0.
#[inline(always)]
fn overlap<F: Num>(
    axes: &Mat3<F>,
    other: &Placed<F>,
    [half, other_half]: [Vec3<F>; 2],
    reach: F,
) -> F::Mask {
    let mut gap = F::c(-1.0);
    let mut widths = [F::c(0.0); 3];
    for (axis, half) in axes.iter().zip(*half) {
        let mut width = half;
        for j in 0..3 {
            let turn = (*axis).dot(other.axes[j]).abs();
            width = turn.fma(other_half[j], width);
            widths[j] = turn.fma(half, widths[j]);
        }
        gap = gap.max((*axis).dot(other.center).abs() - (width + reach));
    }
    for j in 0..3 {
        let width = widths[j] + other_half[j] + reach;
        gap = gap.max(other.axes[j].dot(other.center).abs() - width);
    }
    gap.lt(F::c(0.0))
}

/// Coefficient of friction of a pair whose shapes' vary: the larger.
#[inline(always)]
fn friction<C: Cx>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, p: C::I) -> C::F {
    let (indices, table) = (t.handles.pair_indices, t.memory.mu);
    let a = cx.index(indices, p, pair::SOLID_A, table.rows);
    let b = cx.index(indices, p, pair::SOLID_B, table.rows);
    let (a, b) = (cx.load(table, a, 0), cx.load(table, b, 0));
    a.max(b).max(C::F::c(MU_MIN))
}

/// Where the contacts of a pair go.
#[inline(always)]
fn points_of<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    p: C::I,
    (center_a, origin_a): (Vec3<C::F>, Vec3<C::F>),
) -> Points<C> {
    let (numbers, indices) = (t.handles.pair_numbers, t.handles.pair_indices);
    let origins = t.memory.origins;
    let origin = cx.index(indices, p, pair::ORIGIN, origins.rows);
    let origin = load_vec3(cx, origins, origin, 0);
    let class = cx.index(indices, p, pair::CLASS, t.classes.len());
    let [first_end, capacity_end] = t.row_ends();
    let first = cx.index(t.handles.class_rows, class, 0, first_end);
    let capacity = cx.index(t.handles.class_rows, class, 1, capacity_end);
    Points {
        list: cx.kept(t.memory.counts, class, first, capacity),
        table: t.memory.rows,
        pair: cx.number(p),
        base: (center_a + (origin_a - Vec3(origin.0))),
        flip: cx.constant(numbers, p, pair::FLIP),
        mu: match t.memory.mu.rows {
            0 => None,
            _ => Some(friction(cx, t, p)),
        },
        // a pyramid is not the same along all tangents
        along: (t.cone == Cone::Pyramidal).then_some(Vec3([C::F::c(0.0); 3])),
        room: Room {
            counts: t.memory.counts,
            contacts: t.classes.len() + COUNT_CONTACTS,
            rows: t.classes.len() + COUNT_ROWS,
            left_out: t.classes.len() + COUNT_LEFT_OUT,
            contacts_max: C::F::c(t.contacts_max as f64),
            rows_max: C::F::c(t.rows_max as f64),
            of_a_contact: cx.constant(numbers, p, pair::ROWS),
            is_tight: t.may_overflow,
        },
    }
}

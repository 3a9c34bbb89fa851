//! MuJoCo's own search for the contacts of two shapes without a closed form, in double precision.
//!
//! Iterations that end at a tolerance leave a normal and a depth that depend on the path to them. So runs agree with MuJoCo
//! only where decisions are the same: those of its `engine_collision_gjk.c` and `engine_collision_convex.c`, as 3.17 has them.
//! A block of `f64` has one world, so this code may branch on its numbers. Lanes and GPUs have [`super::convex`] instead.
//!
//! | Part | File |
//! |---|---|
//! | shapes, their support functions | `solid` |
//! | the distance of shapes that do not overlap | `gjk`, `nearest` |
//! | the depth of those that do | `epa`, `first_polytope`, `polytope` |
//! | several points of shapes that lie on each other | `features`, `sides`, `clip` |
//! | all of it, with margins | `search` |
//! | a mesh on a plane | `plane` |

mod clip;
mod epa;
mod features;
mod first_polytope;
mod gjk;
mod nearest;
mod plane;
mod polytope;
mod search;
mod sides;
mod solid;
mod vector;

use super::convex::prism::Prism;
use super::manifold::points::Points;
use super::narrow::{Shape, ShapePair};
use crate::constants::contact::Kind;
use crate::constants::hull::reference::{Limits, ReferenceSearch};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use clip::Contacts;
use search::Nearest;
use solid::{Form, Solid};

/// Do two kinds of shapes touch where iterations end, or at vertices of a mesh? The others have closed forms, or a height field.
pub const fn is_reference((first, second): (Kind, Kind)) -> bool {
    match (first, second) {
        (Kind::Plane, Kind::Hull) => true,
        (Kind::Plane | Kind::Field, _) | (Kind::Box, Kind::Box) => false,
        (Kind::Sphere, second) => matches!(second, Kind::Ellipsoid | Kind::Hull),
        (Kind::Capsule, second) => !matches!(second, Kind::Capsule | Kind::Box),
        _ => true,
    }
}

/// Adds the contacts of a pair, and returns whether the search has room for its shapes.
#[inline(always)]
pub fn reference_contacts<C: Cx>(
    cx: &mut C,
    (first, second): (Kind, Kind),
    pair: &ShapePair<'_, C>,
    out: &mut Points<C>,
) -> bool {
    // the first shape is at the origin
    let search = pair.reference;
    let center = Vec3([C::F::c(0.0); 3]);
    let first_solid = solid(cx, search, first, &pair.a, pair.axes_a, center);
    let b = pair.pose_b;
    let second_solid = solid(cx, search, second, &pair.b, &b.axes, b.center);
    let (Some(a), Some(b)) = (first_solid, second_solid) else {
        return false;
    };
    let margin = cx.reference(pair.reach);
    if let (Kind::Plane, Form::Mesh(hull)) = (first, b.form) {
        let points = plane::plane_contacts(a.axes[2], &b, hull, margin);
        add_all(cx, points, 1.0, out);
        return true;
    }
    // MuJoCo's order of kinds has ellipsoids and cylinders before boxes
    let is_swapped = rank(first) > rank(second);
    let (solids, side) = match is_swapped {
        true => ([b, a], -1.0),
        false => ([a, b], 1.0),
    };
    let points = contacts(solids, margin, &search.limits);
    add_all(cx, points, side, out);
    true
}

/// Adds contacts, with normals from the first shape of the pair where `side` is 1, from the second where it is -1.
#[inline(always)]
fn add_all<C: Cx>(cx: &mut C, contacts: Contacts, side: f64, out: &mut Points<C>) {
    // this world is active, or the block would have been skipped
    let always = C::F::c(0.0).lt(C::F::c(1.0));
    for contact in contacts {
        let point = Vec3(contact.point.map(C::F::c));
        let normal = Vec3(contact.normal.map(|x| C::F::c(x * side)));
        out.add(cx, always, point, C::F::c(contact.distance), normal);
    }
}

/// Adds the contact of a shape of this kind, the first of the pair, and a prism of a height field, whose axes are those of the
/// second. `axes` are the shape's in these, and `bottom` is the height of the field's (MuJoCo: `mjc_ConvexHField`).
#[inline(always)]
pub fn reference_prism<C: Cx>(
    cx: &mut C,
    kind: Kind,
    pair: &ShapePair<'_, C>,
    (axes, prism, bottom): (&Mat3<C::F>, &Prism<C::F>, C::F),
    out: &mut Points<C>,
) -> bool {
    // the centre of the shape is the origin
    let zero = C::F::c(0.0);
    let Some(shape) = solid(cx, pair.reference, kind, &pair.a, axes, Vec3([zero; 3])) else {
        return false;
    };
    // MuJoCo's order of corners: from row to row of the field
    let [p, q, k] = prism.top;
    let top = match cx.reference(prism.side) > 0.0 {
        true => [k, p, q],
        false => [p, q, k],
    };
    let top = top.map(|corner| corner.0.map(|x| cx.reference(x)));
    let bottom = cx.reference(bottom);
    let margin = cx.reference(pair.reach);
    // a prism touches in one point
    let limits = Limits {
        several: false,
        ..pair.reference.limits
    };
    let always = zero.lt(C::F::c(1.0));
    for contact in contacts([Solid::prism(top, bottom), shape], margin, &limits) {
        // in the axes of the pair, from the shape to the field
        let point = pair.pose_b.axes * Vec3(contact.point.map(C::F::c));
        let normal = pair.pose_b.axes * Vec3(contact.normal.map(|x| C::F::c(-x)));
        out.add(cx, always, point, C::F::c(contact.distance), normal);
    }
    true
}

/// One instance for all pairs of kinds.
#[inline(never)]
fn contacts(solids: [Solid<'_>; 2], margin: f64, limits: &Limits) -> Contacts {
    search::contacts(solids, margin, limits)
}

/// The place of a kind in MuJoCo's order, of those that iterate.
const fn rank(kind: Kind) -> usize {
    match kind {
        Kind::Sphere => 0,
        Kind::Capsule => 1,
        Kind::Ellipsoid => 2,
        Kind::Cylinder => 3,
        Kind::Box => 4,
        _ => 5,
    }
}

/// A shape of the pair; none where the search has no room for its hull.
#[inline(always)]
fn solid<'a, C: Cx>(
    cx: &mut C,
    search: &'a ReferenceSearch,
    kind: Kind,
    shape: &Shape<C>,
    axes: &Mat3<C::F>,
    center: Vec3<C::F>,
) -> Option<Solid<'a>> {
    // the numbers of the one world
    let mut numbers = |v: Vec3<C::F>| v.0.map(|x| cx.reference(x));
    let mut solid = Solid {
        form: Form::Sphere,
        size: numbers(shape.half_extents()),
        center: numbers(center),
        axes: [numbers(axes[0]), numbers(axes[1]), numbers(axes[2])],
    };
    solid.form = match kind {
        Kind::Capsule => Form::Capsule,
        Kind::Ellipsoid => Form::Ellipsoid,
        Kind::Cylinder => Form::Cylinder,
        Kind::Box => Form::Box,
        Kind::Hull => {
            let row = cx.number(shape.hull());
            let hull = search.hulls[cx.reference(row).to_usize()].as_ref()?;
            // MuJoCo's centre of a mesh is the origin of its vertices
            solid.center = solid.placed(hull.origin);
            Form::Mesh(hull)
        }
        _ => Form::Sphere,
    };
    Some(solid)
}
